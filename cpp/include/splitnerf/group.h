// Threads that work on one item together: a warp on the GPU, one thread on the CPU. Code over a Group is written once; the
// collective calls are made by all of its threads.
#pragma once

#include <cstdint>

#include "splitnerf/vec.h"

namespace splitnerf {

// A group of one: every collective call is the identity.
struct OneThread {
  static constexpr int size = 1;

  SPLITNERF_HD int lane() const { return 0; }
  // Sum of all threads' values.
  template <class T> SPLITNERF_HD T sum(T value) const { return value; }
  // Sum of the values of the threads before this one.
  template <class T> SPLITNERF_HD T sum_before(T) const { return T(0); }
  // Sum over each run of N neighbouring threads, for all of them; N is a power of two.
  template <int N, class T> SPLITNERF_HD T sum_of_run(T value) const {
    static_assert(N == 1);
    return value;
  }
  // The value of the thread that each names; of the last one; the least of all.
  template <class T> SPLITNERF_HD T from(int, T value) const { return value; }
  template <class T> SPLITNERF_HD T last(T value) const { return value; }
  template <class T> SPLITNERF_HD T least(T value) const { return value; }
  // Bit i: whether thread i says so.
  SPLITNERF_HD uint32_t ballot(bool yes) const { return yes ? 1u : 0u; }
  // What one thread wrote before, another may read afterwards.
  SPLITNERF_HD void sync() const {}
};

template <class T, class Group> SPLITNERF_HD Vec3<T> sum3(const Group& group, Vec3<T> v) {
  return {group.sum(v.x), group.sum(v.y), group.sum(v.z)};
}

// Bits of a word that are set.
SPLITNERF_HD int count_bits(uint32_t word) {
#if defined(__CUDA_ARCH__)
  return __popc(word);
#elif defined(__GNUC__)
  return __builtin_popcount(word);
#else
  int n = 0;
  for (; word; word &= word - 1) ++n;
  return n;
#endif
}

// Index of the lowest bit of a word that is not 0.
SPLITNERF_HD int lowest_bit(uint32_t word) {
#if defined(__CUDA_ARCH__)
  return __ffs(int(word)) - 1;
#elif defined(__GNUC__)
  return __builtin_ctz(word);
#else
  int i = 0;
  while (!(word >> i & 1u)) ++i;
  return i;
#endif
}

}  // namespace splitnerf
