#include "splitnerf/bodies/sdf_layer.h"

#include <algorithm>

#include "launch.cuh"
#include "splitnerf/ops_cuda.h"
#include "splitnerf/bodies/rays.h"
#include "splitnerf/features.h"

namespace splitnerf::cuda {
namespace {

constexpr int kPadding = 16;               // units are padded to a multiple of this
constexpr int kMostSums = 256;             // copies of the weights' gradients, one a block
constexpr int kPointChoices[] = {64, 32};  // threads of a block, one a point of its tile
constexpr int kWalkThreads = 128;          // threads of a block that walks along rays
constexpr int kWalkWarps = kWalkThreads / Warp::size, kWalkPoints = Warp::size / kWalkLanes;
constexpr int kMostCopied = 40 * 1024;  // bytes of weights that it copies: with more, too few blocks share a processor

// ---- the weights as the tiles read them ----

template <class T> struct PrepareBody {
  SdfWeights<T> weights;
  SdfLayer<T> layer;
  T *hidden_transposed, *hidden_bias, *out;

  // One call for each of the padded units.
  SPLITNERF_HD void operator()(int64_t h) const {
    const bool real = h < weights.width;
    for (int k = 0; k < weights.n_inputs; ++k)
      hidden_transposed[k * layer.width_columns + h] = real ? weights.hidden[h * weights.n_inputs + k] : T(0);
    for (int m = 0; m < weights.n_outputs; ++m)
      out[m * layer.width_columns + h] = real ? weights.out[m * weights.width + h] : T(0);
    hidden_bias[h] = real ? weights.hidden_bias[h] : T(0);
  }
};

template <class T> SdfLayer<T> prepare(const Queue& queue, const char* op, const SdfWeights<T>& w) {
  SdfLayer<T> layer{};
  layer.n_inputs = w.n_inputs, layer.width = w.width, layer.n_outputs = w.n_outputs;
  layer.width_columns = (w.width + kPadding - 1) / kPadding * kPadding;
  layer.beta = w.beta, layer.scale = T(0.5) / w.box;
  T* const hidden = queue.scratch<T>((layer.n_inputs + 1 + layer.n_outputs) * layer.width_columns);
  T *const bias = hidden + layer.n_inputs * layer.width_columns, *const out = bias + layer.width_columns;
  layer.hidden_transposed = hidden, layer.hidden_bias = bias, layer.out = out, layer.out_bias = w.out_bias;
  for_each(queue, op, layer.width_columns, PrepareBody<T>{w, layer, hidden, bias, out});
  return layer;
}

// How many numbers of a prepared layer, which stand side by side, a distance needs: W, b and the first row of V.
template <class T> SPLITNERF_HD int distance_weights(const SdfLayer<T>& layer) {
  return static_cast<int>((layer.n_inputs + 2) * layer.width_columns);
}
template <class T> SPLITNERF_HD int walk_tile_size(const SdfLayer<T>& layer) {
  return static_cast<int>(layer.n_inputs) * kWalkPoints;
}
// The layer with these copied to memory that the block shares; its threads come here together.
template <class T> __device__ SdfLayer<T> in_shared_memory(SdfLayer<T> layer, T* memory) {
  for (int i = threadIdx.x; i < distance_weights(layer); i += blockDim.x) memory[i] = layer.hidden_transposed[i];
  __syncthreads();
  layer.hidden_transposed = memory;
  layer.hidden_bias = memory + layer.n_inputs * layer.width_columns;
  layer.out = layer.hidden_bias + layer.width_columns;
  return layer;
}

// ---- tiles ----

template <class T> __device__ SdfTile<T> shared_tile(const SdfLayer<T>& layer) {
  SPLITNERF_DYNAMIC_SHARED(memory);
  // A column more, so that neither rows nor columns meet in one bank.
  return {reinterpret_cast<T*>(memory), static_cast<int>(blockDim.x) + 1, static_cast<int>(layer.n_inputs),
          static_cast<int>(layer.n_outputs)};
}

// Rows [first, first + n) of [points, columns] to numbers of the tile, zeros behind them; neighbours read neighbours.
template <class T, class To> __device__ void load_rows(const T* rows, int64_t first, int n, int columns, const To& to) {
  for (int i = threadIdx.x; i < static_cast<int>(blockDim.x) * columns; i += blockDim.x) {
    const int p = i / columns, c = i % columns;
    to(p, c) = p < n ? rows[first * columns + i] : T(0);
  }
}
template <class T>
__device__ void load_inputs(const SdfTile<T>& tile, const T* positions, const T* features, int64_t first, int n) {
  load_rows(positions, first, n, 3, [&](int p, int c) -> T& { return tile.input(c, p); });
  load_rows(features, first, n, tile.n_inputs - 3, [&](int p, int c) -> T& { return tile.input(3 + c, p); });
}

template <class T, int F, class S>
__global__ void values_kernel(int64_t n, const HashGridView<T, S> grid, const SdfLayer<T> layer, const T* positions,
                              T* values) {
  const SdfTile<T> tile = shared_tile(layer);
  const int64_t i = int64_t(blockIdx.x) * blockDim.x + threadIdx.x;
  if (i >= n) return;
  load_field_inputs<F>(grid, layer.scale, load3(positions + 3 * i), tile, threadIdx.x);
  values[i] = sdf_value(layer, tile, threadIdx.x);
}

// A warp a ray: starts [n_rays, most], counts and evaluated [n_rays]. Shared memory: the layer's weights for a distance where
// `copies`, then a tile of kWalkPoints points for each warp.
//
// Counted for preset fast (2,900 rays, 35 inputs, 64 units, tables in 16 bits) on an H100: a walk to a ball with bumps asks for
// 17 distances in 3.1 rounds of 8 points, so 1.5 times as many are worked out. A round is 2,400 instructions of a warp (800 in
// the grid, 840 in W x, 560 in softplus), the walk over its results 150 a distance: 10,000 a ray, 29 million in all, 31 us if
// each scheduler issues one a cycle. Shared memory moves 2,200 times 128 bytes a ray, 27 us. The grid's gathers are
// 25 x 16 x 8 x 4 = 13 kB a ray, 37 MB in all, up to 300 MB in sectors of 32 bytes, 54 us from the L2 cache. The longest rays,
// 72 distances in 10 rounds, take about 60 us. So 60 to 120 us are to be expected. It never ran on a GPU; with a thread a ray it
// took 2.57 ms.
template <class T, int F, class S>
__global__ void __launch_bounds__(kWalkThreads)
    walk_kernel(int64_t n_rays, const HashGridView<T, S> grid, const SdfLayer<T> given, bool copies,
                const MarchOptions march, const OccupancyView cells, const SampleRules<T> rules, const T* rays_o,
                const T* rays_d, const T* jitter, int64_t most, T* starts, int64_t* counts, int64_t* evaluated) {
  SPLITNERF_DYNAMIC_SHARED(memory);
  T* const numbers = reinterpret_cast<T*>(memory);
  const SdfLayer<T> layer = copies ? in_shared_memory(given, numbers) : given;
  const int number = threadIdx.x / Warp::size;
  const int64_t r = int64_t(blockIdx.x) * kWalkWarps + number;
  if (r >= n_rays) return;
  const SdfTile<T> tile{numbers + (copies ? distance_weights(layer) : 0) + number * walk_tile_size(layer), kWalkPoints,
                        static_cast<int>(layer.n_inputs), static_cast<int>(layer.n_outputs)};
  const RayLattice<T> lattice(load3(rays_o + 3 * r), load3(rays_d + 3 * r), jitter[r], march);
  const Warp warp;
  int64_t n = 0;
  const int64_t asked = walk_ray<F>(warp, grid, layer, tile, lattice, cells, march, rules, [&](T start) {
    if (n >= most) return;
    if (warp.lane() == 0) starts[r * most + n] = start;
    ++n;
  });
  if (warp.lane() == 0) counts[r] = n, evaluated[r] = asked;
}

template <class T>
__global__ void layer_kernel(int64_t n, const SdfLayer<T> layer, const T* positions, const T* features,
                             const T* jacobian, T* outputs, T* gradient) {
  const SdfTile<T> tile = shared_tile(layer);
  const int64_t first = int64_t(blockIdx.x) * blockDim.x, i = first + threadIdx.x;
  const int here = static_cast<int>(min_of<int64_t>(blockDim.x, n - first)), p = threadIdx.x;
  load_inputs(tile, positions, features, first, here);
  __syncthreads();
  sdf_forward<true>(layer, tile, p);
  if (i < n) store3(gradient + 3 * i, sdf_gradient(layer, tile, p, jacobian + 3 * i * (tile.n_inputs - 3)));
  __syncthreads();
  for (int k = threadIdx.x; k < here * tile.n_outputs; k += blockDim.x)
    outputs[first * tile.n_outputs + k] = tile.output(k % tile.n_outputs, k / tile.n_outputs);
}

// sums [blocks, sdf_weight_count]: each block's sums over its tiles.
template <class T>
__global__ void layer_backward_kernel(int64_t n, const SdfLayer<T> layer, const T* positions, const T* features,
                                      const T* jacobian, const T* grad_outputs, const T* grad_gradient,
                                      T* grad_features, T* grad_jacobian, T* sums) {
  const SdfTile<T> tile = shared_tile(layer);
  const int p = threadIdx.x, points = blockDim.x, n_features = tile.n_inputs - 3;
  const int rows = sdf_weight_rows(layer), width = static_cast<int>(layer.width_columns);
  T* mine = sums + blockIdx.x * sdf_weight_count(layer);
  for (int64_t first = int64_t(blockIdx.x) * points; first < n; first += int64_t(gridDim.x) * points) {
    const int64_t i = first + p;
    const int here = static_cast<int>(min_of<int64_t>(points, n - first));
    load_inputs(tile, positions, features, first, here);
    __syncthreads();
    sdf_forward<false>(layer, tile, p);
    load_rows(grad_outputs, first, here, tile.n_outputs, [&](int q, int m) -> T& { return tile.output(m, q); });
    if (i < n) {
      sdf_gradient_backward(layer, tile, p, jacobian + 3 * i * n_features, load3(grad_gradient + 3 * i),
                            grad_jacobian + 3 * i * n_features);
    } else {
      for (int k = 0; k < tile.n_inputs; ++k) tile.grad_steepness(k, p) = T(0);
    }
    for (int k = 0; k < tile.n_inputs; ++k) tile.steepness(k, p) = T(0);
    __syncthreads();
    for (int unit = 0; unit < width; unit += kSdfUnits) {
      sdf_units_backward(layer, tile, unit, p);
      __syncthreads();
      for (int k = threadIdx.x; k < rows * kSdfUnits; k += points)
        mine[(k / kSdfUnits) * width + unit + k % kSdfUnits] +=
            sdf_weight_sum(tile, here, k / kSdfUnits, k % kSdfUnits);
      __syncthreads();
    }
    for (int m = threadIdx.x; m < tile.n_outputs; m += points) mine[rows * width + m] += sdf_bias_sum(tile, here, m);
    for (int k = threadIdx.x; k < here * n_features; k += points)
      grad_features[first * n_features + k] = tile.steepness(3 + k % n_features, k / n_features);
    __syncthreads();
  }
}

// The blocks' sums, added in order, to the gradients in the weights' own shapes; one call for each number of the list.
template <class T> struct FinishBody {
  SdfLayer<T> layer;
  int n_sums;
  const T* sums;
  T *grad_hidden, *grad_hidden_bias, *grad_out, *grad_out_bias;

  SPLITNERF_HD void operator()(int64_t i) const {
    const int64_t row = i / layer.width_columns, h = i % layer.width_columns, m = row - layer.n_inputs - 1;
    const int64_t bias = i - sdf_weight_rows(layer) * layer.width_columns;
    if (bias < 0 && h >= layer.width) return;
    T total = T(0);
    for (int k = 0; k < n_sums; ++k) total += sums[k * sdf_weight_count(layer) + i];
    if (bias >= 0) {
      grad_out_bias[bias] = total;
    } else if (row < layer.n_inputs) {
      grad_hidden[h * layer.n_inputs + row] = total;
    } else if (m < 0) {
      grad_hidden_bias[h] = total;
    } else {
      grad_out[m * layer.width + h] = total;
    }
  }
};

template <class T, class S> HashGridView<T, S> field_grid(const SdfField<T>& field, const S* table) {
  return make_view<T>(field.shape, field.n_active, nullptr, table);
}

// The number of points of a tile with this number of rows, and its shared memory, which the kernel is set to allow.
struct TileSize {
  int points, bytes;
};
template <class T, class Kernel> TileSize tile_size(const char* op, int rows, Kernel kernel) {
  const int most = most_shared_memory(op);
  for (const int points : kPointChoices) {
    const int64_t bytes = int64_t{rows} * (points + 1) * int64_t{sizeof(T)};
    if (bytes > most) continue;
    allow_shared_memory(op, kernel, bytes);
    return {points, static_cast<int>(bytes)};
  }
  throw std::invalid_argument(std::string(op) + ": features and outputs are too many for this GPU's shared memory");
}

}  // namespace

template <class T>
void sdf_values(const Queue& queue, const SdfField<T>& field, int64_t n, const T* positions, T* values) {
  const char* op = "sdf_values";
  if (n == 0) return;
  const SdfLayer<T> layer = prepare(queue, op, field.weights);
  with_features(field.shape.n_features, [&](auto count) {
    field.table.template read_as<T>([&](auto* table) {
      const auto kernel = values_kernel<T, decltype(count)::n, Pointee<decltype(table)>>;
      const TileSize tile = tile_size<T>(op, field.weights.n_inputs, kernel);
      launch(queue, op, kernel, blocks_for(n, tile.points), tile.points, tile.bytes, n, field_grid(field, table), layer,
             positions, values);
    });
  });
}

template <class T>
void sample_rays(const Queue& queue, const SdfField<T>& field, const MarchOptions& march, const OccupancyView& cells,
                 const SampleRules<T>& rules, int64_t n_rays, const T* rays_o, const T* rays_d, const T* jitter,
                 int64_t room, int64_t* offsets, int64_t* n_evaluated, int64_t* n_found,
                 const SampleAllocator<T>& allocate) {
  const char* op = "sample_rays";
  const SdfLayer<T> layer = prepare(queue, op, field.weights);
  const int64_t most = most_samples<T>(march);
  T* starts = queue.scratch<T>(n_rays * most);
  int64_t* all = queue.scratch<int64_t>(n_rays + 1);
  const bool copies = distance_weights(layer) * sizeof(T) <= kMostCopied;
  const size_t bytes = sizeof(T) * (kWalkWarps * walk_tile_size(layer) + (copies ? distance_weights(layer) : 0));
  if (n_rays > 0) {
    with_features(field.shape.n_features, [&](auto count) {
      field.table.template read_as<T>([&](auto* table) {
        const auto kernel = walk_kernel<T, decltype(count)::n, Pointee<decltype(table)>>;
        allow_shared_memory(op, kernel, bytes);
        launch(queue, op, kernel, blocks_for(n_rays, kWalkWarps), kWalkThreads, bytes, n_rays, field_grid(field, table),
               layer, copies, march, cells, rules, rays_o, rays_d, jitter, most, starts, all + 1, n_evaluated);
      });
    });
  }
  sum_counts(queue, op, n_rays, all);
  const int64_t rows = room > 0 ? room : read_number(queue, all + n_rays);
  for_each(queue, op, n_rays + 1, FitOffsetsBody{n_rays, rows, all, offsets, n_found});
  const PackedSamples<T> to = allocate(rows);
  for_each_group(queue, op, n_rays, PackSamplesBody<T>{most, T(march.step), starts, offsets, to});
  if (room > 0) for_each(queue, op, room, PadSamplesBody<T>{offsets + n_rays, to});
}

template <class T>
void sdf_layer(const Queue& queue, const SdfWeights<T>& weights, int64_t n, const T* positions, const T* features,
               const T* jacobian, T* outputs, T* gradient) {
  const char* op = "sdf_layer";
  if (n == 0) return;
  const SdfLayer<T> layer = prepare(queue, op, weights);
  const auto kernel = layer_kernel<T>;
  const TileSize tile = tile_size<T>(op, SdfTile<T>::forward_rows(weights.n_inputs, weights.n_outputs), kernel);
  launch(queue, op, kernel, blocks_for(n, tile.points), tile.points, tile.bytes, n, layer, positions, features,
         jacobian, outputs, gradient);
}

template <class T>
void sdf_layer_backward(const Queue& queue, const SdfWeights<T>& weights, int64_t n, const T* positions,
                        const T* features, const T* jacobian, const T* grad_outputs, const T* grad_gradient,
                        T* grad_features, T* grad_jacobian, T* grad_hidden, T* grad_hidden_bias, T* grad_out,
                        T* grad_out_bias) {
  const char* op = "sdf_layer_backward";
  const SdfLayer<T> layer = prepare(queue, op, weights);
  const auto kernel = layer_backward_kernel<T>;
  const TileSize tile = tile_size<T>(op, SdfTile<T>::backward_rows(weights.n_inputs, weights.n_outputs), kernel);
  const int n_sums = static_cast<int>(std::min<int64_t>((n + tile.points - 1) / tile.points, kMostSums));
  T* sums = queue.scratch<T>(std::max(n_sums, 1) * sdf_weight_count(layer));
  clear(queue, op, sums, n_sums * sdf_weight_count(layer));
  if (n_sums > 0)
    launch(queue, op, kernel, n_sums, tile.points, tile.bytes, n, layer, positions, features, jacobian, grad_outputs,
           grad_gradient, grad_features, grad_jacobian, sums);
  for_each(queue, op, sdf_weight_count(layer),
           FinishBody<T>{layer, n_sums, sums, grad_hidden, grad_hidden_bias, grad_out, grad_out_bias});
}

#define SPLITNERF_INSTANTIATE(T)                                                                                 \
  template void sdf_values<T>(const Queue&, const SdfField<T>&, int64_t, const T*, T*);                          \
  template void sample_rays<T>(const Queue&, const SdfField<T>&, const MarchOptions&, const OccupancyView&,      \
                               const SampleRules<T>&, int64_t, const T*, const T*, const T*, int64_t, int64_t*,  \
                               int64_t*, int64_t*, const SampleAllocator<T>&);                                   \
  template void sdf_layer<T>(const Queue&, const SdfWeights<T>&, int64_t, const T*, const T*, const T*, T*, T*); \
  template void sdf_layer_backward<T>(const Queue&, const SdfWeights<T>&, int64_t, const T*, const T*, const T*, \
                                      const T*, const T*, T*, T*, T*, T*, T*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cuda
