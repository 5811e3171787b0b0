// parallel_for over index ranges. The torch operators hand in torch's own thread pool, so that
// one process never runs two pools that compete for the same cores.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <exception>
#include <mutex>
#include <thread>
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

// The same for items of unequal cost: each thread takes the next `chunk` items when it has done its last ones, so that
// none waits for another. After an exception no thread takes more, and the caller gets the first one as it was thrown (a
// pool may turn what it passes on into another type).
template <class Body> void parallel_for_uneven(int64_t n, int64_t chunk, Body&& body) {
  std::atomic<int64_t> next{0};
  std::exception_ptr failure;
  std::once_flag failed;
  const int64_t n_threads = std::max<int64_t>(1, std::thread::hardware_concurrency());
  parallel_for(std::min(n_threads, (n + chunk - 1) / chunk), 1, [&](int64_t, int64_t) {
    try {
      for (int64_t begin; (begin = next.fetch_add(chunk)) < n;) body(begin, std::min(n, begin + chunk));
    } catch (...) {
      std::call_once(failed, [&] { failure = std::current_exception(); });
      next.store(n);
    }
  });
  if (failure) std::rethrow_exception(failure);
}

}  // namespace splitnerf
