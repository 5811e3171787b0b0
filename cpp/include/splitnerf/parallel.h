// parallel_for over index ranges. The torch operators hand in torch's own thread pool, so that
// one process never runs two pools that compete for the same cores.
#pragma once

#include <cstdint>
#include <type_traits>

#include "splitnerf/config.h"

namespace splitnerf {

using RangeBody = void (*)(int64_t begin, int64_t end, void* context);
using ParallelBackend = void (*)(int64_t n, int64_t grain, RangeBody body, void* context);

// Replaces the pool (the default one starts std::threads); null restores the default.
SPLITNERF_API void set_parallel_backend(ParallelBackend backend);
SPLITNERF_API void parallel_ranges(int64_t n, int64_t grain, RangeBody body, void* context);

// Calls body(begin, end) on disjoint ranges that cover [0, n), each of about `grain` items or
// more. Exceptions thrown by the body reach the caller.
template <class Body> void parallel_for(int64_t n, int64_t grain, Body&& body) {
  using Plain = std::remove_reference_t<Body>;
  parallel_ranges(
      n, grain, [](int64_t begin, int64_t end, void* context) { (*static_cast<Plain*>(context))(begin, end); },
      const_cast<void*>(static_cast<const void*>(&body)));
}

}  // namespace splitnerf
