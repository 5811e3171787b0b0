// The distance of a field's layer at a point, kSdfUnits hidden units at a time, and the walk along a ray that asks for it. The
// inputs of the points of a tile are in memory that its threads share; all threads read the same weights.
//
// x: inputs; h = softplus(W x + b); distance = v_0 h + c_0.
#pragma once

#include "splitnerf/bodies/hash_encode.h"
#include "splitnerf/ray_walk.h"
#include "splitnerf/sdf_layer.h"

namespace splitnerf {

inline constexpr int kSdfUnits = 8;

// Rows of numbers, one for each point.
template <class T> struct SdfTile {
  T* numbers;
  int stride;  // from row to row, at least the number of points
  int n_inputs;

  SPLITNERF_HD T& input(int k, int p) const { return numbers[k * stride + p]; }
};

// Units [first, first + N) at a point.
template <int N = kSdfUnits, class T>
SPLITNERF_HD Pack<T, N> sdf_units(const SdfLayer<T>& layer, const SdfTile<T>& tile, int first, int p) {
  Pack<T, N> units = load_pack<N>(layer.hidden_bias + first);
  for (int k = 0; k < tile.n_inputs; ++k) {
    const Pack<T, N> w = load_pack<N>(layer.hidden_transposed + k * layer.width_columns + first);
    const T x = tile.input(k, p);
    for (int u = 0; u < N; ++u) units[u] += w[u] * x;
  }
  for (int u = 0; u < N; ++u) units[u] = softplus_and_slope(units[u], layer.beta).value;
  return units;
}

template <class T, int N> SPLITNERF_HD T dot_units(const Pack<T, N>& a, const Pack<T, N>& b) {
  T sum = T(0);
  for (int u = 0; u < N; ++u) sum += a[u] * b[u];
  return sum;
}

// One of n_parts parts of the distance, whose sum is the distance alone; N units at a time.
template <int N = kSdfUnits, class T>
SPLITNERF_HD T sdf_value(const SdfLayer<T>& layer, const SdfTile<T>& tile, int p, int part = 0, int n_parts = 1) {
  T sum = part == 0 ? layer.out_bias[0] : T(0);
  for (int first = N * part; first < layer.width_columns; first += N * n_parts)
    sum += dot_units(sdf_units<N>(layer, tile, first, p), load_pack<N>(layer.out + first));
  return sum;
}

// One of n_parts parts of the inputs of a point of the field itself: its position and the hash grid's features.
template <int F, class T, class S>
SPLITNERF_HD void load_field_inputs(const HashGridView<T, S>& grid, T scale, Vec3<T> position, const SdfTile<T>& tile,
                                    int p, int part = 0, int n_parts = 1) {
  for (int axis = part; axis < 3; axis += n_parts) tile.input(axis, p) = position[axis];
  for (int l = part; l < grid.n_levels; l += n_parts) {
    LevelFeatures<T, F> at;
    if (l < grid.n_active) at = level_features<F>(grid.levels[l], grid.table, to_unit(position, scale));
    for (int f = 0; f < F; ++f) tile.input(3 + l * F + f, p) = at.value[f];
  }
}

inline constexpr int kWalkLanes = 4;  // threads of a group that share a sample of a walk
inline constexpr int kWalkUnits = 4;  // hidden units of one of them at a time, so that these lie side by side

// The n-th sample in an occupied cell, counted from 0 = `first`, which is one; -1 where none of a group's neighbours is.
template <class T, class Group>
SPLITNERF_HD int64_t occupied_from(const Group& group, const RayLattice<T>& lattice, const OccupancyView& cells,
                                   const MarchOptions& march, int64_t first, int n) {
  const bool is_first = group.lane() == 0;
  uint32_t bits =
      occupied_samples(group, is_first ? Cell::kOccupied : march_step(lattice, cells, march, first + group.lane()).cell)
          .bits;
  for (; n > 0; --n) bits &= bits - 1;
  return bits ? first + lowest_bit(bits) : -1;
}

// Follows a ray through the field to its end; all threads of the group call keep(t_start) for each kept sample. Returns the
// number of distances that the walk asked for. The group works out the next samples in occupied cells together, and then all
// of its threads take the same walk over them with advance(), which the CPU calls as well; where the walk leaps over some of
// them, they were worked out in vain. tile: space for Group::size / kWalkLanes points.
template <int F, class T, class S, class Group, class Keep>
SPLITNERF_HD int64_t walk_ray(const Group& group, const HashGridView<T, S>& grid, const SdfLayer<T>& layer,
                              const SdfTile<T>& tile, const RayLattice<T>& lattice, const OccupancyView& cells,
                              const MarchOptions& march, const SampleRules<T>& rules, Keep keep) {
  const int p = group.lane() / kWalkLanes, part = group.lane() % kWalkLanes;
  Walk<T> walk(lattice, 0, march, cells);
  while (walk.next >= 0) {
    const int64_t sample = occupied_from(group, lattice, cells, march, walk.next, p);
    if (sample >= 0) load_field_inputs<F>(grid, layer.scale, lattice.middle(sample), tile, p, part, kWalkLanes);
    group.sync();
    const T of_part = sample >= 0 ? sdf_value<kWalkUnits>(layer, tile, p, part, kWalkLanes) : T(0);
    const T f = group.template sum_of_run<kWalkLanes>(of_part);
    group.sync();  // the inputs have been read
    while (const uint32_t known = group.ballot(sample >= 0 && sample == walk.next))
      advance(walk, group.from(lowest_bit(known), f), cells, march, rules, keep);
  }
  return walk.n_evaluated;
}

// The largest number of samples kept on a ray: the number of steps that fit into the box.
template <class T> int64_t most_samples(const MarchOptions& march) {
  const double steps = std::ceil(2 * 1.7320508 * double(march.box) / double(march.step)) + 3;
  return max_of<int64_t>(static_cast<int64_t>(min_of(steps, double(march.max_samples))), 1);
}

}  // namespace splitnerf
