// NeuS weights against long double, the telescoped product, limits, and adjoints.
#include "splitnerf/neus.h"

#include <limits>

#include "check.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf {
namespace {

using Wide = long double;

Wide wide_softplus(Wide x) { return (x > 0 ? x : 0) + std::log1p(std::exp(-std::abs(x))); }

// alpha = 1 - Phi(f_next) / Phi(f_prev) of the very numbers that the float formula is given. Where the
// difference of softplus would cancel, their integral sigmoid(-s f) ds f by Simpson's rule.
Wide reference_alpha(Wide f_prev, Wide f_next, Wide s) {
  if (f_prev <= f_next) return 0;
  const Wide d = s * (f_prev - f_next);
  if (d > 1e-3L) return -std::expm1(wide_softplus(-s * f_prev) - wide_softplus(-s * f_next));
  const auto sigmoid = [](Wide x) { return x >= 0 ? 1 / (1 + std::exp(-x)) : std::exp(x) / (1 + std::exp(x)); };
  return -std::expm1(-d / 6 * (sigmoid(-s * f_prev) + 4 * sigmoid(-s * (f_prev + f_next) / 2) + sigmoid(-s * f_next)));
}

constexpr double kFaint = 1e-29;  // sigmoid(-s f_prev) leaves float's normal range below; nobody sees such alphas

TEST(Neus, AlphaFollowsLongDouble) {
  double worst = 0;
  for (const float s : {1.f, 20.f, 64.f, 500.f, 8103.f, 1e6f}) {
    for (int i = -120; i <= 120; ++i) {
      // s |f| from 1e-6 to 1e6 on both sides of the surface
      const float f_prev = (i < 0 ? -1.f : 1.f) * std::pow(10.f, float(std::abs(i)) / 10 - 6) / s;
      for (int k = 0; k <= 60; ++k) {
        const float f_next = f_prev - std::pow(10.f, float(k) / 5 - 6) / s;
        const Wide expected = reference_alpha(f_prev, f_next, s);
        const float alpha = -std::expm1(-neus_optical_depth(f_prev, f_next, f_prev - f_next, s));
        ASSERT_TRUE(alpha >= 0 && alpha <= 1) << f_prev << " " << f_next << " " << s;
        if (expected < kFaint) {
          EXPECT_LT(alpha, 2 * kFaint);
          continue;
        }
        worst = std::max(worst, double(std::abs(alpha / expected - 1)));
        ASSERT_LT(worst, 1e-5) << f_prev << " " << f_next << " " << s;
      }
    }
  }
  RecordProperty("worst_relative_error", std::to_string(worst));
}

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

template <class T> struct Ray {
  std::vector<T> f_prev, f_next, weights;
  T opacity;

  NeusEnds<T> ends() const { return {f_prev.data(), f_next.data()}; }
};

// n samples of a ray along which the distance falls from f0 by `slope` in all.
template <class T> Ray<T> falling_ray(double f0, double slope, int n, T s, T min_transmittance = 0) {
  Ray<T> ray;
  for (int i = 0; i < n; ++i) {
    ray.f_prev.push_back(T(f0 - slope * i / n));
    ray.f_next.push_back(T(f0 - slope * (i + 1) / n));
  }
  ray.weights.resize(n);
  ray.opacity = neus_ray_weights(OneThread{}, ray.ends(), s, n, min_transmittance, ray.weights.data());
  return ray;
}

TEST(Neus, OpacityIsTheSumOfWeightsAndTheTelescopedRatio) {
  for (const double s : {5., 64., 8103.}) {
    for (const double slope : {0.01, 0.4, 1.5}) {
      const Ray<float> ray = falling_ray(0.3, slope, 100, float(s));
      double total = 0;
      for (float w : ray.weights) total += w;
      const double expected = double(reference_alpha(0.3L, 0.3L - slope, s));
      EXPECT_NEAR(total, ray.opacity, 3e-6) << s << " " << slope;
      EXPECT_NEAR(ray.opacity, expected, 2e-5 * expected + 1e-30) << s << " " << slope;
    }
  }
}

TEST(Neus, FaintRaysKeepTheirDigits) {
  // 1e-5 of opacity in 1024 samples: a running product of (1 - alpha) in float loses a fifth of it.
  const Ray<float> ray = falling_ray(0.2, 0.05, 1024, 68.f);
  const double expected = double(reference_alpha(0.2L, 0.15L, 68));
  EXPECT_LT(expected, 1e-4);
  EXPECT_NEAR(ray.opacity / expected, 1, 1e-5);
}

TEST(Neus, NanReachesTheCaller) {
  Ray<float> ray = falling_ray(0.1, 0.5, 10, 10.f);
  ray.f_next[4] = std::numeric_limits<float>::quiet_NaN();
  const float opacity = neus_ray_weights(OneThread{}, ray.ends(), 10.f, 10, 0.f, ray.weights.data());
  EXPECT_TRUE(std::isnan(opacity));
  EXPECT_FALSE(std::isnan(ray.weights[3]));
  EXPECT_TRUE(std::isnan(ray.weights[4]));
}

// ---- adjoints ----

// Behind a sample of great depth the transmittance of those before it must not lose its digits.
TEST(Neus, FloatAdjointFollowsDoubleAlongOpaqueRays) {
  const int n = 350;
  const Ray<float> ray = falling_ray(0.0041, 1.4, n, 4000.f);
  const std::vector<double> f_prev(ray.f_prev.begin(), ray.f_prev.end()), f_next(ray.f_next.begin(), ray.f_next.end());
  std::vector<double> gw(n), weights(n), prev(n), next(n);
  std::vector<float> gw32(n), prev32(n), next32(n);
  for (int i = 0; i < n; ++i) gw32[i] = std::cos(float(i)), gw[i] = gw32[i];
  const NeusEnds<double> ends{f_prev.data(), f_next.data()};
  neus_ray_weights(OneThread{}, ends, 4000., n, 0., weights.data());
  neus_ray_weights_backward(
      OneThread{}, ends, 4000., n, 0., weights.data(), gw.data(), 0., next.data(),
      [&](int64_t i, const OpticalDepthGrad<double>& g) { prev[i] = g.f_prev, next[i] = g.f_next; });
  neus_ray_weights_backward(
      OneThread{}, ray.ends(), 4000.f, n, 0.f, ray.weights.data(), gw32.data(), 0.f, next32.data(),
      [&](int64_t i, const OpticalDepthGrad<float>& g) { prev32[i] = g.f_prev, next32[i] = g.f_next; });
  double largest = 0;
  for (double g : next) largest = std::max(largest, std::abs(g));
  for (int i = 0; i < n; ++i) {
    EXPECT_NEAR(prev32[i], prev[i], 1e-5 * largest) << i;
    EXPECT_NEAR(next32[i], next[i], 1e-5 * largest) << i;
  }
}

TEST(AnnealedCosine, GoesFromSoftToSharp) {
  const double cosines[] = {-1, 0, 1}, soft[] = {-1, -0.5, 0}, sharp[] = {-1, 0, 0};
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(annealed_cosine(cosines[i], 0.0).value, soft[i]);
    EXPECT_EQ(annealed_cosine(cosines[i], 1.0).value, sharp[i]);
  }
  for (double c : {-0.7, 0.4}) {
    const double h = 1e-6, slope = (annealed_cosine(c + h, 0.3).value - annealed_cosine(c - h, 0.3).value) / (2 * h);
    EXPECT_NEAR(annealed_cosine(c, 0.3).slope, slope, 1e-9) << c;
  }
}

}  // namespace
}  // namespace splitnerf
