#include "launch.cuh"
#include "splitnerf/bodies/elementwise.h"
#include "splitnerf/bodies/shading.h"

namespace splitnerf::cuda {

template <class T>
void query_direction(const Queue& queue, const float* lut, bool mean, int64_t n, const T* normals, const T* view_dirs,
                     const T* roughness, T* directions) {
  for_each(queue, "query_direction", n, QueryDirectionBody<T>{lut, mean, normals, view_dirs, roughness, directions});
}

template <class T>
void query_direction_backward(const Queue& queue, const float* lut, bool mean, int64_t n, const T* normals,
                              const T* view_dirs, const T* roughness, const T* grad_directions, T* grad_normals,
                              T* grad_view_dirs, T* grad_roughness) {
  for_each(queue, "query_direction_backward", n,
           QueryDirectionBackwardBody<T>{lut, mean, normals, view_dirs, roughness, grad_directions, grad_normals,
                                         grad_view_dirs, grad_roughness});
}

template <class T>
void split_sum_shade(const Queue& queue, const float* lut, ShadeOptions options, int64_t n, int n_channels,
                     const ShadeArrays<const T>& in, T* radiance) {
  for_each(queue, "split_sum_shade", n, ShadeBody<T>{lut, options, n_channels, in, radiance});
}

template <class T>
void split_sum_shade_backward(const Queue& queue, const float* lut, ShadeOptions options, int64_t n, int n_channels,
                              const ShadeArrays<const T>& in, const T* grad_radiance, const ShadeArrays<T>& grad) {
  for_each(queue, "split_sum_shade_backward", n,
           ShadeBackwardBody<T>{lut, options, n_channels, in, grad_radiance, grad});
}

template <class T>
void shade_sums(const Queue& queue, const float* lut, bool compensate, int64_t n, const SummedArrays<const T>& in,
                T* radiance) {
  for_each(queue, "shade_sums", n, ShadeSumsBody<T>{lut, compensate, in, radiance});
}

template <class T>
void shade_sums_backward(const Queue& queue, const float* lut, bool compensate, int64_t n,
                         const SummedArrays<const T>& in, const T* grad_radiance, const SummedArrays<T>& grad) {
  for_each(queue, "shade_sums_backward", n, ShadeSumsBackwardBody<T>{lut, compensate, in, grad_radiance, grad});
}

template <class T> void linear_to_srgb(const Queue& queue, int64_t n, const T* linear, T* srgb) {
  for_each(queue, "linear_to_srgb", n, LinearToSrgbBody<T>{linear, srgb});
}

template <class T>
void linear_to_srgb_backward(const Queue& queue, int64_t n, const T* linear, const T* grad_srgb, T* grad_linear) {
  for_each(queue, "linear_to_srgb_backward", n, LinearToSrgbBackwardBody<T>{linear, grad_srgb, grad_linear});
}

template <class T> void srgb_to_linear(const Queue& queue, int64_t n, const T* srgb, T* linear) {
  for_each(queue, "srgb_to_linear", n, SrgbToLinearBody<T>{srgb, linear});
}

#define SPLITNERF_INSTANTIATE(T)                                                                                     \
  template void query_direction<T>(const Queue&, const float*, bool, int64_t, const T*, const T*, const T*, T*);     \
  template void query_direction_backward<T>(const Queue&, const float*, bool, int64_t, const T*, const T*, const T*, \
                                            const T*, T*, T*, T*);                                                   \
  template void split_sum_shade<T>(const Queue&, const float*, ShadeOptions, int64_t, int,                           \
                                   const ShadeArrays<const T>&, T*);                                                 \
  template void split_sum_shade_backward<T>(const Queue&, const float*, ShadeOptions, int64_t, int,                  \
                                            const ShadeArrays<const T>&, const T*, const ShadeArrays<T>&);           \
  template void shade_sums<T>(const Queue&, const float*, bool, int64_t, const SummedArrays<const T>&, T*);          \
  template void shade_sums_backward<T>(const Queue&, const float*, bool, int64_t, const SummedArrays<const T>&,      \
                                       const T*, const SummedArrays<T>&);                                            \
  template void linear_to_srgb<T>(const Queue&, int64_t, const T*, T*);                                              \
  template void linear_to_srgb_backward<T>(const Queue&, int64_t, const T*, const T*, T*);                           \
  template void srgb_to_linear<T>(const Queue&, int64_t, const T*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cuda
