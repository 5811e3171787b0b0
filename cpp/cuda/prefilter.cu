#include "launch.cuh"
#include "splitnerf/ops_cuda.h"
#include "splitnerf/bodies/prefilter.h"

namespace splitnerf::cuda {
namespace {

constexpr int kTile = 128;  // threads of a block, and sources read together
constexpr int kItems = 2;   // of a thread, so that a source once read serves twice

// make(i) is item i; keep(part, i, item) takes it when it has met all sources of the part.
template <class T, class Sources, class Make, class Keep>
__device__ void meet_sources(int64_t n_items, int n_parts, const Sources& sources, const Make& make, const Keep& keep) {
  SPLITNERF_SHARED(LobeSource<T>, tile, [kTile]);
  const int64_t mine = int64_t(blockIdx.x) * kTile * kItems + threadIdx.x;
  decltype(make(0)) items[kItems];
  for (int k = 0; k < kItems; ++k) items[k] = make(min_of<int64_t>(mine + k * kTile, n_items - 1));
  const int part = blockIdx.y;
  const int64_t end = part_begin(sources.n, part + 1, n_parts);
  for (int64_t first = part_begin(sources.n, part, n_parts); first < end; first += kTile) {
    if (first + threadIdx.x < end) tile[threadIdx.x] = sources(first + threadIdx.x);
    __syncthreads();
    const int n = static_cast<int>(min_of<int64_t>(kTile, end - first));
    for (int j = 0; j < n; ++j) {
      const LobeSource<T> source = tile[j];
      for (int k = 0; k < kItems; ++k) items[k].add(source);
    }
    __syncthreads();
  }
  for (int k = 0; k < kItems; ++k)
    if (mine + k * kTile < n_items) keep(part, mine + k * kTile, items[k]);
}

// parts [n_parts, n queries, 4]
template <class T>
__global__ void __launch_bounds__(kTile)
    gather_kernel(const QueryList<T> queries, const LightList<T> lights, int n_parts, T* parts) {
  meet_sources<T>(
      queries.n, n_parts, lights,
      [&](int64_t i) { return LobeGather<T>{load3(queries.directions + 3 * i), queries.alpha_squared(i)}; },
      [&](int part, int64_t i, const LobeGather<T>& item) {
        T* to = parts + 4 * (part * queries.n + i);
        store3(to, item.value);
        to[3] = item.total;
      });
}

// parts [n_parts, n lights, 3]
template <class T>
__global__ void __launch_bounds__(kTile)
    scatter_kernel(const LightList<T> lights, const QueryList<T> queries, int n_parts, T* parts) {
  meet_sources<T>(
      lights.n, n_parts, queries, [&](int64_t i) { return LobeScatter<T>{load3(lights.directions + 3 * i)}; },
      [&](int part, int64_t i, const LobeScatter<T>& item) { store3(parts + 3 * (part * lights.n + i), item.value); });
}

dim3 grid_for(int64_t n_items, int n_parts) {
  return dim3(blocks_for(n_items, kTile * kItems), static_cast<unsigned>(n_parts));
}

}  // namespace

template <class T>
void prefilter_light(const Queue& queue, int64_t n_queries, const T* query_dirs, const T* roughness, int64_t n_lights,
                     const T* light_dirs, const T* light, T* gbar, T* total) {
  const char* op = "prefilter_light";
  if (n_queries == 0) return;
  const int n_parts = lobe_parts(n_queries, n_lights);
  T* parts = queue.scratch<T>(4 * n_parts * n_queries);
  const QueryList<T> queries{n_queries, query_dirs, roughness, nullptr, nullptr};
  const LightList<T> lights{n_lights, light_dirs, light};
  launch(queue, op, gather_kernel<T>, grid_for(n_queries, n_parts), kTile, 0, queries, lights, n_parts, parts);
  for_each(queue, op, n_queries, GatherFinishBody<T>{n_queries, n_parts, parts, gbar, total});
}

template <class T>
void prefilter_light_backward(const Queue& queue, int64_t n_queries, const T* query_dirs, const T* roughness,
                              const T* total, const T* grad_gbar, int64_t n_lights, const T* light_dirs,
                              T* grad_light) {
  const char* op = "prefilter_light_backward";
  if (n_lights == 0) return;
  const int n_parts = lobe_parts(n_lights, n_queries);
  T* parts = queue.scratch<T>(3 * n_parts * n_lights);
  const LightList<T> lights{n_lights, light_dirs, nullptr};
  const QueryList<T> queries{n_queries, query_dirs, roughness, total, grad_gbar};
  launch(queue, op, scatter_kernel<T>, grid_for(n_lights, n_parts), kTile, 0, lights, queries, n_parts, parts);
  for_each(queue, op, n_lights, ScatterFinishBody<T>{n_lights, n_parts, parts, grad_light});
}

#define SPLITNERF_INSTANTIATE(T)                                                                                    \
  template void prefilter_light<T>(const Queue&, int64_t, const T*, const T*, int64_t, const T*, const T*, T*, T*); \
  template void prefilter_light_backward<T>(const Queue&, int64_t, const T*, const T*, const T*, const T*, int64_t, \
                                            const T*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cuda
