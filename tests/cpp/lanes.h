// A warp on the CPU: as many threads as lanes, which meet at each collective call, so that code over a group of threads runs
// here as it will on the GPU.
#pragma once

#include <array>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <thread>
#include <vector>

#include "splitnerf/group.h"

namespace splitnerf {

// Where the lanes meet: all wait until the last one has come.
template <int N> class Meeting {
 public:
  void wait() {
    std::unique_lock<std::mutex> lock(mutex_);
    const int round = round_;
    if (++here_ == N) {
      here_ = 0;
      ++round_;
      all_here_.notify_all();
    } else {
      all_here_.wait(lock, [&] { return round_ != round; });
    }
  }
  std::array<std::array<char, 8>, N> slots;  // what each lane says

 private:
  std::mutex mutex_;
  std::condition_variable all_here_;
  int here_ = 0, round_ = 0;
};

template <int N> class Lanes {
 public:
  static constexpr int size = N;

  Lanes(Meeting<N>& meeting, int lane) : meeting_(meeting), lane_(lane) {}

  int lane() const { return lane_; }
  template <class T> T sum(T value) const { return sum_of(tell(value), N); }
  template <class T> T sum_before(T value) const { return sum_of(tell(value), lane_); }
  template <class T> T last(T value) const { return tell(value)[N - 1]; }
  uint32_t ballot(bool yes) const {
    const auto said = tell(yes);
    uint32_t bits = 0;
    for (int i = 0; i < N; ++i) bits |= uint32_t(said[i]) << i;
    return bits;
  }
  void sync() const { meeting_.wait(); }

 private:
  // All lanes' values, once each has told its own.
  template <class T> std::array<T, N> tell(T value) const {
    static_assert(sizeof(T) <= 8);
    std::memcpy(meeting_.slots[lane_].data(), &value, sizeof(T));
    meeting_.wait();
    std::array<T, N> values;
    for (int i = 0; i < N; ++i) std::memcpy(&values[i], meeting_.slots[i].data(), sizeof(T));
    meeting_.wait();
    return values;
  }
  template <class T> static T sum_of(const std::array<T, N>& values, int n) {
    T sum = T(0);
    for (int i = 0; i < n; ++i) sum += values[i];
    return sum;
  }

  Meeting<N>& meeting_;
  int lane_;
};

// body(group, i) for each index in turn, by one group of N lanes.
template <int N, class Body> void for_each_by_lanes(int64_t n, const Body& body) {
  Meeting<N> meeting;
  std::vector<std::thread> threads;
  for (int lane = 0; lane < N; ++lane)
    threads.emplace_back([&, lane] {
      const Lanes<N> group(meeting, lane);
      for (int64_t i = 0; i < n; ++i) {
        body(group, i);
        group.sync();
      }
    });
  for (auto& thread : threads) thread.join();
}

}  // namespace splitnerf
