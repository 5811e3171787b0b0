#include "launch.cuh"
#include "splitnerf/ops_cuda.h"
#include "splitnerf/bodies/rays.h"

namespace splitnerf::cuda {

template <class T>
void spread_samples(const Queue& queue, const SpreadArrays<T>& in, int64_t* sizes, int64_t* first, int64_t* second,
                    T* share, const SpreadAllocator& allocator) {
  const char* op = "spread_samples";
  const int64_t n = in.rays.n_rays;
  auto* sums = queue.scratch<int64_t>(3 * (n + 1));
  for_each(queue, op, n, SpreadCountBody<T>{in, sums + 1});
  sum_counts(queue, op, n, sums, 3, sizes);
  int64_t counted[3];
  if (!allocator.fixed) read_numbers(queue, 3, sizes, counted);
  const Spread to =
      allocator.allocate(allocator.fixed ? *allocator.fixed : SpreadSizes{counted[0], counted[1], counted[2]});
  const SpreadFillBody<T> fill{in, sums, to, first, second, share};
  for_each(queue, op, fill.count(), fill);
}

template void spread_samples<float>(const Queue&, const SpreadArrays<float>&, int64_t*, int64_t*, int64_t*, float*,
                                    const SpreadAllocator&);
template void spread_samples<double>(const Queue&, const SpreadArrays<double>&, int64_t*, int64_t*, int64_t*, double*,
                                     const SpreadAllocator&);

}  // namespace splitnerf::cuda
