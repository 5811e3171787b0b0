// Outputs whose sizes an operator finds out on the way: it calls back for room.
#pragma once

#include <cstdint>
#include <functional>

namespace splitnerf {

// Samples of all rays in one array, ray after ray: [n] each.
template <class T> struct PackedSamples {
  int64_t* ray_indices;
  T *t_starts, *t_ends;
};
template <class T> using SampleAllocator = std::function<PackedSamples<T>(int64_t n)>;

struct SpreadSizes {
  int64_t shaded, heaviest, leaders;
};
struct Spread {
  int64_t* shaded;    // [shaded] samples, ascending
  int64_t* heaviest;  // [rays with samples] positions in `shaded`: the largest weight of those
  int64_t* leaders;   // [stretches] positions in `shaded`: the largest weight of each
  int64_t* stretch;   // [shaded] the stretch of each
};
using SpreadAllocator = std::function<Spread(const SpreadSizes& sizes)>;

}  // namespace splitnerf
