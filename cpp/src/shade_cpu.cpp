#include "for_each.h"
#include "splitnerf/bodies/shading.h"
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
  for_each(n, kGrain, QueryDirectionBody<T>{lut, mean, normals, view_dirs, roughness, directions});
}

template <class T>
void query_direction_backward(const float* lut, bool mean, int64_t n, const T* normals, const T* view_dirs,
                              const T* roughness, const T* grad_directions, T* grad_normals, T* grad_view_dirs,
                              T* grad_roughness) {
  for_each(n, kGrain,
           QueryDirectionBackwardBody<T>{lut, mean, normals, view_dirs, roughness, grad_directions, grad_normals,
                                         grad_view_dirs, grad_roughness});
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
