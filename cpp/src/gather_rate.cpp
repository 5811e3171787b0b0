#include "splitnerf/gather_rate.h"

#include <mutex>

#include "splitnerf/parallel.h"

namespace splitnerf {
namespace {

constexpr int kLanes = 8;  // independent sums, so that loads need not wait for one another
constexpr int64_t kGrain = 1 << 16;

// A number without pattern for each i: neighbours must not meet the same cache line again soon.
uint32_t scattered(uint32_t i) {
  i *= 2654435769u;
  i = (i ^ i >> 15) * 2246822519u;
  return i ^ i >> 13;
}

}  // namespace

float random_gathers(const float* table, int log2_entries, int64_t n) {
  float total = 0;
  std::mutex mutex;
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    float sums[kLanes] = {};
    for (int64_t i = begin; i + kLanes <= end; i += kLanes)
      for (int k = 0; k < kLanes; ++k) {
        const float* entry =
            table + 2 * static_cast<int64_t>(scattered(static_cast<uint32_t>(i + k)) >> (32 - log2_entries));
        sums[k] += entry[0] + entry[1];
      }
    float sum = 0;
    for (float s : sums) sum += s;
    const std::lock_guard<std::mutex> lock(mutex);
    total += sum;
  });
  return total;
}

}  // namespace splitnerf
