// The distance field's network on a tile of points: one point per thread, kSdfUnits hidden units at a time. A tile's
// numbers are in memory that its threads share; all threads read the same weights.
//
// x: inputs; h = softplus(W x + b); outputs = V h + c; steepness = W^T (slope v_0), v_0 the distance's row of V.
#pragma once

#include "splitnerf/bodies/hash_encode.h"
#include "splitnerf/ray_walk.h"
#include "splitnerf/sdf_layer.h"
#include "splitnerf/vector_math.h"

namespace splitnerf {

inline constexpr int kSdfUnits = 8;

// Rows of numbers, one for each point, in the order of the functions below.
template <class T> struct SdfTile {
  T* numbers;
  int stride;  // from row to row, at least the number of points
  int n_inputs, n_outputs;

  SPLITNERF_HD static int forward_rows(int n_inputs, int n_outputs) { return 2 * n_inputs + n_outputs; }
  SPLITNERF_HD static int backward_rows(int n_inputs, int n_outputs) {
    return 3 * n_inputs + n_outputs + 4 * kSdfUnits;
  }
  SPLITNERF_HD T& at(int row, int p) const { return numbers[row * stride + p]; }
  SPLITNERF_HD T& input(int k, int p) const { return at(k, p); }
  SPLITNERF_HD T& steepness(int k, int p) const { return at(n_inputs + k, p); }   // later the gradient to the inputs
  SPLITNERF_HD T& output(int m, int p) const { return at(2 * n_inputs + m, p); }  // or the gradient to it
  SPLITNERF_HD T& grad_steepness(int k, int p) const { return at(2 * n_inputs + n_outputs + k, p); }
  // Values of the current units: slope v_0, the gradient of W x + b, h, and the term of slope v_0 in v_0's gradient.
  SPLITNERF_HD T& unit(int what, int u, int p) const { return at(3 * n_inputs + n_outputs + what * kSdfUnits + u, p); }
};
enum SdfUnit { kWeighted, kGradSum, kHidden, kGradFirstRow };

template <class T, int N = kSdfUnits> struct SdfUnits { Pack<T, N> value, slope; };
// Units [first, first + N) at a point.
template <int N = kSdfUnits, class T>
SPLITNERF_HD SdfUnits<T, N> sdf_units(const SdfLayer<T>& layer, const SdfTile<T>& tile, int first, int p) {
  SdfUnits<T, N> units;
  units.value = load_pack<N>(layer.hidden_bias + first);
  for (int k = 0; k < tile.n_inputs; ++k) {
    const Pack<T, N> w = load_pack<N>(layer.hidden_transposed + k * layer.width_columns + first);
    const T x = tile.input(k, p);
    for (int u = 0; u < N; ++u) units.value[u] += w[u] * x;
  }
  for (int u = 0; u < N; ++u) {
    const Softplus<T> s = softplus_and_slope(units.value[u], layer.beta);
    units.value[u] = s.value, units.slope[u] = s.slope;
  }
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
    sum += dot_units(sdf_units<N>(layer, tile, first, p).value, load_pack<N>(layer.out + first));
  return sum;
}

// Adds the product of W^T's rows with the kSdfUnits numbers `of`.
template <class T>
SPLITNERF_HD void add_to_inputs(const SdfLayer<T>& layer, const SdfTile<T>& tile, int first, int p,
                                const Pack<T, kSdfUnits>& of) {
  for (int k = 0; k < tile.n_inputs; ++k)
    tile.steepness(k, p) +=
        dot_units(of, load_pack<kSdfUnits>(layer.hidden_transposed + k * layer.width_columns + first));
}

// slope v_0 of some units.
template <class T>
SPLITNERF_HD Pack<T, kSdfUnits> weighted_units(const SdfLayer<T>& layer, const SdfUnits<T>& units, int first) {
  Pack<T, kSdfUnits> weighted = load_pack<kSdfUnits>(layer.out + first);
  for (int u = 0; u < kSdfUnits; ++u) weighted[u] *= units.slope[u];
  return weighted;
}

// From the inputs to the outputs, where they are wanted, and the steepness.
template <bool WithOutputs, class T>
SPLITNERF_HD void sdf_forward(const SdfLayer<T>& layer, const SdfTile<T>& tile, int p) {
  if constexpr (WithOutputs)
    for (int m = 0; m < tile.n_outputs; ++m) tile.output(m, p) = layer.out_bias[m];
  for (int k = 0; k < tile.n_inputs; ++k) tile.steepness(k, p) = T(0);
  for (int first = 0; first < layer.width_columns; first += kSdfUnits) {
    const SdfUnits<T> units = sdf_units(layer, tile, first, p);
    if constexpr (WithOutputs)
      for (int m = 0; m < tile.n_outputs; ++m)
        tile.output(m, p) += dot_units(units.value, load_pack<kSdfUnits>(layer.out + m * layer.width_columns + first));
    add_to_inputs(layer, tile, first, p, weighted_units(layer, units, first));
  }
}

// gradient[axis] = steepness[axis] + scale jacobian[axis] . steepness[3:], jacobian [3, n_features].
template <class T>
SPLITNERF_HD Vec3<T> sdf_gradient(const SdfLayer<T>& layer, const SdfTile<T>& tile, int p, const T* jacobian) {
  const int n_features = tile.n_inputs - 3;
  Vec3<T> gradient;
  for (int axis = 0; axis < 3; ++axis) {
    T sum = T(0);
    for (int c = 0; c < n_features; ++c) sum += jacobian[axis * n_features + c] * tile.steepness(3 + c, p);
    gradient[axis] = tile.steepness(axis, p) + layer.scale * sum;
  }
  return gradient;
}

// Its adjoint: fills grad_jacobian [3, n_features] and the tile's grad_steepness. The steepness has been worked out.
template <class T>
SPLITNERF_HD void sdf_gradient_backward(const SdfLayer<T>& layer, const SdfTile<T>& tile, int p, const T* jacobian,
                                        Vec3<T> grad, T* grad_jacobian) {
  const int n_features = tile.n_inputs - 3;
  for (int axis = 0; axis < 3; ++axis) tile.grad_steepness(axis, p) = grad[axis];
  for (int c = 0; c < n_features; ++c) {
    T sum = T(0);
    for (int axis = 0; axis < 3; ++axis) {
      const T scaled = grad[axis] * layer.scale;
      grad_jacobian[axis * n_features + c] = scaled * tile.steepness(3 + c, p);
      sum += scaled * jacobian[axis * n_features + c];
    }
    tile.grad_steepness(3 + c, p) = sum;
  }
}

// Units [first, first + kSdfUnits): adds to the gradient of the inputs and stores in the tile the values that the
// gradients of the weights need.
template <class T>
SPLITNERF_HD void sdf_units_backward(const SdfLayer<T>& layer, const SdfTile<T>& tile, int first, int p) {
  const SdfUnits<T> units = sdf_units(layer, tile, first, p);
  const Pack<T, kSdfUnits> v0 = load_pack<kSdfUnits>(layer.out + first), weighted = weighted_units(layer, units, first);
  // steepness = W^T weighted,  outputs = V h + c
  Pack<T, kSdfUnits> grad_weighted{}, grad_value{}, grad_sum;
  for (int k = 0; k < tile.n_inputs; ++k) {
    const Pack<T, kSdfUnits> w = load_pack<kSdfUnits>(layer.hidden_transposed + k * layer.width_columns + first);
    const T g = tile.grad_steepness(k, p);
    for (int u = 0; u < kSdfUnits; ++u) grad_weighted[u] += w[u] * g;
  }
  for (int m = 0; m < tile.n_outputs; ++m) {
    const Pack<T, kSdfUnits> v = load_pack<kSdfUnits>(layer.out + m * layer.width_columns + first);
    const T g = tile.output(m, p);
    for (int u = 0; u < kSdfUnits; ++u) grad_value[u] += v[u] * g;
  }
  // weighted = slope v_0,  h = softplus; 1 - slope = exp(-beta h) keeps its digits where the slope is close to 1.
  for (int u = 0; u < kSdfUnits; ++u) {
    grad_sum[u] = grad_value[u] * units.slope[u] +
                  grad_weighted[u] * v0[u] * layer.beta * units.slope[u] * exp_of_minus(layer.beta * units.value[u]);
    tile.unit(kWeighted, u, p) = weighted[u];
    tile.unit(kGradSum, u, p) = grad_sum[u];
    tile.unit(kHidden, u, p) = units.value[u];
    tile.unit(kGradFirstRow, u, p) = grad_weighted[u] * units.slope[u];
  }
  add_to_inputs(layer, tile, first, p, grad_sum);
}

// Gradients of the weights as one list: W [n_inputs, width], b [width], V [n_outputs, width], c [n_outputs], width padded.
template <class T> SPLITNERF_HD int64_t sdf_weight_count(const SdfLayer<T>& layer) {
  return (layer.n_inputs + 1 + layer.n_outputs) * layer.width_columns + layer.n_outputs;
}
// The row of this list with the gradients of the weights from, or into, the units; and the number of rows.
template <class T> SPLITNERF_HD int sdf_weight_rows(const SdfLayer<T>& layer) {
  return static_cast<int>(layer.n_inputs + 1 + layer.n_outputs);
}
// The tile's sum for unit u in one row of the list.
template <class T> SPLITNERF_HD T sdf_weight_sum(const SdfTile<T>& tile, int n_points, int row, int u) {
  T sum = T(0);
  const int m = row - tile.n_inputs - 1;
  for (int p = 0; p < n_points; ++p) {
    if (row < tile.n_inputs) {
      sum += tile.unit(kWeighted, u, p) * tile.grad_steepness(row, p) + tile.unit(kGradSum, u, p) * tile.input(row, p);
    } else if (m < 0) {
      sum += tile.unit(kGradSum, u, p);
    } else {
      sum += tile.output(m, p) * tile.unit(kHidden, u, p);
      if (m == 0) sum += tile.unit(kGradFirstRow, u, p);
    }
  }
  return sum;
}
template <class T> SPLITNERF_HD T sdf_bias_sum(const SdfTile<T>& tile, int n_points, int m) {
  T sum = T(0);
  for (int p = 0; p < n_points; ++p) sum += tile.output(m, p);
  return sum;
}

// One of n_parts parts of the inputs of a point of the field itself: its position and the hash grid's features.
template <int F, class T, class S>
SPLITNERF_HD void load_field_inputs(const HashGridView<T, S>& grid, T scale, Vec3<T> position, const SdfTile<T>& tile,
                                    int p, int part = 0, int n_parts = 1) {
  for (int axis = part; axis < 3; axis += n_parts) tile.input(axis, p) = position[axis];
  const Vec3<T> unit{position.x * scale + T(0.5), position.y * scale + T(0.5), position.z * scale + T(0.5)};
  for (int l = part; l < grid.n_levels; l += n_parts) {
    LevelFeatures<T, F> at;
    if (l < grid.n_active) at = level_features<F>(grid.levels[l], grid.table, unit);
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
// them, they were worked out in vain. tile: room for Group::size / kWalkLanes points.
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
