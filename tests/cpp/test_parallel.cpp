// parallel_for: every index once, exceptions reach the caller, and the pool can be replaced.
#include "splitnerf/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <thread>
#include <vector>

namespace splitnerf {
namespace {

// Runs a loop over n indices, which gets the body, and expects each index once, in parts of at most `most`.
template <typename Loop> void expect_each_once(int64_t n, int64_t most, Loop loop) {
  std::vector<std::atomic<int>> visits(n);
  loop([&](int64_t begin, int64_t end) {
    ASSERT_TRUE(0 <= begin && begin < end && end <= n && end - begin <= most);
    for (int64_t i = begin; i < end; ++i) ++visits[i];
  });
  for (int64_t i = 0; i < n; ++i) ASSERT_EQ(visits[i], 1) << i << " of " << n;
}

TEST(Parallel, VisitsEveryIndexOnce) {
  for (const int64_t n : {0, 1, 7, 64, 1000, 100003}) {
    for (const int64_t grain : {0, 1, 64, 200000})
      expect_each_once(n, n, [&](auto body) { parallel_for(n, grain, body); });
    expect_each_once(n, 64, [&](auto body) { parallel_for_uneven(n, 64, body); });
  }
}

TEST(Parallel, ExceptionsReachTheCaller) {
  const auto fail_at = [](int64_t bad) {
    parallel_for(10000, 16, [=](int64_t begin, int64_t end) {
      if (begin <= bad && bad < end) throw std::runtime_error("bad index");
    });
  };
  EXPECT_THROW(fail_at(0), std::runtime_error);
  EXPECT_THROW(fail_at(9999), std::runtime_error);
  EXPECT_NO_THROW(fail_at(10000));
}

TEST(Parallel, NoMoreUnevenWorkIsTakenAfterAnExceptionWhichKeepsItsType) {
  static const auto without_exceptions = [](int64_t n, int64_t, RangeBody body, void* context) {
    try {
      body(0, n, context);
    } catch (...) { throw "a pool that passes on no types"; }
  };
  std::atomic<int64_t> done{0};
  const auto fail_at_100 = [&] {
    parallel_for_uneven(2000, 1, [&](int64_t begin, int64_t) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));  // so that all threads are at work
      if (begin == 100) throw std::runtime_error("bad item");
      ++done;
    });
  };
  EXPECT_THROW(fail_at_100(), std::runtime_error);
  EXPECT_LT(done, 1000);
  set_parallel_backend(without_exceptions);
  EXPECT_THROW(fail_at_100(), std::runtime_error);
  set_parallel_backend(nullptr);
}

}  // namespace
}  // namespace splitnerf
