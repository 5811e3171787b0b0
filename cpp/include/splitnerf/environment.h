// Equirectangular environment maps: u = 0.5 - atan2(y, x) / (2 pi), v = acos(z) / pi from the top
// row (Blender's convention: the centre column looks along +x, u grows clockwise seen from +z).
// Maps are [height, width, 3] linear radiance, pixel centres at +0.5; u wraps, v clamps.
#pragma once

#include "splitnerf/sampling.h"
#include "splitnerf/vec.h"

namespace splitnerf {

// The map coordinates (u, v) in [0, 1] of a direction (of any length but zero). The angle to +z
// comes from atan2(|xy|, z), which is acos(z) without its loss of digits at the poles.
template <class T> SPLITNERF_HD Vec2<T> direction_to_equirect(Vec3<T> d) {
  return {T(0.5) - arc_tangent(d.y, d.x) * T(0.5 / kPi),
          arc_tangent(std::sqrt(d.x * d.x + d.y * d.y), d.z) * T(1 / kPi)};
}

// The unit direction of map coordinates; the inverse of direction_to_equirect.
template <class T> SPLITNERF_HD Vec3<T> equirect_to_direction(Vec2<T> uv) {
  const T phi = T(2 * kPi) * (T(0.5) - uv.x), theta = T(kPi) * uv.y;
  const T s = std::sin(theta);
  return {s * std::cos(phi), s * std::sin(phi), std::cos(theta)};
}

// Solid angle of one texel of a row: (2 pi / width)(cos theta_top - cos theta_bottom), where the
// difference of cosines is 2 sin(theta_centre) sin(half a row). The map's sum is 4 pi exactly.
template <class T> SPLITNERF_HD T texel_solid_angle(int row, int height, int width) {
  const T half = T(0.5 * kPi) / T(height);
  return T(4 * kPi) / T(width) * std::sin(half * T(2 * row + 1)) * std::sin(half);
}

// The rows and columns of texel centres between which a point of the map lies, and how far it is between them.
template <class T> struct EquirectCell {
  int row, next_row, column, next_column;
  T fx, fy;
};

template <class T> SPLITNERF_HD EquirectCell<T> equirect_cell(Vec2<T> uv, int height, int width) {
  // A NaN goes on to the caller by fx or fy, with a cell that exists.
  const T x = uv.x * T(width) - T(0.5), raised = uv.y * T(height) - T(0.5);
  const T y = raised > T(0) ? min_of(raised, T(height - 1)) : T(0);
  const T x_floor = std::floor(x);
  const int row = min_of(static_cast<int>(y), height - 1);
  // uv.x in [0, 1] makes x_floor one of -1 ... width - 1.
  const int column =
      x_floor < T(0) ? width - 1 : static_cast<int>(x_floor > T(0) ? min_of(x_floor, T(width - 1)) : T(0));
  return {row,         min_of(row + 1, height - 1),   column, column + 1 == width ? 0 : column + 1,
          x - x_floor, y - T(row) + (raised - raised)};
}

// The same as four texels and their bilinear weights.
template <class T> struct EquirectFootprint {
  int64_t texel[4];  // row * width + column
  T weight[4];
};

template <class T> SPLITNERF_HD EquirectFootprint<T> equirect_footprint(Vec2<T> uv, int height, int width) {
  const EquirectCell<T> c = equirect_cell(uv, height, width);
  const int64_t top = int64_t(c.row) * width, bottom = int64_t(c.next_row) * width;
  return {{top + c.column, top + c.next_column, bottom + c.column, bottom + c.next_column},
          {(T(1) - c.fx) * (T(1) - c.fy), c.fx * (T(1) - c.fy), (T(1) - c.fx) * c.fy, c.fx * c.fy}};
}

// Bilinear radiance of the map in a direction.
template <class T> SPLITNERF_HD Vec3<T> lookup_environment(const T* map, int height, int width, Vec3<T> direction) {
  const EquirectFootprint<T> f = equirect_footprint(direction_to_equirect(direction), height, width);
  Vec3<T> radiance{T(0), T(0), T(0)};
  for (int k = 0; k < 4; ++k) radiance += load3(map + f.texel[k] * 3) * f.weight[k];
  return radiance;
}

}  // namespace splitnerf
