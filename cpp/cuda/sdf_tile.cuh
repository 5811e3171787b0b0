// A tile of points of the distance field in a block's shared memory, and the products of small matrices there, of which each thread
// keeps squares in registers. Matrices hold a column for each point.
#pragma once

#include "launch.cuh"
#include "splitnerf/bodies/hash_encode.h"
#include "splitnerf/sdf_layer.h"

namespace splitnerf::cuda {

inline constexpr int kSide = 4;                     // a thread works out squares of kSide x kSide numbers of a product
inline constexpr int kUnits = 64;                   // hidden units at a time
inline constexpr int kUnitGroups = kUnits / kSide;  // a thread's units lie side by side, or kUnitGroups apart

// ---- matrices in shared memory, and their products ----

template <class T> struct Matrix {
  T* numbers;
  int stride;  // from row to row: kSide more than the columns, so that neighbours in a column lie in different banks

  __device__ T& operator()(int row, int column) const { return numbers[row * stride + column]; }
  __device__ Pack<T, kSide> load(int row, int column) const {
    return load_pack<kSide>(numbers + row * stride + column);
  }
  __device__ void store(int row, int column, const Pack<T, kSide>& values) const {
    store_pack(numbers + row * stride + column, values);
  }
  __device__ Matrix from_row(int row) const { return {numbers + row * stride, stride}; }
};

// Rows or columns first, first + step, ... of a matrix, kSide of them.
struct Group {
  int first, step;

  __device__ int operator[](int i) const { return first + i * step; }
};

template <class T> struct Square {
  Pack<T, kSide> row[kSide] = {};
};

// += left^T right, of n rows: left's columns from `i` on, right's from `j` on.
template <class T>
__device__ void add_transposed(int n, const Matrix<T>& left, int i, const Matrix<T>& right, int j, Square<T>& sum) {
  for (int k = 0; k < n; ++k) {
    const Pack<T, kSide> a = left.load(k, i), b = right.load(k, j);
    SPLITNERF_UNROLL
    for (int r = 0; r < kSide; ++r) {
      SPLITNERF_UNROLL
      for (int c = 0; c < kSide; ++c) sum.row[r][c] += a[r] * b[c];
    }
  }
}

// += left right, of n inner columns: some rows of left, right's columns from `j` on.
template <class T>
__device__ void add_product(int n, const Matrix<T>& left, Group rows, const Matrix<T>& right, int j, Square<T>& sum) {
  for (int k = 0; k < n; k += kSide) {
    Square<T> a;
    SPLITNERF_UNROLL
    for (int r = 0; r < kSide; ++r) a.row[r] = left.load(rows[r], k);
    SPLITNERF_UNROLL
    for (int q = 0; q < kSide; ++q) {
      const Pack<T, kSide> b = right.load(k + q, j);
      SPLITNERF_UNROLL
      for (int r = 0; r < kSide; ++r) {
        SPLITNERF_UNROLL
        for (int c = 0; c < kSide; ++c) sum.row[r][c] += a.row[r][q] * b[c];
      }
    }
  }
}

// += left right^T, of n columns: some rows of both.
template <class T>
__device__ void add_of_rows(int n, const Matrix<T>& left, Group rows, const Matrix<T>& right, Group columns,
                            Square<T>& sum) {
  for (int k = 0; k < n; k += kSide) {
    Square<T> a;
    SPLITNERF_UNROLL
    for (int r = 0; r < kSide; ++r) a.row[r] = left.load(rows[r], k);
    SPLITNERF_UNROLL
    for (int c = 0; c < kSide; ++c) {
      const Pack<T, kSide> b = right.load(columns[c], k);
      SPLITNERF_UNROLL
      for (int r = 0; r < kSide; ++r) {
        SPLITNERF_UNROLL
        for (int q = 0; q < kSide; ++q) sum.row[r][c] += a.row[r][q] * b[q];
      }
    }
  }
}

template <class T> __device__ T sum_of_row(int n, const Matrix<T>& matrix, int row) {
  T sum = T(0);
  for (int k = 0; k < n; k += kSide) {
    const Pack<T, kSide> values = matrix.load(row, k);
    for (int q = 0; q < kSide; ++q) sum += values[q];
  }
  return sum;
}

// to [kSide rows, columns] += left [rows, kUnits] right [kUnits, columns].
template <class T>
__device__ void add_rows(const Matrix<T>& left, Group rows, const Matrix<T>& right, int column, const Matrix<T>& to,
                         int to_first) {
  Square<T> sum;
  add_product(kUnits, left, rows, right, column, sum);
  SPLITNERF_UNROLL
  for (int r = 0; r < kSide; ++r) {
    Pack<T, kSide> total = to.load(to_first + rows[r], column);
    SPLITNERF_UNROLL
    for (int c = 0; c < kSide; ++c) total[c] += sum.row[r][c];
    to.store(to_first + rows[r], column, total);
  }
}

// ---- a tile ----

// Rows of inputs and of outputs are padded to whole groups.
struct Sizes {
  int points, n_inputs, n_outputs, n_features, inputs, outputs;

  template <class T>
  SPLITNERF_HD Sizes(const SdfLayer<T>& layer, int points)
      : points(points), n_inputs(static_cast<int>(layer.n_inputs)), n_outputs(static_cast<int>(layer.n_outputs)),
        n_features(n_inputs - 3), inputs((n_inputs + kSide) / kSide * kSide),
        outputs((n_outputs + kSide - 1) / kSide * kSide) {}
  SPLITNERF_HD int weight_numbers() const { return (inputs + outputs) * (kUnits + kSide); }
  SPLITNERF_HD int forward_rows() const { return 2 * inputs + outputs + 2 * kUnits + 3 * n_features; }
  SPLITNERF_HD int backward_rows() const { return 4 * inputs + outputs + 2 * kUnits; }
  SPLITNERF_HD int64_t forward_numbers() const { return weight_numbers() + int64_t{forward_rows()} * (points + kSide); }
  SPLITNERF_HD int64_t backward_numbers() const {
    return weight_numbers() + int64_t{backward_rows()} * (points + kSide) + outputs;
  }
};

// A block's shared memory, and which part of the products is whose.
template <class T> struct Tile : Sizes {
  Matrix<T> weights;  // W^T [inputs, kUnits], then V [outputs, kUnits], of the units at hand
  Matrix<T> x;        // [inputs, points]
  Matrix<T> units;    // twice [kUnits, points]
  T* rest;

  __device__ explicit Tile(const SdfLayer<T>& layer) : Sizes(layer, blockDim.x / kSide) {
    SPLITNERF_DYNAMIC_SHARED(memory);
    rest = reinterpret_cast<T*>(memory);
    weights = {take((inputs + outputs) * (kUnits + kSide)), kUnits + kSide};
    x = take_rows(inputs), units = take_rows(2 * kUnits);
  }
  __device__ T* take(int n) {
    T* const first = rest;
    rest += n;
    return first;
  }
  __device__ Matrix<T> take_rows(int rows) { return {take(rows * (points + kSide)), points + kSide}; }

  __device__ Matrix<T> second_units() const { return units.from_row(kUnits); }
  __device__ int first_unit() const { return kSide * (static_cast<int>(threadIdx.x) / (points / kSide)); }
  __device__ int first_point() const { return kSide * (static_cast<int>(threadIdx.x) % (points / kSide)); }
  // Calls body(i) for i < n, each in one thread.
  template <class Body> __device__ void each(int n, const Body& body) const {
    for (int i = threadIdx.x; i < n; i += static_cast<int>(blockDim.x)) body(i);
  }
  // A group of rows of weights, or of other matrices with as many rows for inputs and then for outputs.
  __device__ int row_groups() const { return (inputs + outputs) / kSide; }
  __device__ bool of_inputs(int group) const { return group < inputs / kSide; }
  __device__ Group rows(int group) const {
    const int n = inputs / kSide;
    return group < n ? Group{group, n} : Group{inputs + group - n, outputs / kSide};
  }
};

// Units [first, first + kUnits), zeros beyond the last one.
template <class T> __device__ void load_weights(const SdfLayer<T>& layer, int first, const Tile<T>& tile) {
  tile.each((tile.inputs + tile.outputs) * kUnits, [&](int i) {
    const int row = i / kUnits, u = i % kUnits, m = row - tile.inputs;
    const int64_t columns = layer.width_columns;
    const bool real = first + u < columns && (m < 0 ? row <= tile.n_inputs : m < tile.n_outputs);
    const T* const from = m < 0 ? layer.hidden_transposed + row * columns : layer.out + m * columns;
    tile.weights(row, u) = real ? from[first + u] : T(0);
  });
}

// Fills x, and calls use(level, p, features there) for each level of each point; points beyond `here` are zeros.
template <int F, class T, class S, class Use>
__device__ void load_points(const HashGridView<T, S>& grid, const SdfLayer<T>& layer, const T* positions, int64_t first,
                            int here, const Tile<T>& tile, const Use& use) {
  tile.each((tile.inputs - tile.n_features) * tile.points, [&](int i) {
    const int p = i % tile.points, row = i / tile.points;
    const T value = row < 3 ? (p < here ? positions[3 * (first + p) + row] : T(0)) : T(row == 3 && p < here);
    tile.x(row < 3 ? row : row + tile.n_features, p) = value;
  });
  tile.each(grid.n_levels * tile.points, [&](int i) {
    const int p = i % tile.points, l = i / tile.points;
    LevelFeatures<T, F> at;
    if (l < grid.n_active && p < here)
      at = level_features<F>(grid.levels[l], grid.table, to_unit(load3(positions + 3 * (first + p)), layer.scale));
    for (int f = 0; f < F; ++f) tile.x(3 + l * F + f, p) = at.value[f];
    use(l, p, at);
  });
}

// The thread's units before the activation.
template <class T> __device__ Square<T> sums_of_units(const Tile<T>& tile) {
  Square<T> sums;
  add_transposed(tile.n_inputs + 1, tile.weights, tile.first_unit(), tile.x, tile.first_point(), sums);
  return sums;
}
template <class T> __device__ void store_units(const Tile<T>& tile, const Square<T>& values, const Matrix<T>& to) {
  SPLITNERF_UNROLL
  for (int i = 0; i < kSide; ++i) to.store(tile.first_unit() + i, tile.first_point(), values.row[i]);
}

// Calls body(first unit) for each kUnits of them, with their weights loaded; W and V stay where they are all.
template <class T, class Body>
__device__ void for_units(const SdfLayer<T>& layer, const Tile<T>& tile, bool first_tile, const Body& body) {
  for (int unit = 0; unit < layer.width_columns; unit += kUnits) {
    if (first_tile || layer.width_columns > kUnits) load_weights(layer, unit, tile);
    __syncthreads();
    body(unit);
    __syncthreads();
  }
}

}  // namespace splitnerf::cuda
