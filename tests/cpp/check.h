// What the tests of formulas share: seeded inputs, and arrays that should agree.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "splitnerf/vec.h"

namespace splitnerf {

class Random {
 public:
  explicit Random(uint32_t seed) : engine_(seed) {}
  double uniform(double lo = 0, double hi = 1) { return std::uniform_real_distribution<double>(lo, hi)(engine_); }
  double normal() { return std::normal_distribution<double>()(engine_); }
  int below(int n) { return std::uniform_int_distribution<int>(0, n - 1)(engine_); }
  template <class T = double> Vec3<T> direction() {
    const Vec3<double> d = normalize(Vec3<double>{normal(), normal(), normal()});
    return {T(d.x), T(d.y), T(d.z)};
  }
  template <class T = double> std::vector<T> uniforms(size_t n, double lo = 0, double hi = 1) {
    std::vector<T> out(n);
    for (T& x : out) x = T(uniform(lo, hi));
    return out;
  }
  template <class T = double> std::vector<T> directions(size_t n) {
    std::vector<T> out(3 * n);
    for (size_t i = 0; i < n; ++i) store3(&out[3 * i], direction<T>());
    return out;
  }

 private:
  std::mt19937 engine_;
};

// Equal up to a share of the largest expected number.
template <class T> void expect_near(const std::vector<T>& got, const std::vector<T>& expected, double tolerance) {
  ASSERT_EQ(got.size(), expected.size());
  double largest = 1e-30;
  for (T x : expected) largest = std::max(largest, std::abs(double(x)));
  for (size_t i = 0; i < got.size(); ++i) EXPECT_NEAR(got[i], expected[i], tolerance * largest) << i;
}

}  // namespace splitnerf
