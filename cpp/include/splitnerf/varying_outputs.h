// Outputs whose sizes are known only while the operator runs: it calls back to allocate them.
#pragma once

#include <cstdint>
#include <functional>

#include "splitnerf/config.h"

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
  int64_t* shaded;       // [shaded] samples, ascending
  int64_t* heaviest;     // [rays with samples] positions in `shaded`: the largest weight of those
  int64_t* leaders;      // [stretches] positions in `shaded`: the largest weight of each
  int64_t* stretch;      // [shaded] the stretch of each
  SpreadSizes capacity;  // of these arrays

  // Capacity for shaded samples and for segments; the number of rays with samples is at most the number of rays.
  SPLITNERF_HD bool has_room(int64_t n_shaded, int64_t n_stretches) const {
    return n_shaded <= capacity.shaded && n_stretches <= capacity.leaders;
  }
};

// Allocates the outputs for the counted sizes or, where `fixed` is set, for these fixed sizes.
struct SpreadAllocator {
  std::function<Spread(const SpreadSizes& sizes)> allocate;
  const SpreadSizes* fixed = nullptr;
};

}  // namespace splitnerf
