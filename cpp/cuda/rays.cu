#include "splitnerf/bodies/rays.h"

#include "scan.cuh"
#include "warp.cuh"

namespace splitnerf::cuda {
namespace {

constexpr int kScanThreads = 1024;

// One block: there are no more rays than that.
__global__ void __launch_bounds__(kScanThreads) scan_kernel(int64_t n, int64_t* offsets) {
  constexpr int kWarps = kScanThreads / Warp::size;
  __shared__ int64_t totals[kWarps];
  const Warp warp;
  const int number = threadIdx.x / Warp::size;
  int64_t carried = 0;
  for (int64_t first = 0; first < n; first += kScanThreads) {
    const int64_t i = first + threadIdx.x, count = i < n ? offsets[i + 1] : 0;
    const int64_t before = warp.sum_before(count), total = warp.sum(count);
    if (warp.lane() == 0) totals[number] = total;
    __syncthreads();
    const int64_t of_warp = warp.lane() < kWarps ? totals[warp.lane()] : 0;
    const int64_t before_warp = warp.sum(warp.lane() < number ? of_warp : 0);
    if (i < n) offsets[i + 1] = carried + before_warp + before + count;
    carried += warp.sum(of_warp);
    __syncthreads();
  }
  if (threadIdx.x == 0) offsets[0] = 0;
}

}  // namespace

void sum_counts(const Queue& queue, const char* op, int64_t n, int64_t* offsets) {
  scan_kernel<<<1, kScanThreads, 0, queue.stream>>>(n, offsets);
  check(cudaGetLastError(), op);
}

void occupied_blocks(const Queue& queue, const uint8_t* cells, int resolution, uint8_t* blocks) {
  const int n_blocks = blocks_along(resolution);
  for_each_group(queue, "occupied_blocks", int64_t{n_blocks} * n_blocks * n_blocks,
                 OccupiedBlocksBody{cells, resolution, n_blocks, blocks});
}

template <class T>
void march_rays_count(const Queue& queue, const MarchOptions& options, const OccupancyView& grid, int64_t n_rays,
                      const T* rays_o, const T* rays_d, const T* jitter, int64_t* offsets) {
  for_each_group(queue, "march_rays", n_rays, MarchCountBody<T>{options, grid, rays_o, rays_d, jitter, offsets + 1});
  sum_counts(queue, "march_rays", n_rays, offsets);
}

template <class T>
void march_rays_fill(const Queue& queue, const MarchOptions& options, const OccupancyView& grid, int64_t n_rays,
                     const T* rays_o, const T* rays_d, const T* jitter, const int64_t* offsets, int64_t* ray_indices,
                     T* t_starts, T* t_ends) {
  for_each_group(queue, "march_rays", n_rays,
                 MarchFillBody<T>{options, grid, rays_o, rays_d, jitter, offsets, ray_indices, t_starts, t_ends});
}

template <class T>
void neus_weights(const Queue& queue, const PackedRays& rays, const T* f_prev, const T* f_next, const T* s,
                  T min_transmittance, T* weights, T* opacity) {
  for_each_group(queue, "neus_weights", rays.n_rays,
                 NeusWeightsBody<T>{rays, f_prev, f_next, s, min_transmittance, weights, opacity});
}

template <class T>
void neus_weights_backward(const Queue& queue, const PackedRays& rays, const T* f_prev, const T* f_next, const T* s,
                           T min_transmittance, const T* weights, const T* grad_weights, const T* grad_opacity,
                           T* grad_f_prev, T* grad_f_next, T* grad_s_rays) {
  for_each_group(queue, "neus_weights_backward", rays.n_rays,
                 NeusWeightsBackwardBody<T>{rays, f_prev, f_next, s, min_transmittance, weights, grad_weights,
                                            grad_opacity, grad_f_prev, grad_f_next, grad_s_rays});
}

template <class T>
void surface_weights(const Queue& queue, const SurfaceSamples<T>& samples, T* normals, T* weights, T* opacity) {
  for_each_group(queue, "surface_weights", samples.rays.n_rays,
                 SurfaceWeightsBody<T>{samples, normals, weights, opacity});
}

template <class T>
void surface_weights_backward(const Queue& queue, const SurfaceSamples<T>& samples, const T* weights,
                              const T* grad_normals, const T* grad_weights, const T* grad_opacity, T* grad_sdf,
                              T* grad_gradient, T* grad_s_rays) {
  for_each_group(queue, "surface_weights_backward", samples.rays.n_rays,
                 SurfaceWeightsBackwardBody<T>{samples, weights, grad_normals, grad_weights, grad_opacity, grad_sdf,
                                               grad_gradient, grad_s_rays});
}

template <class T>
void composite(const Queue& queue, const PackedRays& rays, int64_t n_channels, const T* weights, const T* values,
               T* sums) {
  for_each_group(queue, "composite", rays.n_rays, CompositeBody<T>{rays, n_channels, weights, values, sums});
}

template <class T>
void composite_backward(const Queue& queue, const PackedRays& rays, int64_t n_channels, const T* weights,
                        const T* values, const T* grad_sums, T* grad_weights, T* grad_values) {
  for_each_group(queue, "composite_backward", rays.n_rays,
                 CompositeBackwardBody<T>{rays, n_channels, weights, values, grad_sums, grad_weights, grad_values});
}

template <class T>
void spread_samples(const Queue& queue, const PackedRays& rays, const T* weights, const T* t, const T* phase, T gap,
                    int per_ray, int64_t* sizes, int64_t* first, int64_t* second, T* share,
                    const SpreadAllocator& allocator) {
  const char* op = "spread_samples";
  const int64_t n = rays.n_rays;
  int64_t *drawn = queue.scratch<int64_t>(n + 1), *stretches = queue.scratch<int64_t>(n + 1),
          *filled = queue.scratch<int64_t>(n + 1);
  for_each(queue, op, n,
           SpreadCountBody<T>{rays, weights, t, phase, gap, per_ray, drawn + 1, stretches + 1, filled + 1});
  for (int64_t* counts : {drawn, stretches, filled}) sum_counts(queue, op, n, counts);
  for_each(queue, op, 1, SpreadSizesBody{drawn + n, filled + n, stretches + n, sizes});
  const Spread to =
      allocator.allocate(allocator.fixed ? *allocator.fixed
                                         : SpreadSizes{read_number(queue, sizes), read_number(queue, sizes + 1),
                                                       read_number(queue, sizes + 2)});
  const SpreadUnusedBody<T> unused{rays, 0, to, first, second, share};
  for_each(queue, op, unused.count(), unused);
  for_each(
      queue, op, n,
      SpreadFillBody<T>{rays, weights, t, phase, gap, per_ray, drawn, stretches, filled, to, first, second, share});
}

template <class T>
void interpolate(const Queue& queue, int64_t n, int64_t m, int64_t n_channels, const int64_t* first,
                 const int64_t* second, const T* share, const T* values, T* interpolated) {
  for_each(queue, "interpolate", n * n_channels,
           InterpolateBody<T>{m, n_channels, first, second, share, values, interpolated});
}

template <class T>
void interpolate_backward(const Queue& queue, int64_t n, int64_t m, int64_t n_channels, const int64_t* first,
                          const int64_t* second, const T* share, const T* grad_interpolated, T* grad_values) {
  clear(queue, "interpolate_backward", grad_values, m * n_channels);
  for_each(queue, "interpolate_backward", n * n_channels,
           InterpolateBackwardBody<T>{m, n_channels, first, second, share, grad_interpolated, grad_values});
}

#define SPLITNERF_INSTANTIATE(T)                                                                                       \
  template void march_rays_count<T>(const Queue&, const MarchOptions&, const OccupancyView&, int64_t, const T*,        \
                                    const T*, const T*, int64_t*);                                                     \
  template void march_rays_fill<T>(const Queue&, const MarchOptions&, const OccupancyView&, int64_t, const T*,         \
                                   const T*, const T*, const int64_t*, int64_t*, T*, T*);                              \
  template void neus_weights<T>(const Queue&, const PackedRays&, const T*, const T*, const T*, T, T*, T*);             \
  template void neus_weights_backward<T>(const Queue&, const PackedRays&, const T*, const T*, const T*, T, const T*,   \
                                         const T*, const T*, T*, T*, T*);                                              \
  template void surface_weights<T>(const Queue&, const SurfaceSamples<T>&, T*, T*, T*);                                \
  template void surface_weights_backward<T>(const Queue&, const SurfaceSamples<T>&, const T*, const T*, const T*,      \
                                            const T*, T*, T*, T*);                                                     \
  template void composite<T>(const Queue&, const PackedRays&, int64_t, const T*, const T*, T*);                        \
  template void composite_backward<T>(const Queue&, const PackedRays&, int64_t, const T*, const T*, const T*, T*, T*); \
  template void spread_samples<T>(const Queue&, const PackedRays&, const T*, const T*, const T*, T, int, int64_t*,     \
                                  int64_t*, int64_t*, T*, const SpreadAllocator&);                                     \
  template void interpolate<T>(const Queue&, int64_t, int64_t, int64_t, const int64_t*, const int64_t*, const T*,      \
                               const T*, T*);                                                                          \
  template void interpolate_backward<T>(const Queue&, int64_t, int64_t, int64_t, const int64_t*, const int64_t*,       \
                                        const T*, const T*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cuda
