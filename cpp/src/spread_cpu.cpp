// spread_samples in one pass over the rays, beside the counts and the fills of the bodies one after the other, which
// weigh each ray twice: 1.6 x (1024 rays of 24 samples; float32, one thread of an AMD EPYC of family 25).
#include <algorithm>
#include <vector>

#include "splitnerf/bodies/rays.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf::cpu {

template <class T>
void spread_samples(const SpreadArrays<T>& in, int64_t* sizes, int64_t* first, int64_t* second, T* share,
                    const SpreadAllocator& allocator) {
  const PackedRays& rays = in.rays;
  const T gap = in.gap_length();
  std::vector<int64_t> shaded, heaviest, leaders, stretch;
  for (int64_t r = 0; r < rays.n_rays; ++r) {
    const int64_t begin = rays.offsets[r], end = rays.offsets[r + 1], at = static_cast<int64_t>(shaded.size());
    in.draw(r, [&](int64_t i) { shaded.push_back(begin + i); });
    const int64_t drawn = static_cast<int64_t>(shaded.size()) - at;
    if (drawn == 0) continue;
    const SpreadRay<T> ray{in.weights, in.t, begin, end, shaded.data(), at, drawn};
    const auto n_before = static_cast<int64_t>(leaders.size());
    leaders.resize(n_before + drawn), stretch.resize(shaded.size());
    const int64_t n_stretches =
        arrange_spread(ray, gap, n_before, first, second, share, leaders.data() + n_before, stretch.data());
    leaders.resize(n_before + n_stretches);
    heaviest.push_back(heaviest_drawn(ray));
  }
  const SpreadSizes counted{static_cast<int64_t>(shaded.size()), static_cast<int64_t>(heaviest.size()),
                            static_cast<int64_t>(leaders.size())};
  sizes[0] = counted.shaded, sizes[1] = counted.heaviest, sizes[2] = counted.leaders;
  const Spread to = allocator.allocate(allocator.fixed ? *allocator.fixed : counted);
  const bool fits = to.has_room(counted.shaded, counted.leaders);
  const SpreadUnusedBody<T> unused{
      rays.n_samples, rays.n_owned(), fits ? rays.n_owned() : 0, fits ? counted : SpreadSizes{}, to, first,
      second,         share};
  if (allocator.fixed || rays.n_owned() < rays.n_samples)
    for (int64_t i = 0; i < unused.count(); ++i) unused(i);
  if (!fits) return;
  std::copy(shaded.begin(), shaded.end(), to.shaded), std::copy(stretch.begin(), stretch.end(), to.stretch);
  std::copy(heaviest.begin(), heaviest.end(), to.heaviest), std::copy(leaders.begin(), leaders.end(), to.leaders);
}

template void spread_samples<float>(const SpreadArrays<float>&, int64_t*, int64_t*, int64_t*, float*,
                                    const SpreadAllocator&);
template void spread_samples<double>(const SpreadArrays<double>&, int64_t*, int64_t*, int64_t*, double*,
                                     const SpreadAllocator&);

}  // namespace splitnerf::cpu
