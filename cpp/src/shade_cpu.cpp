#include "splitnerf/kernels.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"

namespace splitnerf::cpu {
namespace {

constexpr int64_t kGrain = 1024;

}  // namespace

template <class T>
void query_direction(const float* lut, bool mean, int64_t n, const T* normals, const T* view_dirs, const T* roughness,
                     T* directions) {
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i)
      store3(directions + 3 * i,
             splitnerf::query_direction(lut, mean, load3(normals + 3 * i), load3(view_dirs + 3 * i), roughness[i]));
  });
}

template <class T>
void query_direction_backward(const float* lut, bool mean, int64_t n, const T* normals, const T* view_dirs,
                              const T* roughness, const T* grad_directions, T* grad_normals, T* grad_view_dirs,
                              T* grad_roughness) {
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const QueryDirectionGrad<T> g = splitnerf::query_direction_backward(
          lut, mean, load3(normals + 3 * i), load3(view_dirs + 3 * i), roughness[i], load3(grad_directions + 3 * i));
      store3(grad_normals + 3 * i, g.normal);
      store3(grad_view_dirs + 3 * i, g.view);
      grad_roughness[i] = g.roughness;
    }
  });
}

template <class T>
void split_sum_shade(const float* lut, ShadeOptions options, int64_t n, int n_channels, const ShadeArrays<const T>& in,
                     T* radiance) {
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    kernels<T>().split_sum_shade(lut, options, begin, end, n_channels, in, radiance);
  });
}

template <class T>
void split_sum_shade_backward(const float* lut, ShadeOptions options, int64_t n, int n_channels,
                              const ShadeArrays<const T>& in, const T* grad_radiance, const ShadeArrays<T>& grad) {
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    kernels<T>().split_sum_shade_backward(lut, options, begin, end, n_channels, in, grad_radiance, grad);
  });
}

#define SPLITNERF_INSTANTIATE(T)                                                                                     \
  template void query_direction<T>(const float*, bool, int64_t, const T*, const T*, const T*, T*);                   \
  template void query_direction_backward<T>(const float*, bool, int64_t, const T*, const T*, const T*, const T*, T*, \
                                            T*, T*);                                                                 \
  template void split_sum_shade<T>(const float*, ShadeOptions, int64_t, int, const ShadeArrays<const T>&, T*);       \
  template void split_sum_shade_backward<T>(const float*, ShadeOptions, int64_t, int, const ShadeArrays<const T>&,   \
                                            const T*, const ShadeArrays<T>&);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cpu
