// The light as a pyramid: octahedral maps of the radiance filtered for ascending roughness, the first
// one unfiltered, and spherical harmonics from there on. Read bilinear in direction, linear in roughness.
#pragma once

#include "splitnerf/accumulate.h"
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

// Of all maps together.
template <class T> SPLITNERF_HD int64_t light_texels(const LightPyramid<T>& p) {
  const int last = p.n_levels - 1;
  return p.offset[last] + int64_t(p.resolution[last]) * p.resolution[last];
}

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
    add3_to(grad_map + 3 * f.texel[k], grad * f.weight(k));
  }
  const T half = T(0.5) * T(n);
  return {half * lerp(along[1] - along[0], along[3] - along[2], f.fy),
          half * lerp(along[2] - along[0], along[3] - along[1], f.fx)};
}

// What the maps hold of the radiance from w; the harmonics add their share.
template <class T> SPLITNERF_HD Vec3<T> read_maps(const LightPyramid<T>& p, const LightMix<T>& mix, Vec3<T> w) {
  if (mix.share == T(1)) return {T(0), T(0), T(0)};
  const Vec2<T> uv = octahedral_encode(w);
  const int k = mix.level, n = p.resolution[k];
  Vec3<T> value = read_level(p.levels + 3 * p.offset[k], octahedral_footprint(n, uv)) * (T(1) - mix.share);
  if (k + 1 < p.n_levels && mix.share > T(0)) {
    const int m = p.resolution[k + 1];
    value += read_level(p.levels + 3 * p.offset[k + 1], octahedral_footprint(m, uv)) * mix.share;
  }
  return value;
}

template <class T> struct LightArgumentsGrad {
  Vec3<T> direction;
  T roughness;
};
// Adds to grad_levels.
template <class T>
SPLITNERF_HD LightArgumentsGrad<T> read_maps_backward(const LightPyramid<T>& p, const LightMix<T>& mix, Vec3<T> w,
                                                      Vec3<T> grad, T* grad_levels) {
  LightArgumentsGrad<T> out{{T(0), T(0), T(0)}, T(0)};
  if (mix.share == T(1)) return out;
  const Vec2<T> uv = octahedral_encode(w);
  Vec2<T> grad_uv{T(0), T(0)};
  for (int above = 0; above < 2 && mix.level + above < p.n_levels; ++above) {
    const T share = above ? mix.share : T(1) - mix.share, slope = above ? mix.slope : -mix.slope;
    if (share == T(0) && slope == T(0)) continue;
    const int k = mix.level + above, n = p.resolution[k];
    const T* map = p.levels + 3 * p.offset[k];
    const OctahedralFootprint<T> f = octahedral_footprint(n, uv);
    const Vec2<T> g = read_level_backward(map, n, f, grad * share, grad_levels + 3 * p.offset[k]);
    grad_uv.x += g.x, grad_uv.y += g.y;
    if (slope != T(0)) out.roughness += slope * dot(read_level(map, f), grad);
  }
  out.direction = octahedral_encode_backward(w, grad_uv);
  return out;
}

// Whether the harmonics have a share, or one whose derivative is not 0.
template <class T> SPLITNERF_HD bool reads_harmonics(const LightPyramid<T>& p, const LightMix<T>& mix) {
  return mix.level + 1 == p.n_levels && (mix.share != T(0) || mix.slope != T(0));
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

// Rows of a sparse matrix: the entries of row r are [offsets[r], offsets[r + 1]). A matrix that mirror images leave as it is holds
// one row of each n_images: image m of row r is row places[r, m] of the whole matrix, and it has the weights of row r at the images
// images[c, m] of its columns c.
template <class T> struct SparseRows {
  const int64_t* offsets;
  const int32_t* columns;
  const T* weights;
  const int32_t *places, *images;  // [n_rows, n_images], [n_columns, n_images]
  int64_t n_columns;
  int n_images;  // 1, or kMirrorImages
};
constexpr int kMirrorImages = 4;  // of the octahedral map, by both signs of its first two axes

}  // namespace splitnerf
