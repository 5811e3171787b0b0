#include "launch.cuh"
#include "splitnerf/ops_cuda.h"
#include "splitnerf/bodies/rays.h"

namespace splitnerf::cuda {

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

template void spread_samples<float>(const Queue&, const PackedRays&, const float*, const float*, const float*, float,
                                    int, int64_t*, int64_t*, int64_t*, float*, const SpreadAllocator&);
template void spread_samples<double>(const Queue&, const PackedRays&, const double*, const double*, const double*,
                                     double, int, int64_t*, int64_t*, int64_t*, double*, const SpreadAllocator&);

}  // namespace splitnerf::cuda
