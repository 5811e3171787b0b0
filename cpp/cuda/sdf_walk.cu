// The distance alone, at points and along rays.
#include "sdf_prepare.cuh"
#include "tile_size.cuh"
#include "splitnerf/ops_cuda.h"
#include "splitnerf/bodies/rays.h"
#include "splitnerf/bodies/sdf_layer.h"
#include "splitnerf/features.h"

namespace splitnerf::cuda {
namespace {

constexpr int kWalkThreads = 128;  // threads of a block that walks along rays
constexpr int kWalkWarps = kWalkThreads / Warp::size, kWalkPoints = Warp::size / kWalkLanes;
constexpr int kMostCopied = 40 * 1024;  // bytes of weights that it copies: with more, too few blocks share a processor

// ---- the weights of a distance ----

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
  return {reinterpret_cast<T*>(memory), static_cast<int>(blockDim.x) + 1, static_cast<int>(layer.n_inputs)};
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
                        static_cast<int>(layer.n_inputs)};
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

template <class T, class S> HashGridView<T, S> field_grid(const SdfField<T>& field, const S* table) {
  return make_view<T>(field.shape, field.n_active, nullptr, table);
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
      const TileSize tile = tile_size<T>(op, field.weights.n_inputs, kernel, "features are too many");
      launch(queue, op, kernel, blocks_for(n, tile.points), tile.points, tile.bytes, n, field_grid(field, table), layer,
             positions, values);
    });
  });
}

template <class T>
void sample_rays(const Queue& queue, const SdfField<T>& field, const MarchOptions& march, const OccupancyView& cells,
                 const SampleRules<T>& rules, int64_t n_rays, const T* rays_o, const T* rays_d, const T* jitter,
                 int64_t capacity, int64_t* offsets, int64_t* n_evaluated, int64_t* n_found,
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
  const int64_t rows = capacity > 0 ? capacity : read_number(queue, all + n_rays);
  for_each(queue, op, n_rays + 1, FitOffsetsBody{n_rays, rows, all, offsets, n_found});
  const PackedSamples<T> to = allocate(rows);
  for_each_group(queue, op, n_rays, PackSamplesBody<T>{most, T(march.step), starts, offsets, to});
  if (capacity > 0) for_each(queue, op, capacity, PadSamplesBody<T>{offsets + n_rays, to});
}

#define SPLITNERF_INSTANTIATE(T)                                                                                \
  template void sdf_values<T>(const Queue&, const SdfField<T>&, int64_t, const T*, T*);                         \
  template void sample_rays<T>(const Queue&, const SdfField<T>&, const MarchOptions&, const OccupancyView&,     \
                               const SampleRules<T>&, int64_t, const T*, const T*, const T*, int64_t, int64_t*, \
                               int64_t*, int64_t*, const SampleAllocator<T>&);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cuda
