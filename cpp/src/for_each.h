// Runs a body of cpp/include/splitnerf/bodies/ on the thread pool, index by index.
#pragma once

#include "splitnerf/group.h"
#include "splitnerf/parallel.h"

namespace splitnerf::cpu {

template <class Body> void for_each(int64_t n, int64_t grain, const Body& body) {
  parallel_for(n, grain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) body(i);
  });
}

// A body for groups of threads, by groups of one.
template <class Body> void for_each_alone(int64_t n, int64_t grain, const Body& body) {
  for_each(n, grain, [&](int64_t i) { body(OneThread{}, i); });
}

}  // namespace splitnerf::cpu
