// Directions drawn for a point, and the sums over the light that comes from them.
#pragma once

#include "splitnerf/monte_carlo.h"
#include "splitnerf/sampling.h"

namespace splitnerf {

// The shift of a point's own copy of the lattice.
template <class T> SPLITNERF_HD Vec2<T> lattice_shift(uint32_t seed, int64_t point) {
  const auto counter = static_cast<uint32_t>(point);
  return {random_unit<T>(seed, counter, 0), random_unit<T>(seed, counter, 1)};
}

// directions [n, n_samples, 3]; a group of threads an axis.
template <class T> struct SampleLobeBody {
  const T *axes, *roughness;
  int n_samples;
  uint32_t seed;
  T* directions;

  template <class Group> SPLITNERF_HD void operator()(const Group& group, int64_t i) const {
    const Frame<T> frame(load3(axes + 3 * i));
    const Vec2<T> shift = lattice_shift<T>(seed, i);
    const T ggx_alpha = ggx_alpha_from_roughness(roughness[i]);
    for (int k = group.lane(); k < n_samples; k += Group::size) {
      const Vec2<T> u = fibonacci_lattice<T>(k, n_samples, shift);
      store3(directions + 3 * (i * n_samples + k), frame.to_world(sample_ggx_lobe(u.x, u.y, ggx_alpha)));
    }
  }
};
SPLITNERF_ON_GPU(SampleLobeBody);

// The directions of one point, drawn for it.
template <class T> struct DrawnLight {
  int n;
  const T *light_dirs, *pdf, *radiance;

  SPLITNERF_HD DrawnLight of_point(int64_t p) const {
    return {n, light_dirs + 3 * p * n, pdf + p * n, radiance + 3 * p * n};
  }
  SPLITNERF_HD IncomingLight<T> operator()(int i) const {
    return {load3(light_dirs + 3 * i), pdf[i] > T(0) ? T(1) / (T(n) * pdf[i]) : T(0), load3(radiance + 3 * i)};
  }
};

// The part of a shared light that arrives at one point.
template <class T> struct ArrivingLight {
  SharedLight<T> light;

  SPLITNERF_HD ArrivingLight of_point(int64_t p) const {
    SharedLight<T> here = light;
    here.visible += p * light.n;
    if (here.sent) here.sent += 3 * p * light.n;
    return {here};
  }
  SPLITNERF_HD IncomingLight<T> operator()(int i) const {
    const Vec3<T> sky = load3(light.radiance + 3 * i) * light.visible[i];
    return {load3(light.directions + 3 * i), light.solid_angles[i], light.sent ? sky + load3(light.sent + 3 * i) : sky};
  }
};

// sums [n, 4 (all, grazing, diffuse, dielectric), 3]; a group of threads a point. Light: one of the two above, over n
// directions.
template <class T, class Light> struct SumLightBody {
  int n;
  const T *normals, *view_dirs, *roughness;
  Light light;
  T* sums;

  template <class Group> SPLITNERF_HD void operator()(const Group& group, int64_t p) const {
    const LightSums<T> s =
        sum_light(group, load3(normals + 3 * p), load3(view_dirs + 3 * p), roughness[p], n, light.of_point(p));
    if (group.lane() > 0) return;
    store_sums(sums + 3 * kLightSums * p, s);
  }
};

// receive(point, i, gradient) takes the gradient to the radiance of direction i.
template <class T, class Light, class Receive> struct SumLightBackwardBody {
  int n;
  const T *normals, *view_dirs, *roughness;
  Light light;
  const T* grad_sums;
  T *grad_normals, *grad_roughness;
  Receive receive;

  template <class Group> SPLITNERF_HD void operator()(const Group& group, int64_t p) const {
    const LightSumsGrad<T> out = sum_light_backward(
        group, load3(normals + 3 * p), load3(view_dirs + 3 * p), roughness[p], n, light.of_point(p),
        load_sums(grad_sums + 3 * kLightSums * p), [&](int i, Vec3<T> grad) { receive(p, i, grad); });
    if (group.lane() > 0) return;
    store3(grad_normals + 3 * p, out.normal);
    grad_roughness[p] = out.roughness;
  }
};

// Each point has its own radiance [n, n directions, 3].
template <class T> struct ToDrawnLight {
  int n;
  T* grad_radiance;

  SPLITNERF_HD void operator()(int64_t p, int i, Vec3<T> grad) const { store3(grad_radiance + 3 * (p * n + i), grad); }
};
// Points that follow one another add to one [n directions, 3].
template <class T> struct ToSharedLight {
  int n;
  const T* visible;
  T* grad_light;

  SPLITNERF_HD void operator()(int64_t p, int i, Vec3<T> grad) const {
    store3(grad_light + 3 * i, load3(grad_light + 3 * i) + grad * visible[p * n + i]);
  }
};

// The two lights, each with its own sums and adjoint.
template <class T> using DrawnLightBody = SumLightBody<T, DrawnLight<T>>;
SPLITNERF_ON_GPU(DrawnLightBody);
template <class T> using DrawnLightBackwardBody = SumLightBackwardBody<T, DrawnLight<T>, ToDrawnLight<T>>;
SPLITNERF_ON_GPU(DrawnLightBackwardBody);
template <class T> using SharedLightBody = SumLightBody<T, ArrivingLight<T>>;
SPLITNERF_ON_GPU(SharedLightBody);
// Of points that follow one another; shared_light_backward takes all points.
template <class T> using SharedLightBackwardBody = SumLightBackwardBody<T, ArrivingLight<T>, ToSharedLight<T>>;

}  // namespace splitnerf
