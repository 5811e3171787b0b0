// One launcher for the bodies of splitnerf/bodies/. A body is a struct with its arguments as members and one call operator; its
// signature says what calls it:
//
//   body(i)         one thread for each index
//   body(group, i)  a group of threads for each index, see group.h
//   body(i, sums)   one thread for each index; sums [n_sums] are added up over all of them, then body.finish(sums) is called once
//
// cpu::run(n, body) runs it here on the thread pool, cuda::run (ops_cuda.h) on the GPU.
#pragma once

#include <type_traits>

#include "splitnerf/group.h"
#include "splitnerf/parallel.h"

namespace splitnerf {

template <class Body> inline constexpr bool is_single = std::is_invocable_v<const Body&, int64_t>;
template <class Body> inline constexpr bool is_sum = std::is_invocable_v<const Body&, int64_t, double*>;

// A body with a member `static constexpr bool adds_to_shared = true` adds to numbers that other indices add to as well:
// atomically on the GPU, one index after the other on the CPU.
template <class Body, class = void> inline constexpr bool is_in_order = false;
template <class Body>
inline constexpr bool is_in_order<Body, std::void_t<decltype(Body::adds_to_shared)>> = Body::adds_to_shared;

namespace cpu {

// Sums have the same bits each time: they are added up one after the other.
template <class Body> void run(int64_t n, const Body& body) {
  constexpr int64_t kSingleGrain = 1024, kGroupGrain = 32;  // indices of a task
  if constexpr (is_sum<Body>) {
    double sums[Body::n_sums] = {};
    for (int64_t i = 0; i < n; ++i) body(i, sums);
    body.finish(sums);
  } else if constexpr (is_in_order<Body>) {
    for (int64_t i = 0; i < n; ++i) body(i);
  } else if constexpr (is_single<Body>) {
    parallel_for(n, kSingleGrain, [&](int64_t begin, int64_t end) {
      for (int64_t i = begin; i < end; ++i) body(i);
    });
  } else {
    parallel_for(n, kGroupGrain, [&](int64_t begin, int64_t end) {
      for (int64_t i = begin; i < end; ++i) body(OneThread{}, i);
    });
  }
}

}  // namespace cpu
}  // namespace splitnerf
