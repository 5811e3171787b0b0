// The light as a pyramid: octahedral maps of the radiance filtered for ascending roughness, the first
// one unfiltered, and spherical harmonics from there on. Read bilinear in direction, linear in roughness.
#pragma once

#include "splitnerf/octahedral.h"
#include "splitnerf/spherical_harmonics.h"

namespace splitnerf {

inline constexpr int kMaxLightLevels = 16;

template <class T> struct LightPyramid {
  const T* levels;  // [sum of resolution^2, 3], one map after the other
  const T* sh;      // [kShCoefficients, 3]
  const T* zonal;   // [n_zonal, kShBands]: the lobe's zonal factors, roughness node[n_levels] ... 1
  int n_levels, n_zonal;
  int resolution[kMaxLightLevels];
  int64_t offset[kMaxLightLevels];  // in texels
  T node[kMaxLightLevels + 1];      // ascending roughness of the levels; the last one: of the harmonics
  const ShRecurrence<T>* recurrence;
};

// What a roughness mixes: level and its successor, the harmonics being the successor of the last level.
template <class T> struct LightMix {
  int level;
  T share, slope;  // of the successor, and its derivative by roughness
};

template <class T> SPLITNERF_HD LightMix<T> light_mix(const LightPyramid<T>& p, T roughness) {
  if (!(roughness < p.node[p.n_levels])) return {p.n_levels - 1, T(1), T(0)};
  if (roughness <= p.node[0]) return {0, T(0), T(0)};
  int k = 0;
  while (roughness >= p.node[k + 1]) ++k;
  const T slope = T(1) / (p.node[k + 1] - p.node[k]);
  return {k, (roughness - p.node[k]) * slope, slope};
}

template <class T> SPLITNERF_HD Vec3<T> read_level(const T* map, const OctahedralFootprint<T>& f) {
  Vec3<T> sum{T(0), T(0), T(0)};
  for (int k = 0; k < 4; ++k) sum += load3(map + 3 * f.texel[k]) * f.weight(k);
  return sum;
}

// Adds grad times the texels' weights to grad_map; returns the gradient to the square's point.
template <class T>
SPLITNERF_HD Vec2<T> read_level_backward(const T* map, int n, const OctahedralFootprint<T>& f, Vec3<T> grad,
                                         T* grad_map) {
  T along[4];
  for (int k = 0; k < 4; ++k) {
    along[k] = dot(load3(map + 3 * f.texel[k]), grad);
    T* g = grad_map + 3 * f.texel[k];
    store3(g, load3(g) + grad * f.weight(k));
  }
  const T half = T(0.5) * T(n);
  return {half * lerp(along[1] - along[0], along[3] - along[2], f.fy),
          half * lerp(along[2] - along[0], along[3] - along[1], f.fx)};
}

// Harmonics ring around strong lamps. Below a thousandth e of the mean light their sum x is bent to
// e exp(x/e - 1): positive, of continuous slope, and with its true derivative.
inline constexpr double kShFloor = 1e-3;

template <class T> struct FlooredLight {
  T value, d_x, d_e;
};
template <class T> SPLITNERF_HD FlooredLight<T> floored_light(T x, T sh_constant) {
  const T e = max_of(sh_constant * T(kShFloor * kShConstant), T(1e-20));
  if (!(x < e)) return {x, T(1), T(0)};
  const T fall = std::exp(x / e - T(1));
  return {e * fall, fall, fall * (T(1) - x / e)};
}

// Row of the zonal table for a roughness, and the place between it and the next.
template <class T> struct ZonalPlace {
  const T* row;
  T share, slope;  // of the next row, and its derivative by roughness
};
template <class T> SPLITNERF_HD ZonalPlace<T> zonal_place(const LightPyramid<T>& p, T roughness) {
  const T start = p.node[p.n_levels], scale = T(p.n_zonal - 1) / (T(1) - start);
  const T x = (roughness - start) * scale;
  const bool inside = x > T(0) && x < T(p.n_zonal - 1);
  const T bounded = x > T(0) ? min_of(x, T(p.n_zonal - 1)) : T(0);
  const int row = min_of(static_cast<int>(bounded), p.n_zonal - 2);
  return {p.zonal + row * kShBands, x == x ? bounded - T(row) : x, inside ? scale : T(0)};
}

}  // namespace splitnerf
