// Shading, one point a call. lut: brdf_lut()'s layout.
#pragma once

#include "splitnerf/monte_carlo.h"
#include "splitnerf/split_sum.h"

namespace splitnerf {

// What shading asks the light at n points: the directions of the specular lobes with their roughness, then those of the
// diffuse light, the normals on the viewer's side, with a roughness of 1.
template <class T> struct LightQueriesBody {
  const float* lut;
  bool mean;
  int64_t n;
  const T *normals, *view_dirs, *roughness;
  T *directions, *asked_roughness;

  SPLITNERF_HD void operator()(int64_t i) const {
    const Vec3<T> normal = load3(normals + 3 * i), view = load3(view_dirs + 3 * i);
    store3(directions + 3 * i, query_direction(lut, mean, normal, view, roughness[i]));
    store3(directions + 3 * (n + i), normal * facing(normal, view));
    asked_roughness[i] = roughness[i];
    asked_roughness[n + i] = T(1);
  }
};
SPLITNERF_ON_GPU(LightQueriesBody);

template <class T> struct LightQueriesBackwardBody {
  const float* lut;
  bool mean;
  int64_t n;
  const T *normals, *view_dirs, *roughness, *grad_directions, *grad_asked_roughness;
  T *grad_normals, *grad_roughness;

  SPLITNERF_HD void operator()(int64_t i) const {
    const Vec3<T> normal = load3(normals + 3 * i), view = load3(view_dirs + 3 * i);
    const QueryDirectionGrad<T> g =
        query_direction_backward(lut, mean, normal, view, roughness[i], load3(grad_directions + 3 * i));
    store3(grad_normals + 3 * i, g.normal + load3(grad_directions + 3 * (n + i)) * facing(normal, view));
    grad_roughness[i] = g.roughness + grad_asked_roughness[i];
  }
};
SPLITNERF_ON_GPU(LightQueriesBackwardBody);

// Occlusion factors come as one value for all channels or as three; the gradient of the one is the sum of theirs.
template <class T> SPLITNERF_HD Vec3<T> load_factors(const T* factors, int64_t i, int n_channels) {
  return n_channels == 3 ? load3(factors + 3 * i) : Vec3<T>{factors[i], factors[i], factors[i]};
}
template <class T> SPLITNERF_HD void store_factors(T* factors, int64_t i, int n_channels, Vec3<T> grad) {
  if (n_channels == 3) return store3(factors + 3 * i, grad);
  factors[i] = sum(grad);
}

template <class T>
SPLITNERF_HD ShadePoint<T> load_shade_point(const ShadeArrays<const T>& in, int64_t i, int n_channels) {
  return {load3(in.normals + 3 * i),
          load3(in.view_dirs + 3 * i),
          load3(in.albedo + 3 * i),
          in.roughness[i],
          in.metallic[i],
          load3(in.specular + 3 * i),
          load3(in.diffuse + 3 * i),
          load_factors(in.occlusion_s, i, n_channels),
          load_factors(in.occlusion_d, i, n_channels),
          load3_if(in.indirect_s, i),
          load3_if(in.indirect_d, i)};
}

template <class T> struct ShadeBody {
  const float* lut;
  ShadeOptions options;
  int n_channels;
  ShadeArrays<const T> in;
  T* radiance;

  SPLITNERF_HD void operator()(int64_t i) const {
    store3(radiance + 3 * i, split_sum_shade(lut, options, load_shade_point(in, i, n_channels)));
  }
};
SPLITNERF_ON_GPU(ShadeBody);

template <class T> struct ShadeBackwardBody {
  const float* lut;
  ShadeOptions options;
  int n_channels;
  ShadeArrays<const T> in;
  const T* grad_radiance;
  ShadeArrays<T> grad;

  SPLITNERF_HD void operator()(int64_t i) const {
    const ShadePoint<T> g =
        split_sum_shade_backward(lut, options, load_shade_point(in, i, n_channels), load3(grad_radiance + 3 * i));
    store3(grad.normals + 3 * i, g.normal);
    store3(grad.view_dirs + 3 * i, g.view);
    store3(grad.albedo + 3 * i, g.albedo);
    grad.roughness[i] = g.roughness;
    grad.metallic[i] = g.metallic;
    store3(grad.specular + 3 * i, g.specular);
    store3(grad.diffuse + 3 * i, g.diffuse);
    store_factors(grad.occlusion_s, i, n_channels, g.occlusion_s);
    store_factors(grad.occlusion_d, i, n_channels, g.occlusion_d);
  }
};
SPLITNERF_ON_GPU(ShadeBackwardBody);

template <class T> SPLITNERF_HD SummedPoint<T> load_summed_point(const SummedArrays<const T>& in, int64_t i) {
  return {load3(in.normals + 3 * i),
          load3(in.view_dirs + 3 * i),
          load3(in.albedo + 3 * i),
          in.roughness[i],
          in.metallic[i],
          load_sums(in.sums + 3 * kLightSums * i)};
}

// The radiance of the sums; or, where another radiance is given, the difference to it times a share: what turns that one into a
// mixture of both.
template <class T> struct ShadeSumsBody {
  const float* lut;
  bool compensate;
  SummedArrays<const T> in;
  const T *other, *share;  // [n, 3] and [n], or null
  T* radiance;

  SPLITNERF_HD void operator()(int64_t i) const {
    const Vec3<T> summed = shade_sums(lut, compensate, load_summed_point(in, i));
    store3(radiance + 3 * i, other ? (summed - load3(other + 3 * i)) * share[i] : summed);
  }
};
SPLITNERF_ON_GPU(ShadeSumsBody);

template <class T> struct ShadeSumsBackwardBody {
  const float* lut;
  bool compensate;
  SummedArrays<const T> in;
  const T *share, *grad_radiance;
  SummedArrays<T> grad;
  T* grad_other;  // or null, as share

  SPLITNERF_HD void operator()(int64_t i) const {
    const Vec3<T> given = load3(grad_radiance + 3 * i), to_sum = share ? given * share[i] : given;
    // radiance = (summed - other) share
    if (grad_other) store3(grad_other + 3 * i, -to_sum);
    const SummedPoint<T> g = shade_sums_backward(lut, compensate, load_summed_point(in, i), to_sum);
    store3(grad.normals + 3 * i, g.normal);
    store3(grad.view_dirs + 3 * i, g.view);
    store3(grad.albedo + 3 * i, g.albedo);
    grad.roughness[i] = g.roughness;
    grad.metallic[i] = g.metallic;
    store_sums(grad.sums + 3 * kLightSums * i, g.light);
  }
};
SPLITNERF_ON_GPU(ShadeSumsBackwardBody);

}  // namespace splitnerf
