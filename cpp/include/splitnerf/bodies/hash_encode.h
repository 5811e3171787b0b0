// The hash grid, one thread a point and level.
#pragma once

#include "splitnerf/accumulate.h"
#include "splitnerf/hash_grid.h"

namespace splitnerf {

// S: what the table stores of each T, see half.h.
template <class T, class S = T> struct HashGridView {
  HashLevel levels[kMaxLevels];
  int n_levels, n_active;
  const T* positions;  // [n, 3] in the unit cube
  const S* table;      // [n_entries, F]
};

template <class T, class S>
HashGridView<T, S> make_view(const HashGridShape& shape, int n_active, const T* positions, const S* table) {
  HashGridView<T, S> view{};
  hash_levels(shape, view.levels);
  view.n_levels = shape.n_levels, view.n_active = n_active, view.positions = positions, view.table = table;
  return view;
}

// An entry, read at once.
template <class T, int F, class S> SPLITNERF_HD Pack<T, F> load_entry(const S* from) {
  const Pack<S, F> stored = load_pack<F>(from);
  Pack<T, F> entry;
  for (int f = 0; f < F; ++f) entry[f] = widen(stored[f]);
  return entry;
}

// The features of one level at a point, and their derivatives by its position.
template <class T, int F> struct LevelFeatures {
  Pack<T, F> value{}, dx{}, dy{}, dz{};
};
template <int F, class T, class S>
SPLITNERF_HD LevelFeatures<T, F> level_features(const HashLevel& level, const S* table, Vec3<T> position) {
  const HashCell<T> cell = hash_cell(level, position);
  Pack<T, F> corner[8];
  for (int i = 0; i < 8; ++i) corner[i] = load_entry<T, F>(table + cell.index[i] * F);
  LevelFeatures<T, F> out;
  for (int f = 0; f < F; ++f) {
    const Trilinear<T> t = trilinear(corner[0][f], corner[1][f], corner[2][f], corner[3][f], corner[4][f], corner[5][f],
                                     corner[6][f], corner[7][f], cell.f.x, cell.f.y, cell.f.z);
    out.value[f] = t.value;
    out.dx[f] = t.dx * cell.scale.x, out.dy[f] = t.dy * cell.scale.y, out.dz[f] = t.dz * cell.scale.z;
  }
  return out;
}

// features [n, C], C = n_levels F; closed levels are written as 0.
template <class T, int F, class S = T> struct HashEncodeBody {
  HashGridView<T, S> grid;
  T* features;

  SPLITNERF_HD void operator()(int64_t p, int l) const {
    LevelFeatures<T, F> at;
    if (l < grid.n_active) at = level_features<F>(grid.levels[l], grid.table, load3(grid.positions + 3 * p));
    store_pack(features + p * grid.n_levels * F + l * F, at.value);
  }
};

// Gradients to what a level gives at a point.
template <class T, int F> using LevelGradients = LevelFeatures<T, F>;

// Adds the part of corner I, and of all corners, to the gradient of the table.
template <int I, class T, int F>
SPLITNERF_HD void scatter_corner(const HashCell<T>& cell, const LevelGradients<T, F>& from, T* grad_table) {
  Pack<T, F> grad;
  for (int f = 0; f < F; ++f) {
    const Trilinear<T> t{from.value[f], from.dx[f] * cell.scale.x, from.dy[f] * cell.scale.y,
                         from.dz[f] * cell.scale.z};
    grad[f] = trilinear_backward<I>(t, cell.f.x, cell.f.y, cell.f.z);
  }
  add_pack(grad_table + cell.index[I] * F, grad);
}
template <class T, int F>
SPLITNERF_HD void scatter_level(const HashLevel& level, Vec3<T> position, const LevelGradients<T, F>& from,
                                T* grad_table) {
  const HashCell<T> cell = hash_cell(level, position);
  scatter_corner<0>(cell, from, grad_table), scatter_corner<1>(cell, from, grad_table);
  scatter_corner<2>(cell, from, grad_table), scatter_corner<3>(cell, from, grad_table);
  scatter_corner<4>(cell, from, grad_table), scatter_corner<5>(cell, from, grad_table);
  scatter_corner<6>(cell, from, grad_table), scatter_corner<7>(cell, from, grad_table);
}

// Adds to grad_table the gradients of open level l.
template <class T, int F> struct HashScatterBody {
  HashGridView<T> grid;
  const T* grad_features;
  T* grad_table;

  SPLITNERF_HD void operator()(int64_t p, int l) const {
    LevelGradients<T, F> from;
    from.value = load_pack<F>(grad_features + p * grid.n_levels * F + l * F);
    scatter_level(grid.levels[l], load3(grid.positions + 3 * p), from, grad_table);
  }
};

// grad_positions [n, 3], one thread a point.
template <class T, int F, class S = T> struct HashPositionsBody {
  HashGridView<T, S> grid;
  const T* grad_features;
  T* grad_positions;

  SPLITNERF_HD void operator()(int64_t p) const {
    const Vec3<T> position = load3(grid.positions + 3 * p);
    const T* grad = grad_features + p * grid.n_levels * F;
    Vec3<T> sum{T(0), T(0), T(0)};
    for (int l = 0; l < grid.n_active; ++l) {
      const LevelFeatures<T, F> at = level_features<F>(grid.levels[l], grid.table, position);
      for (int f = 0; f < F; ++f) sum += Vec3<T>{at.dx[f], at.dy[f], at.dz[f]} * grad[l * F + f];
    }
    store3(grad_positions + 3 * p, sum);
  }
};

}  // namespace splitnerf
