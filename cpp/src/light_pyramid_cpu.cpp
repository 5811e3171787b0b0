#include <algorithm>
#include <atomic>
#include <stdexcept>
#include <string>
#include <vector>

#include "splitnerf/kernels.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"

namespace splitnerf::cpu {
namespace {

constexpr int64_t kPointGrain = 1024, kChunkPoints = 2048;

}  // namespace

template <class T> void run(int64_t n, const LightLookupBody<T>& b) {
  parallel_for(n, kPointGrain, [&](int64_t begin, int64_t end) {
    kernels<T>().light_lookup(b.pyramid, begin, end, b.directions, b.roughness, b.radiance);
  });
}
template void run<float>(int64_t, const LightLookupBody<float>&);
template void run<double>(int64_t, const LightLookupBody<double>&);

template <class T> void run(int64_t n, const SparseProductBody<T>& b) {
  constexpr int64_t kRowGrain = 64, kColumnGrain = 1 << 14;
  const int64_t n_padded = b.matrix.n_columns * b.matrix.n_images;
  std::vector<T> padded(4 * n_padded);
  parallel_for(n_padded, kColumnGrain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) std::copy_n(b.values + 3 * int64_t(b.matrix.images[i]), 3, &padded[4 * i]);
  });
  std::atomic<bool> in_range{true};
  parallel_for(n / b.matrix.n_images, kRowGrain, [&](int64_t begin, int64_t end) {
    if (!kernels<T>().sparse_product(b.matrix, padded.data(), begin, end, b.products)) in_range = false;
  });
  if (!in_range)
    throw std::invalid_argument("sparse_product: columns must hold numbers in [0, " +
                                std::to_string(b.matrix.n_columns) + ")");
}
template void run<float>(int64_t, const SparseProductBody<float>&);
template void run<double>(int64_t, const SparseProductBody<double>&);

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

template void light_lookup_backward<float>(const LightPyramid<float>&, int64_t, const float*, const float*,
                                           const float*, float*, float*, float*, float*);
template void light_lookup_backward<double>(const LightPyramid<double>&, int64_t, const double*, const double*,
                                            const double*, double*, double*, double*, double*);

}  // namespace splitnerf::cpu
