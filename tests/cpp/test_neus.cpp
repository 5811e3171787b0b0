// Limits of NeuS weights, and NaN. Their values and how many digits they keep: tests/reference.py, tests/stability/rays.py.
#include "splitnerf/neus.h"

#include <limits>

#include "check.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf {
namespace {

using Wide = long double;

Wide wide_softplus(Wide x) { return (x > 0 ? x : 0) + std::log1p(std::exp(-std::abs(x))); }

// A wall of depth 25 deep inside, where the distances at its ends have lost the digits of their difference.
TEST(Neus, DepthFarBehindTheSurfaceIsTheDifference) {
  EXPECT_FLOAT_EQ(neus_optical_depth(-2e6f, -2e6f, 25.f, 1.f), 25.f);
  EXPECT_FLOAT_EQ(neus_optical_depth(-0.5f, -25.5f, 25.f, 1.f), 25.f - float(wide_softplus(-0.5)));
}

TEST(Neus, NothingWhereTheDistanceRises) {
  EXPECT_EQ(neus_optical_depth(0.1f, 0.1f, 0.f, 100.f), 0);
  EXPECT_EQ(neus_optical_depth(-0.1f, 0.2f, -0.3f, 100.f), 0);
  EXPECT_EQ(neus_optical_depth(-1e6f, 1e6f, -2e6f, 1e6f), 0);
  const float kNan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_TRUE(std::isnan(neus_optical_depth(kNan, 0.f, kNan, 1.f)));
}

// Samples given by the distances at their ends.
template <class T> struct NeusEnds {
  const T *f_prev, *f_next;

  NeusInterval<T> operator()(int64_t i) const { return {f_prev[i], f_next[i], f_prev[i] - f_next[i]}; }
};

TEST(Neus, NanReachesTheCaller) {
  std::vector<float> f_prev, f_next, weights(10);
  for (int i = 0; i < 10; ++i) f_prev.push_back(0.1f - 0.05f * float(i)), f_next.push_back(0.05f - 0.05f * float(i));
  f_next[4] = std::numeric_limits<float>::quiet_NaN();
  const NeusEnds<float> ends{f_prev.data(), f_next.data()};
  const float opacity = neus_ray_weights(OneThread{}, ends, 10.f, 10, 0.f, weights.data());
  EXPECT_TRUE(std::isnan(opacity));
  EXPECT_FALSE(std::isnan(weights[3]));
  EXPECT_TRUE(std::isnan(weights[4]));
}

}  // namespace
}  // namespace splitnerf
