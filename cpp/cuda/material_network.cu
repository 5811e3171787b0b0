// The materials' network on tiles of points in memory that a block shares. kShare threads share a point: each works out every
// kShare-th group of kUnits columns of a layer.
//
// Counted for preset fast (9,000 points, 48 inputs, twice 64 units, float32) on an H100, 132 processors at 1.7 GHz: 7,488 products a
// point. Forward: 141 blocks, one a processor; a thread has 1,872 products in 234 groups of 8, each with one number of the tile
// and two loads of 16 bytes of weights, which stand in the L1 cache: 2,600 instructions, 2 warps a scheduler, 3 us if each issues one a
// cycle, 6 us where each group waits 40 cycles for its loads. Backward: the same again, the same for the gradient of what the layers
// take, and 1,872 products a thread for the weights' with 9 numbers of the tile for 8 of them: 3.5 times as much, 20 us. Memory: 1.7 MB of
// inputs each way and 4.5 MB of sums, 2 us each. It never ran on a GPU.
#include "splitnerf/material_network.h"

#include <algorithm>

#include "tile_size.cuh"
#include "splitnerf/accumulate.h"
#include "splitnerf/ops_cuda.h"

namespace splitnerf::cuda {
namespace {

constexpr int kLanes = 16;                 // columns are padded to a multiple of this
constexpr int kUnits = 8, kShare = 4;      // columns at a time; threads that share a point
constexpr int kMostThreads = kTilePoints[0] * kShare;
constexpr int kMostSums = 256;  // lists of the weights' gradients, one a block

// ---- the numbers as the tiles read them, and their gradients ----

template <class T> struct PrepareBody {
  MaterialWeights<T> weights;
  MaterialNetwork<T> net;
  T* numbers;

  SPLITNERF_HD void operator()(int64_t i) const {
    int l = 0;
    int64_t j = i;
    for (; j >= net.layers[l].size(); ++l) j -= net.layers[l].size();
    numbers[i] = padded_number(net.layers[l], weights.weights[l], weights.biases[l], j);
  }
};
template <class T> MaterialNetwork<T> prepare(const Queue& queue, const char* op, const MaterialWeights<T>& weights) {
  const int64_t n = material_numbers(weights, kLanes);
  T* const numbers = queue.scratch<T>(n);
  const MaterialNetwork<T> net = material_shape(weights, kLanes, numbers);
  for_each(queue, op, n, PrepareBody<T>{weights, net, numbers});
  return net;
}

// The blocks' sums, added in order; one call for each number of the list.
template <class T> struct FinishBody {
  MaterialNetwork<T> net;
  int n_sums;
  const T* sums;
  MaterialGrads<T> to;

  SPLITNERF_HD void operator()(int64_t i) const {
    int l = 0;
    int64_t j = i;
    for (; j >= net.layers[l].grad_size(); ++l) j -= net.layers[l].grad_size();
    T* const place = grad_place(net.layers[l], to.weights[l], to.biases[l], j);
    if (!place) return;
    T total = T(0);
    for (int k = 0; k < n_sums; ++k) total += sums[k * net.grad_size() + i];
    *place = total;
  }
};

// ---- tiles ----

// Rows of numbers, one for each point: what each layer takes, the last sums, and room for two gradients of what a layer takes.
template <class T> struct Tile {
  T* numbers;
  int points;

  // A column more, so that neither rows nor columns meet in one bank.
  __device__ T& at(int row, int p) const { return numbers[row * (points + 1) + p]; }
};
template <class T> SPLITNERF_HD int first_row(const MaterialNetwork<T>& net, int l) {
  int row = 0;
  for (int j = 0; j < l; ++j) row += net.layers[j].n_inputs;
  return row;
}
template <class T> SPLITNERF_HD int forward_rows(const MaterialNetwork<T>& net) {
  return first_row(net, net.n_layers) + kMaterialOutputs;
}
template <class T> SPLITNERF_HD int widest(const MaterialNetwork<T>& net) {
  int most = 0;
  for (int l = 0; l < net.n_layers; ++l) most = max_of(most, net.layers[l].n_inputs);
  return most;
}
template <class T> __device__ Tile<T> shared_tile() {
  SPLITNERF_DYNAMIC_SHARED(memory);
  return {reinterpret_cast<T*>(memory), static_cast<int>(blockDim.x) / kShare};
}

template <class T> struct Parts {
  int n, columns[kMostMaterialInputs];
  T* rows[kMostMaterialInputs];

  Parts(const MaterialWeights<std::remove_const_t<T>>& w, T* const* from) : n(w.n_parts) {
    for (int k = 0; k < n; ++k) columns[k] = w.columns[k], rows[k] = from[k];
  }
};

// Points [first, first + n) of the parts to the tile from row 0 on, zeros behind them; neighbours read neighbours.
template <class T> __device__ void load(const Tile<T>& tile, const Parts<const T>& from, int64_t first, int n) {
  for (int k = 0, row = 0; k < from.n; row += from.columns[k++]) {
    const int columns = from.columns[k];
    for (int i = threadIdx.x; i < tile.points * columns; i += blockDim.x)
      tile.at(row + i % columns, i / columns) = i < n * columns ? from.rows[k][first * columns + i] : T(0);
  }
}
// The reverse, from row `row` on.
template <class T> __device__ void store(const Tile<T>& tile, int row, const Parts<T>& to, int64_t first, int n) {
  for (int k = 0; k < to.n; row += to.columns[k++]) {
    const int columns = to.columns[k];
    for (int i = threadIdx.x; i < n * columns; i += blockDim.x)
      to.rows[k][first * columns + i] = tile.at(row + i % columns, i / columns);
  }
}

// take(c, p, start[c] + sum over r of matrix[r][c] x[r]), x the rows of the tile from `from` on; matrix [n_from, columns].
template <class T, class Take>
__device__ void product(const Tile<T>& tile, int from, int n_from, const T* matrix, int n_to, int columns,
                        const T* start, const Take& take) {
  const int p = threadIdx.x % tile.points, share = threadIdx.x / tile.points;
  for (int c = share * kUnits; c < n_to; c += kShare * kUnits) {
    Pack<T, kUnits> sums{};
    if (start) sums = load_pack<kUnits>(start + c);
    for (int r = 0; r < n_from; ++r) {
      const T x = tile.at(from + r, p);
      const Pack<T, kUnits> w = load_pack<kUnits>(matrix + r * columns + c);
      for (int u = 0; u < kUnits; ++u) sums[u] += w[u] * x;
    }
    for (int u = 0; u < kUnits && c + u < n_to; ++u) take(c + u, p, sums[u]);
  }
}

// All layers, from what the first one takes to the last sums. Ends with a barrier.
template <class T> __device__ void forward(const Tile<T>& tile, const MaterialNetwork<T>& net) {
  for (int l = 0; l < net.n_layers; ++l) {
    const DenseLayer<T>& layer = net.layers[l];
    const int to = first_row(net, l + 1);
    const bool is_last = l + 1 == net.n_layers;
    product(tile, first_row(net, l), layer.n_inputs, layer.transposed, layer.n_outputs, layer.output_columns,
            layer.bias, [&](int c, int p, T sum) { tile.at(to + c, p) = is_last ? sum : rectified(sum); });
    __syncthreads();
  }
}

template <class T>
__global__ void __launch_bounds__(kMostThreads)
    network_kernel(int64_t n, const MaterialNetwork<T> net, const Parts<const T> parts, const MaterialArrays<T> to) {
  const Tile<T> tile = shared_tile<T>();
  const int64_t first = int64_t(blockIdx.x) * tile.points;
  const int here = static_cast<int>(min_of<int64_t>(tile.points, n - first)), sums = first_row(net, net.n_layers);
  load(tile, parts, first, here);
  __syncthreads();
  forward(tile, net);
  for (int i = threadIdx.x; i < here * kMaterialOutputs; i += blockDim.x) {
    const int m = i % kMaterialOutputs, p = i / kMaterialOutputs;
    to.at(first + p, m) = material_output(tile.at(sums + m, p), m, net.min_roughness);
  }
}

// Gradients of a layer's weights and bias over the tile, set or added to `mine`: g the gradient to the layer's sums and x what it
// takes, rows of the tile. A thread has kUnits columns of one row, so far apart that neighbours read neighbouring rows.
template <class T>
__device__ void add_weights(const Tile<T>& tile, const DenseLayer<T>& layer, int n, int g, int x, bool adds, T* mine) {
  const auto put = [&](int64_t i, T sum) { mine[i] = adds ? mine[i] + sum : sum; };
  const int apart = (layer.n_inputs + kUnits - 1) / kUnits;
  for (int i = threadIdx.x; i < layer.n_outputs * apart; i += blockDim.x) {
    const int h = i / apart, k = i % apart;
    Pack<T, kUnits> sums{};
    for (int p = 0; p < n; ++p) {
      const T to_sum = tile.at(g + h, p);
      for (int u = 0; u < kUnits; ++u) sums[u] += to_sum * tile.at(x + min_of(k + u * apart, layer.n_inputs - 1), p);
    }
    for (int u = 0; u < kUnits; ++u)
      if (k + u * apart < layer.n_inputs) put(int64_t{h} * layer.input_columns + k + u * apart, sums[u]);
  }
  for (int h = threadIdx.x; h < layer.n_outputs; h += blockDim.x) {
    T sum = T(0);
    for (int p = 0; p < n; ++p) sum += tile.at(g + h, p);
    put(int64_t{layer.n_outputs} * layer.input_columns + h, sum);
  }
}

// sums [blocks, grad_size]: each block's sums over its tiles.
template <class T>
__global__ void __launch_bounds__(kMostThreads)
    backward_kernel(int64_t n, const MaterialNetwork<T> net, const Parts<const T> parts,
                    const MaterialArrays<const T> grad, const Parts<T> to_parts, T* sums) {
  const Tile<T> tile = shared_tile<T>();
  const int out = first_row(net, net.n_layers), room = widest(net);
  for (int64_t first = int64_t(blockIdx.x) * tile.points; first < n; first += int64_t(gridDim.x) * tile.points) {
    const int here = static_cast<int>(min_of<int64_t>(tile.points, n - first));
    load(tile, parts, first, here);
    __syncthreads();
    forward(tile, net);
    for (int i = threadIdx.x; i < tile.points * kMaterialOutputs; i += blockDim.x) {
      const int m = i % kMaterialOutputs, p = i / kMaterialOutputs;
      T& sum = tile.at(out + m, p);
      sum = p < here ? material_output_backward(sum, m, net.min_roughness, grad.at(first + p, m)) : T(0);
    }
    __syncthreads();
    int g = out;  // the rows of the gradient to a layer's sums
    T* mine = sums + (blockIdx.x + 1) * net.grad_size();
    for (int l = net.n_layers - 1; l >= 0; --l) {
      const DenseLayer<T>& layer = net.layers[l];
      const int x = first_row(net, l), to = forward_rows(net) + (l % 2) * room;
      mine -= layer.grad_size();
      add_weights(tile, layer, here, g, x, first >= int64_t(gridDim.x) * tile.points, mine);
      product(tile, g, layer.n_outputs, layer.weights, layer.n_inputs, layer.input_columns, static_cast<const T*>(nullptr),
              [&](int c, int p, T sum) { tile.at(to + c, p) = l ? rectified_backward(tile.at(x + c, p), sum) : sum; });
      __syncthreads();
      g = to;
    }
    store(tile, g, to_parts, first, here);
  }
}

}  // namespace

template <class T>
void material_network(const Queue& queue, const MaterialWeights<T>& weights, int64_t n, const T* const* parts,
                      const MaterialArrays<T>& to) {
  const char* op = "material_network";
  if (n == 0) return;
  const MaterialNetwork<T> net = prepare(queue, op, weights);
  const auto kernel = network_kernel<T>;
  const TileSize tile = tile_size<T>(op, forward_rows(net), kernel, "the layers are too wide");
  launch(queue, op, kernel, blocks_for(n, tile.points), tile.points * kShare, tile.bytes, n, net,
         Parts<const T>(weights, parts), to);
}

template <class T>
void material_network_backward(const Queue& queue, const MaterialWeights<T>& weights, int64_t n, const T* const* parts,
                               const MaterialArrays<const T>& grad, const MaterialGrads<T>& to) {
  const char* op = "material_network_backward";
  const MaterialNetwork<T> net = prepare(queue, op, weights);
  const auto kernel = backward_kernel<T>;
  const TileSize tile = tile_size<T>(op, forward_rows(net) + 2 * widest(net), kernel, "the layers are too wide");
  const int n_sums = static_cast<int>(std::min<int64_t>((n + tile.points - 1) / tile.points, kMostSums));
  T* const sums = queue.scratch<T>(std::max(n_sums, 1) * net.grad_size());
  if (n_sums > 0)
    launch(queue, op, kernel, n_sums, tile.points * kShare, tile.bytes, n, net, Parts<const T>(weights, parts), grad,
           Parts<T>(weights, to.parts), sums);
  for_each(queue, op, net.grad_size(), FinishBody<T>{net, n_sums, sums, to});
}

#define SPLITNERF_INSTANTIATE(T)                                                                                  \
  template void material_network<T>(const Queue&, const MaterialWeights<T>&, int64_t, const T* const*,            \
                                    const MaterialArrays<T>&);                                                    \
  template void material_network_backward<T>(const Queue&, const MaterialWeights<T>&, int64_t, const T* const*,   \
                                             const MaterialArrays<const T>&, const MaterialGrads<T>&);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cuda
