#include <algorithm>
#include <vector>

#include "for_each.h"
#include "splitnerf/bodies/monte_carlo.h"
#include "splitnerf/bodies/shading.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"

namespace splitnerf::cpu {
namespace {

constexpr int64_t kGrain = 32;         // points with many directions each
constexpr int64_t kShadeGrain = 1024;  // points

}  // namespace

template <class T>
void sample_bsdf(int64_t n, const T* normals, const T* view_dirs, const T* roughness, int n_samples, uint32_t seed,
                 T* directions, T* pdf) {
  for_each_alone(n, kGrain, SampleBsdfBody<T>{normals, view_dirs, roughness, n_samples, seed, directions, pdf});
}

template <class T>
void monte_carlo_light(int64_t n, int n_samples, const T* normals, const T* view_dirs, const T* roughness,
                       const T* light_dirs, const T* pdf, const T* radiance, T* sums) {
  const DrawnLight<T> light{n_samples, light_dirs, pdf, radiance};
  for_each_alone(n, kGrain, SumLightBody<T, DrawnLight<T>>{n_samples, normals, view_dirs, roughness, light, sums});
}

template <class T>
void monte_carlo_light_backward(int64_t n, int n_samples, const T* normals, const T* view_dirs, const T* roughness,
                                const T* light_dirs, const T* pdf, const T* radiance, const T* grad_sums,
                                T* grad_normals, T* grad_roughness, T* grad_radiance) {
  const DrawnLight<T> light{n_samples, light_dirs, pdf, radiance};
  for_each_alone(n, kGrain,
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
void summed_light(int64_t n, const T* normals, const T* view_dirs, const T* roughness, const SharedLight<T>& light,
                  T* sums) {
  for_each_alone(n, kGrain, SumLightBody<T, ArrivingLight<T>>{light.n, normals, view_dirs, roughness, {light}, sums});
}

template <class T>
void summed_light_backward(int64_t n, const T* normals, const T* view_dirs, const T* roughness,
                           const SharedLight<T>& light, const T* grad_sums, T* grad_normals, T* grad_roughness,
                           T* grad_light) {
  const int64_t n_chunks = clamp<int64_t>(n / kGrain, 1, kLightChunks), stride = 3 * int64_t{light.n};
  std::vector<T> partial(n_chunks * stride);  // added in order: the same bits each time
  parallel_for(n_chunks, 1, [&](int64_t first, int64_t last) {
    for (int64_t c = first; c < last; ++c) {
      const SumLightBackwardBody<T, ArrivingLight<T>, ToSharedLight<T>> body{
          light.n,      normals,        view_dirs,
          roughness,    {light},        grad_sums,
          grad_normals, grad_roughness, {light.n, light.visible, &partial[c * stride]}};
      for (int64_t i = c * n / n_chunks; i < (c + 1) * n / n_chunks; ++i) body(OneThread{}, i);
    }
  });
  std::fill(grad_light, grad_light + stride, T(0));
  for (int64_t c = 0; c < n_chunks; ++c)
    for (int64_t k = 0; k < stride; ++k) grad_light[k] += partial[c * stride + k];
}

template <class T>
void shade_sums(const float* lut, bool compensate, int64_t n, const SummedArrays<const T>& in, T* radiance) {
  for_each(n, kShadeGrain, ShadeSumsBody<T>{lut, compensate, in, radiance});
}

template <class T>
void shade_sums_backward(const float* lut, bool compensate, int64_t n, const SummedArrays<const T>& in,
                         const T* grad_radiance, const SummedArrays<T>& grad) {
  for_each(n, kShadeGrain, ShadeSumsBackwardBody<T>{lut, compensate, in, grad_radiance, grad});
}

#define SPLITNERF_INSTANTIATE(T)                                                                                     \
  template void sample_bsdf<T>(int64_t, const T*, const T*, const T*, int, uint32_t, T*, T*);                        \
  template void monte_carlo_light<T>(int64_t, int, const T*, const T*, const T*, const T*, const T*, const T*, T*);  \
  template void monte_carlo_light_backward<T>(int64_t, int, const T*, const T*, const T*, const T*, const T*,        \
                                              const T*, const T*, T*, T*, T*);                                       \
  template void summed_light<T>(int64_t, const T*, const T*, const T*, const SharedLight<T>&, T*);                   \
  template void summed_light_backward<T>(int64_t, const T*, const T*, const T*, const SharedLight<T>&, const T*, T*, \
                                         T*, T*);                                                                    \
  template void shade_sums<T>(const float*, bool, int64_t, const SummedArrays<const T>&, T*);                        \
  template void shade_sums_backward<T>(const float*, bool, int64_t, const SummedArrays<const T>&, const T*,          \
                                       const SummedArrays<T>&);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cpu
