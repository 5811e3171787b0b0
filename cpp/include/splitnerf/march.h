// Marching rays through an occupancy grid.
#pragma once

#include "splitnerf/vec.h"

namespace splitnerf {

// A cell of the occupancy grid. Opaque: so deep inside that nothing behind it can be seen; a ray
// that reaches one ends there.
enum class Cell : uint8_t { kEmpty = 0, kOccupied = 1, kOpaque = 2 };

struct MarchOptions {
  float box;          // half size of the cube [-box, box]^3 that the grid covers
  int resolution;     // cells along an edge; cells are [x][y][z]
  float step;         // length of one sample, scene units
  int64_t max_samples;  // of one ray
};

// Index range along one axis of a direction that may be zero: t where the ray is inside the slab.
template <class T> SPLITNERF_HD void clip_slab(T origin, T direction, T box, T& t_near, T& t_far) {
  if (direction == T(0)) {
    if (std::abs(origin) > box) t_far = T(-1);
    return;
  }
  const T inv = T(1) / direction, t0 = (-box - origin) * inv, t1 = (box - origin) * inv;
  t_near = max_of(t_near, min_of(t0, t1));
  t_far = min_of(t_far, max_of(t0, t1));
}

// Calls emit(t_start, t_end) for each sample of the lattice t_near + (k + jitter - 1) step whose midpoint
// stands in an occupied cell, front to back; returns their number. jitter in [0, 1) shifts the
// lattice of this ray. Empty cells are crossed in one go: k advances to the first midpoint
// behind the cell's exit.
template <class T, class Emit>
SPLITNERF_HD int64_t march_ray(Vec3<T> o, Vec3<T> d, T jitter, const uint8_t* cells, MarchOptions options, Emit emit) {
  const T box = T(options.box), step = T(options.step), cells_per_unit = T(options.resolution) / (T(2) * box);
  if (!(dot(o, o) + dot(d, d) < T(INFINITY))) return 0;  // a ray that is not finite meets nothing
  T t_near = T(0), t_far = T(INFINITY);
  for (int axis = 0; axis < 3; ++axis) clip_slab(o[axis], d[axis], box, t_near, t_far);
  if (!(t_near < t_far) || !(t_far < T(INFINITY))) return 0;
  const int64_t n_steps = static_cast<int64_t>(std::ceil((t_far - t_near) / step)) + 1;
  const T lattice = t_near + (jitter - T(1)) * step;
  int64_t n = 0;
  for (int64_t k = 0; k < n_steps && n < options.max_samples;) {
    const T t_start = lattice + T(k) * step, t_mid = t_start + T(0.5) * step;
    if (t_mid <= t_near) {
      ++k;
      continue;
    }
    if (t_mid >= t_far) break;
    int cell[3];
    for (int axis = 0; axis < 3; ++axis)
      cell[axis] = clamp(static_cast<int>((o[axis] + t_mid * d[axis] + box) * cells_per_unit), 0, options.resolution - 1);
    const auto state = static_cast<Cell>(
        cells[(static_cast<int64_t>(cell[0]) * options.resolution + cell[1]) * options.resolution + cell[2]]);
    if (state == Cell::kOpaque) break;
    if (state == Cell::kOccupied) {
      emit(t_start, t_start + step);
      ++n, ++k;
      continue;
    }
    T t_exit = t_far;
    for (int axis = 0; axis < 3; ++axis) {
      if (d[axis] == T(0)) continue;
      const T face = T(cell[axis] + (d[axis] > T(0) ? 1 : 0)) / cells_per_unit - box;
      t_exit = min_of(t_exit, (face - o[axis]) / d[axis]);
    }
    const int64_t behind = static_cast<int64_t>(std::ceil((t_exit - lattice) / step - T(0.5)));
    k = max_of(k + 1, behind);
  }
  return n;
}

}  // namespace splitnerf
