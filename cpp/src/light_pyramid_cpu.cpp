#include <algorithm>
#include <vector>

#include "splitnerf/kernels.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"

namespace splitnerf::cpu {
namespace {

constexpr int64_t kRowGrain = 512, kPointGrain = 1024, kChunkPoints = 2048;

}  // namespace

template <class T>
void sparse_product(const SparseRows<T>& matrix, int64_t n_rows, int64_t n_columns, const T* values, T* products) {
  std::vector<T> padded(4 * n_columns);
  for (int64_t i = 0; i < n_columns; ++i) std::copy_n(values + 3 * i, 3, &padded[4 * i]);
  parallel_for(n_rows, kRowGrain, [&](int64_t begin, int64_t end) {
    kernels<T>().sparse_product(matrix, begin, end, padded.data(), products);
  });
}

template <class T>
void light_lookup(const LightPyramid<T>& pyramid, int64_t n, const T* directions, const T* roughness, T* radiance) {
  parallel_for(n, kPointGrain, [&](int64_t begin, int64_t end) {
    kernels<T>().light_lookup(pyramid, begin, end, directions, roughness, radiance);
  });
}

template <class T>
void light_lookup_backward(const LightPyramid<T>& pyramid, int64_t n, const T* directions, const T* roughness,
                           const T* grad_radiance, T* grad_directions, T* grad_roughness, T* grad_levels, T* grad_sh) {
  const int64_t n_levels = 3 * light_texels(pyramid), n_sh = 3 * kShCoefficients;
  const int64_t n_chunks = std::clamp<int64_t>((n + kChunkPoints - 1) / kChunkPoints, 1, kLightChunks);
  const int64_t stride = n_levels + n_sh;
  std::vector<T> copies((n_chunks - 1) * stride);  // the first chunk writes to the result
  std::fill(grad_levels, grad_levels + n_levels, T(0));
  std::fill(grad_sh, grad_sh + n_sh, T(0));
  parallel_for(n_chunks, 1, [&](int64_t first, int64_t end) {
    for (int64_t c = first; c < end; ++c) {
      T *to_levels = c ? &copies[(c - 1) * stride] : grad_levels, *to_sh = c ? to_levels + n_levels : grad_sh;
      kernels<T>().light_lookup_backward(pyramid, c * n / n_chunks, (c + 1) * n / n_chunks, directions, roughness,
                                         grad_radiance, grad_directions, grad_roughness, to_levels, to_sh);
    }
  });
  for (int64_t c = 1; c < n_chunks; ++c) {
    const T* copy = &copies[(c - 1) * stride];
    parallel_for(n_levels, 1 << 14, [&](int64_t begin, int64_t end) {
      for (int64_t i = begin; i < end; ++i) grad_levels[i] += copy[i];
    });
    for (int64_t i = 0; i < n_sh; ++i) grad_sh[i] += copy[n_levels + i];
  }
}

#define SPLITNERF_INSTANTIATE(T)                                                          \
  template void sparse_product<T>(const SparseRows<T>&, int64_t, int64_t, const T*, T*);  \
  template void light_lookup<T>(const LightPyramid<T>&, int64_t, const T*, const T*, T*); \
  template void light_lookup_backward<T>(const LightPyramid<T>&, int64_t, const T*, const T*, const T*, T*, T*, T*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cpu
