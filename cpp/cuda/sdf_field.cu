// The distance field, hash grid and layer in one kernel, forward and backward. A block takes tiles of points in turn; what a
// tile computes on the way, features and their Jacobian among it, stays in shared memory and registers.
//
//   x: position and features, and 1, so that the bias is a row of W; h = softplus(W x); outputs = V h + c;
//   steepness = W^T (slope v_0), v_0 the distance's row of V; gradient = steepness[:3] + J steepness[3:] / (2 box)
//
// Counted for preset fast: 39,000 points, 16 levels of 2 features in 16 bits, 64 units, 13 outputs. It never ran on a GPU.
//
//   forward    15,500 operations a point, 0.6 GFLOP: 10 to 12 us at the 50 to 60 TFLOP/s that an H100 and an H200 reach in float32.
//              Memory: 204 bytes a point, 8 MB, 2.4 us on an H100, 1.7 us on an H200. The gathers, from the L2 cache, are 512 bytes
//              a point, 20 MB, and up to 160 MB in sectors of 32 bytes, 29 us, where no two of a point's neighbours meet.
//   backward   40,000 operations a point, 1.6 GFLOP: 26 to 31 us; memory as above, and 3 MB of blocks' sums. But 5.0 million pairs
//              are added to the table, for which the gradient of an encoding with its Jacobian alone took 110 us on an H100: this is the limit.
//
// So tensor cores are not what is missing, and in TF32 inputs near 1.5 would be off by 7e-4, which normals at s = 300 show. A block
// takes 99 kB of shared memory forward and 93 kB backward, so that two share a processor; 610 tiles are 2.3 rounds of 264 blocks.
#include <algorithm>

#include "sdf_prepare.cuh"
#include "sdf_tile.cuh"
#include "splitnerf/features.h"
#include "splitnerf/ops_cuda.h"

namespace splitnerf::cuda {
namespace {

constexpr int kPointChoices[] = {64, 32, 16};  // points of a tile; a block has kSide threads for each
constexpr int kMostThreads = kSide * 64;
constexpr int kMostBlocks = 264;  // two for each processor of an H100

// ---- forward ----

// The thread's units: slope v_0 and, behind it, h.
template <class T> __device__ void store_forward(const SdfLayer<T>& layer, const Tile<T>& tile) {
  Square<T> unit = sums_of_units(tile);
  SPLITNERF_UNROLL
  for (int i = 0; i < kSide; ++i) {
    const T v0 = tile.weights(tile.inputs, tile.first_unit() + i);
    Pack<T, kSide> weighted;
    SPLITNERF_UNROLL
    for (int j = 0; j < kSide; ++j) {
      const Softplus<T> s = softplus_and_slope(unit.row[i][j], layer.beta);
      unit.row[i][j] = s.value, weighted[j] = s.slope * v0;
    }
    tile.units.store(tile.first_unit() + i, tile.first_point(), weighted);
  }
  store_units(tile, unit, tile.second_units());
}

template <class T, int F, class S>
__global__ void __launch_bounds__(kMostThreads, sizeof(T) == 4 ? 2 : 1)
    field_kernel(int64_t n, const HashGridView<T, S> grid, const SdfLayer<T> layer, const T* positions,
                 const SdfOutputs<T> to) {
  Tile<T> tile(layer);
  const Matrix<T> results = tile.take_rows(tile.inputs + tile.outputs);  // steepness, outputs
  const Matrix<T> jacobian = tile.take_rows(3 * tile.n_features);
  const int columns = tile.n_features, groups = tile.points / kSide;
  for (int64_t tile_number = blockIdx.x; tile_number * tile.points < n; tile_number += gridDim.x) {
    const int64_t first = tile_number * tile.points;
    const int here = static_cast<int>(min_of<int64_t>(tile.points, n - first));
    load_points<F>(grid, layer, positions, first, here, tile, [&](int l, int p, const LevelFeatures<T, F>& at) {
      for (int f = 0; f < F; ++f) {
        jacobian(l * F + f, p) = at.dx[f];
        jacobian(columns + l * F + f, p) = at.dy[f];
        jacobian(2 * columns + l * F + f, p) = at.dz[f];
      }
    });
    tile.each((tile.inputs + tile.outputs) * tile.points, [&](int i) {
      const int m = i / tile.points - tile.inputs;
      results(i / tile.points, i % tile.points) = m >= 0 && m < tile.n_outputs ? layer.out_bias[m] : T(0);
    });
    for_units(layer, tile, tile_number == blockIdx.x, [&](int) {
      store_forward(layer, tile);
      __syncthreads();
      tile.each(tile.row_groups() * groups, [&](int i) {
        const int group = i / groups;
        add_rows(tile.weights, tile.rows(group), tile.units.from_row(tile.of_inputs(group) ? 0 : kUnits),
                 kSide * (i % groups), results, 0);
      });
    });
    tile.each(3 * here, [&](int i) {
      const int axis = i % 3, p = i / 3;
      T sum = T(0);
      for (int c = 0; c < columns; ++c) sum += jacobian(axis * columns + c, p) * results(3 + c, p);
      to.gradient[3 * first + i] = results(axis, p) + layer.scale * sum;
    });
    tile.each(here * columns, [&](int i) { to.features[first * columns + i] = tile.x(3 + i % columns, i / columns); });
    tile.each(here * tile.n_outputs, [&](int i) {
      to.outputs[first * tile.n_outputs + i] = results(tile.inputs + i % tile.n_outputs, i / tile.n_outputs);
    });
    __syncthreads();
  }
}

// ---- backward ----

// Gradients of the weights, summed over the points: W^T [n_inputs + 1, units], V [n_outputs, units], c [n_outputs], units padded.
template <class T> SPLITNERF_HD int64_t weight_rows(const SdfLayer<T>& layer) {
  return layer.n_inputs + 1 + layer.n_outputs;
}
template <class T> SPLITNERF_HD int64_t sum_count(const SdfLayer<T>& layer) {
  return weight_rows(layer) * layer.width_columns + layer.n_outputs;
}

// A block's sums. Where each thread has one square of them at most, it keeps that in registers until the block has seen all of its
// points; else squares are added to memory after each tile.
template <class T> struct WeightSums {
  const SdfLayer<T>& layer;
  bool keeps;
  T* sums;  // [blocks, sum_count], zeros where squares are added to it
  Square<T> kept = {};

  __device__ T* memory() const { return sums + blockIdx.x * sum_count(layer); }  // not kept: registers are scarce

  static SPLITNERF_HD bool can_keep(const SdfLayer<T>& layer, const Sizes& sizes) {
    return layer.width_columns <= kUnits &&
           (sizes.inputs + sizes.outputs) / kSide * kUnitGroups <= kSide * sizes.points;
  }
  // Square i is that of row group i / kUnitGroups. Calls add(group, units of it, square) for those of groups [begin, end).
  template <class Add> __device__ void add(const Tile<T>& tile, int unit, int begin, int end, const Add& add) {
    for (int i = threadIdx.x; i < end * kUnitGroups; i += static_cast<int>(blockDim.x)) {
      if (i < begin * kUnitGroups) continue;
      if (!keeps) kept = {};
      add(i / kUnitGroups, Group{i % kUnitGroups, kUnitGroups}, kept);
      if (!keeps) write(tile, unit, i);
    }
  }
  __device__ void write(const Tile<T>& tile, int unit, int i) const {
    const int group = i / kUnitGroups;
    const Group rows = tile.rows(group);
    SPLITNERF_UNROLL
    for (int r = 0; r < kSide; ++r) {
      const int m = rows[r] - tile.inputs, row = m < 0 ? rows[r] : tile.n_inputs + 1 + m;
      if (m < 0 ? row > tile.n_inputs : m >= tile.n_outputs) continue;
      SPLITNERF_UNROLL
      for (int c = 0; c < kSide; ++c) {
        const int column = unit + i % kUnitGroups + c * kUnitGroups;
        if (column >= layer.width_columns) continue;
        T& to = memory()[row * layer.width_columns + column];
        to = keeps ? kept.row[r][c] : to + kept.row[r][c];
      }
    }
  }
};

// Fills the rows of `given`: of inputs, the gradients to the steepness; of outputs, those to the outputs.
template <int F, class T, class S>
__device__ void load_given(const HashGridView<T, S>& grid, const SdfLayer<T>& layer, const T* positions,
                           const SdfOutputs<const T>& grads, int64_t first, int here, const Tile<T>& tile,
                           const Matrix<T>& given) {
  // gradient[axis] = steepness[axis] + scale J[axis] . steepness[3:]
  load_points<F>(grid, layer, positions, first, here, tile, [&](int l, int p, const LevelFeatures<T, F>& at) {
    const Vec3<T> g = p < here ? load3(grads.gradient + 3 * (first + p)) : Vec3<T>{};
    for (int f = 0; f < F; ++f)
      given(3 + l * F + f, p) = layer.scale * (g.x * at.dx[f] + g.y * at.dy[f] + g.z * at.dz[f]);
  });
  tile.each((tile.inputs - tile.n_features + tile.outputs) * tile.points, [&](int i) {
    const int p = i % tile.points, i_row = i / tile.points, row = i_row < 3 ? i_row : i_row + tile.n_features;
    const int m = row - tile.inputs;
    T value = T(0);
    if (p < here && row < 3) value = grads.gradient[3 * (first + p) + row];
    if (p < here && m >= 0 && m < tile.n_outputs) value = grads.outputs[(first + p) * tile.n_outputs + m];
    given(row, p) = value;
  });
}

// The units of a thread on the way back. It stores slope v_0 and, behind it, the gradient to W x.
template <class T> struct UnitsBackward {
  Square<T> value;      // h
  Square<T> first_row;  // what slope v_0 adds to the gradient to v_0; before, the gradient to slope v_0

  __device__ UnitsBackward(const SdfLayer<T>& layer, const Tile<T>& tile, const Matrix<T>& given) {
    const int unit = tile.first_unit(), point = tile.first_point();
    Square<T> of_value;
    value = sums_of_units(tile);
    add_transposed(tile.n_inputs, tile.weights, unit, given, point, first_row);
    add_transposed(tile.n_outputs, tile.weights.from_row(tile.inputs), unit, given.from_row(tile.inputs), point,
                   of_value);
    SPLITNERF_UNROLL
    for (int i = 0; i < kSide; ++i) {
      const T v0 = tile.weights(tile.inputs, unit + i);
      Pack<T, kSide> weighted;
      SPLITNERF_UNROLL
      for (int j = 0; j < kSide; ++j) {
        const Softplus<T> s = softplus_and_slope(value.row[i][j], layer.beta);
        value.row[i][j] = s.value, weighted[j] = s.slope * v0;
        of_value.row[i][j] = unit_backward(s, layer.beta, of_value.row[i][j], first_row.row[i][j] * v0);
        first_row.row[i][j] *= s.slope;
      }
      tile.units.store(unit + i, point, weighted);
    }
    store_units(tile, of_value, tile.second_units());
  }
};

// sums [blocks, sum_count].
template <class T, int F, class S>
__global__ void __launch_bounds__(kMostThreads, sizeof(T) == 4 ? 2 : 1)
    field_backward_kernel(int64_t n, const HashGridView<T, S> grid, const SdfLayer<T> layer, const T* positions,
                          const SdfOutputs<const T> grads, T* grad_table, T* sums) {
  Tile<T> tile(layer);
  const Matrix<T> given = tile.take_rows(tile.inputs + tile.outputs);
  const Matrix<T> results = tile.take_rows(2 * tile.inputs);  // steepness, and the gradient to x
  T* const bias_sums = tile.take(tile.outputs);
  WeightSums<T> weight_sums{layer, WeightSums<T>::can_keep(layer, tile), sums};
  const int columns = tile.n_features, groups = tile.points / kSide, input_groups = tile.inputs / kSide;
  tile.each(tile.outputs, [&](int m) { bias_sums[m] = T(0); });
  for (int64_t tile_number = blockIdx.x; tile_number * tile.points < n; tile_number += gridDim.x) {
    const int64_t first = tile_number * tile.points;
    const int here = static_cast<int>(min_of<int64_t>(tile.points, n - first));
    load_given<F>(grid, layer, positions, grads, first, here, tile, given);
    tile.each(2 * tile.inputs * tile.points, [&](int i) { results(i / tile.points, i % tile.points) = T(0); });
    for_units(layer, tile, tile_number == blockIdx.x, [&](int unit) {
      const UnitsBackward<T> units(layer, tile, given);
      __syncthreads();
      tile.each(2 * input_groups * groups, [&](int i) {
        const int which = i / groups / input_groups;
        add_rows(tile.weights, tile.rows(i / groups % input_groups), tile.units.from_row(which * kUnits),
                 kSide * (i % groups), results, which * tile.inputs);
      });
      weight_sums.add(tile, unit, 0, input_groups, [&](int group, Group units, Square<T>& sum) {
        add_of_rows(tile.points, given, tile.rows(group), tile.units, units, sum);
        add_of_rows(tile.points, tile.x, tile.rows(group), tile.second_units(), units, sum);
      });
      __syncthreads();
      store_units(tile, units.value, tile.units), store_units(tile, units.first_row, tile.second_units());
      __syncthreads();
      weight_sums.add(tile, unit, input_groups, tile.row_groups(), [&](int group, Group units, Square<T>& sum) {
        add_of_rows(tile.points, given, tile.rows(group), tile.units, units, sum);
        if (group > input_groups) return;
        SPLITNERF_UNROLL
        for (int c = 0; c < kSide; ++c) sum.row[0][c] += sum_of_row(tile.points, tile.second_units(), units[c]);
      });
    });
    tile.each(tile.n_outputs, [&](int m) { bias_sums[m] += sum_of_row(tile.points, given, tile.inputs + m); });
    tile.each(grid.n_active * tile.points, [&](int i) {
      const int p = i % tile.points, l = i / tile.points;
      if (p >= here) return;
      LevelGradients<T, F> from;
      from.value = load_pack<F>(grads.features + (first + p) * columns + l * F);
      for (int f = 0; f < F; ++f) {
        const T slope = layer.scale * results(3 + l * F + f, p);
        from.value[f] += results(tile.inputs + 3 + l * F + f, p);
        from.dx[f] = given(0, p) * slope, from.dy[f] = given(1, p) * slope, from.dz[f] = given(2, p) * slope;
      }
      scatter_level(grid.levels[l], to_unit(load3(positions + 3 * (first + p)), layer.scale), from, grad_table);
    });
    __syncthreads();
  }
  if (weight_sums.keeps && static_cast<int>(threadIdx.x) < tile.row_groups() * kUnitGroups)
    weight_sums.write(tile, 0, threadIdx.x);
  tile.each(tile.n_outputs,
            [&](int m) { weight_sums.memory()[weight_rows(layer) * layer.width_columns + m] = bias_sums[m]; });
}

// totals [count] = the blocks' sums, added in order: each warp adds every kSlices-th of them, the first one the warps' sums.
constexpr int kSlices = 8;
template <class T>
__global__ void __launch_bounds__(kSlices* Warp::size)
    add_blocks_kernel(int64_t count, int n_blocks, const T* sums, T* totals) {
  SPLITNERF_SHARED(T, of_slices, [kSlices][Warp::size]);
  const int lane = threadIdx.x % Warp::size, slice = threadIdx.x / Warp::size;
  const int64_t i = int64_t(blockIdx.x) * Warp::size + lane;
  T sum = T(0);
  if (i < count)
    for (int k = slice; k < n_blocks; k += kSlices) sum += sums[k * count + i];
  of_slices[slice][lane] = sum;
  __syncthreads();
  if (slice > 0 || i >= count) return;
  for (int k = 1; k < kSlices; ++k) sum += of_slices[k][lane];
  totals[i] = sum;
}

// From the sums of all points to the gradients in the weights' own shapes, a row of W or of V, with its bias, a call.
template <class T> struct FinishBody {
  SdfLayer<T> layer;
  SdfWeights<T> weights;
  const T* totals;
  SdfFieldGrad<T> to;

  template <class Group> SPLITNERF_HD void operator()(const Group& group, int64_t r) const {
    const int64_t columns = layer.width_columns, m = r - layer.width, n = m < 0 ? layer.n_inputs : layer.width;
    T* const row = m < 0 ? to.hidden + r * n : to.out + m * n;
    for (int64_t k = group.lane(); k < n; k += Group::size)
      row[k] = m < 0 ? totals[k * columns + r] : totals[(layer.n_inputs + 1 + m) * columns + k];
    if (m < 0) {
      weight_norm_backward(group, n, weights.hidden + r * n, weights.hidden_length[r], row, row, to.hidden_length + r);
      if (group.lane() == 0) to.hidden_bias[r] = totals[layer.n_inputs * columns + r];
    } else {
      weight_norm_backward(group, n, weights.out + m * n, weights.out_length[m], row, row, to.out_length + m);
      if (group.lane() == 0) to.out_bias[m] = totals[weight_rows(layer) * columns + m];
    }
  }
};

// ---- launches ----

// The number of points of a tile, and its shared memory, which the kernel is set to allow. numbers(sizes): how many it needs.
struct TileSize {
  Sizes sizes;
  int64_t bytes;
};
template <class T, class Kernel, class Numbers>
TileSize tile_size(const char* op, const SdfLayer<T>& layer, Kernel kernel, const Numbers& numbers) {
  const int most = most_shared_memory(op);
  for (const int points : kPointChoices) {
    const TileSize size{Sizes(layer, points), numbers(Sizes(layer, points)) * int64_t{sizeof(T)}};
    if (size.bytes > most) continue;
    allow_shared_memory(op, kernel, size.bytes);
    return size;
  }
  throw std::invalid_argument(std::string(op) + ": features and outputs are too many for this GPU's shared memory");
}
unsigned blocks_of_tiles(int64_t n, int points) {
  return static_cast<unsigned>(std::min<int64_t>((n + points - 1) / points, kMostBlocks));
}

}  // namespace

template <class T>
void sdf_field(const Queue& queue, const SdfField<T>& field, int64_t n, const T* positions, const SdfOutputs<T>& to) {
  const char* op = "sdf_field";
  if (n == 0) return;
  const SdfLayer<T> layer = prepare(queue, op, field.weights);
  with_features(field.shape.n_features, [&](auto count) {
    field.table.template read_as<T>([&](auto* table) {
      const auto kernel = field_kernel<T, decltype(count)::n, Pointee<decltype(table)>>;
      const TileSize tile = tile_size(op, layer, kernel, [](const Sizes& sizes) { return sizes.forward_numbers(); });
      const int points = tile.sizes.points;
      launch(queue, op, kernel, blocks_of_tiles(n, points), kSide * points, tile.bytes, n,
             make_view<T>(field.shape, field.n_active, nullptr, table), layer, positions, to);
    });
  });
}

template <class T>
void sdf_field_backward(const Queue& queue, const SdfField<T>& field, int64_t n, const T* positions,
                        const SdfOutputs<const T>& given, const SdfFieldGrad<T>& grad) {
  const char* op = "sdf_field_backward";
  const SdfLayer<T> layer = prepare(queue, op, field.weights);
  const int64_t count = sum_count(layer);
  T* const totals = queue.scratch<T>(count);
  with_features(field.shape.n_features, [&](auto features) {
    field.table.template read_as<T>([&](auto* table) {
      const auto kernel = field_backward_kernel<T, decltype(features)::n, Pointee<decltype(table)>>;
      const TileSize tile = tile_size(op, layer, kernel, [](const Sizes& sizes) { return sizes.backward_numbers(); });
      const int points = tile.sizes.points, n_blocks = static_cast<int>(blocks_of_tiles(n, points));
      T* const sums = queue.scratch<T>(std::max(n_blocks, 1) * count);
      if (!WeightSums<T>::can_keep(layer, tile.sizes)) clear(queue, op, sums, n_blocks * count);
      const auto grid = make_view<T>(field.shape, field.n_active, nullptr, table);
      const HashLevel& last = grid.levels[grid.n_levels - 1];
      clear(queue, op, grad.table, (last.offset + last.n_entries) * field.shape.n_features);
      if (n_blocks > 0)
        launch(queue, op, kernel, n_blocks, kSide * points, tile.bytes, n, grid, layer, positions, given, grad.table,
               sums);
      launch(queue, op, add_blocks_kernel<T>, blocks_for(count, Warp::size), kSlices * Warp::size, 0, count, n_blocks,
             sums, totals);
    });
  });
  for_each_group(queue, op, layer.width + layer.n_outputs, FinishBody<T>{layer, field.weights, totals, grad});
}

#define SPLITNERF_INSTANTIATE(T)                                                                                       \
  template void sdf_field<T>(const Queue&, const SdfField<T>&, int64_t, const T*, const SdfOutputs<T>&);               \
  template void sdf_field_backward<T>(const Queue&, const SdfField<T>&, int64_t, const T*, const SdfOutputs<const T>&, \
                                      const SdfFieldGrad<T>&);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cuda
