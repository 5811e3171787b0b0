#include "splitnerf/bodies/monte_carlo.h"
#include "warp.cuh"

namespace splitnerf::cuda {

template <class T>
void sample_ggx_lobe(const Queue& queue, int64_t n, const T* axes, const T* roughness, int n_samples, uint32_t seed,
                     T* directions) {
  for_each_group(queue, "sample_ggx_lobe", n, SampleLobeBody<T>{axes, roughness, n_samples, seed, directions});
}

template <class T>
void sample_bsdf(const Queue& queue, int64_t n, const T* normals, const T* view_dirs, const T* roughness, int n_samples,
                 uint32_t seed, T* directions, T* pdf) {
  for_each_group(queue, "sample_bsdf", n,
                 SampleBsdfBody<T>{normals, view_dirs, roughness, n_samples, seed, directions, pdf});
}

template <class T>
void monte_carlo_light(const Queue& queue, int64_t n, int n_samples, const T* normals, const T* view_dirs,
                       const T* roughness, const T* light_dirs, const T* pdf, const T* radiance, T* sums) {
  const DrawnLight<T> light{n_samples, light_dirs, pdf, radiance};
  for_each_group(queue, "monte_carlo_light", n,
                 SumLightBody<T, DrawnLight<T>>{n_samples, normals, view_dirs, roughness, light, sums});
}

template <class T>
void monte_carlo_light_backward(const Queue& queue, int64_t n, int n_samples, const T* normals, const T* view_dirs,
                                const T* roughness, const T* light_dirs, const T* pdf, const T* radiance,
                                const T* grad_sums, T* grad_normals, T* grad_roughness, T* grad_radiance) {
  const DrawnLight<T> light{n_samples, light_dirs, pdf, radiance};
  for_each_group(queue, "monte_carlo_light_backward", n,
                 SumLightBackwardBody<T, DrawnLight<T>, ToDrawnLight<T>>{n_samples,
                                                                         normals,
                                                                         view_dirs,
                                                                         roughness,
                                                                         light,
                                                                         grad_sums,
                                                                         grad_normals,
                                                                         grad_roughness,
                                                                         {n_samples, grad_radiance}});
}

template <class T>
void summed_light(const Queue& queue, int64_t n, const T* normals, const T* view_dirs, const T* roughness,
                  const SharedLight<T>& light, T* sums) {
  for_each_group(queue, "summed_light", n,
                 SumLightBody<T, ArrivingLight<T>>{light.n, normals, view_dirs, roughness, {light}, sums});
}

template <class T>
void summed_light_backward(const Queue& queue, int64_t n, const T* normals, const T* view_dirs, const T* roughness,
                           const SharedLight<T>& light, const T* grad_sums, T* grad_normals, T* grad_roughness,
                           T* grad_light) {
  clear(queue, "summed_light_backward", grad_light, 3 * int64_t{light.n});
  for_each_group(queue, "summed_light_backward", n,
                 SumLightBackwardBody<T, ArrivingLight<T>, ToSharedLight<T>>{light.n,
                                                                             normals,
                                                                             view_dirs,
                                                                             roughness,
                                                                             {light},
                                                                             grad_sums,
                                                                             grad_normals,
                                                                             grad_roughness,
                                                                             {light.n, light.visible, grad_light}});
}

#define SPLITNERF_INSTANTIATE(T)                                                                                     \
  template void sample_ggx_lobe<T>(const Queue&, int64_t, const T*, const T*, int, uint32_t, T*);                    \
  template void sample_bsdf<T>(const Queue&, int64_t, const T*, const T*, const T*, int, uint32_t, T*, T*);          \
  template void monte_carlo_light<T>(const Queue&, int64_t, int, const T*, const T*, const T*, const T*, const T*,   \
                                     const T*, T*);                                                                  \
  template void monte_carlo_light_backward<T>(const Queue&, int64_t, int, const T*, const T*, const T*, const T*,    \
                                              const T*, const T*, const T*, T*, T*, T*);                             \
  template void summed_light<T>(const Queue&, int64_t, const T*, const T*, const T*, const SharedLight<T>&, T*);     \
  template void summed_light_backward<T>(const Queue&, int64_t, const T*, const T*, const T*, const SharedLight<T>&, \
                                         const T*, T*, T*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cuda
