// Samplers against their densities, lattices, random numbers.
#include "splitnerf/sampling.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <vector>

namespace splitnerf {
namespace {

using Vec = Vec3<double>;
using Density = std::function<double(Vec)>;
using Sampler = std::function<Vec(double, double)>;

constexpr int kAzimuths = 8;

// Cells of the sphere: edges in 1 - cos(theta) that are fine where the lobe is (1 - cos is about
// width^2 there), coarse elsewhere, times equal azimuths.
std::vector<double> polar_edges(double width) {
  std::vector<double> edges{0};
  for (double t = std::min(0.05, 0.1 * width * width); t < 0.1; t *= 1.6) edges.push_back(t);
  for (int k = 1; k <= 19; ++k) edges.push_back(0.1 * k);
  edges.push_back(2);
  return edges;
}

// Integral of the density over every cell by a midpoint rule.
std::vector<double> cell_masses(const Density& pdf, const std::vector<double>& edges) {
  constexpr int kFine = 40;
  std::vector<double> masses;
  for (size_t i = 0; i + 1 < edges.size(); ++i) {
    for (int j = 0; j < kAzimuths; ++j) {
      double mass = 0;
      for (int a = 0; a < kFine; ++a) {
        for (int b = 0; b < kFine; ++b) {
          const double t = lerp(edges[i], edges[i + 1], (a + 0.5) / kFine);
          mass += pdf(direction_from_cosine(t, (j + (b + 0.5) / kFine) / kAzimuths));
        }
      }
      masses.push_back(mass / (kFine * kFine) * (edges[i + 1] - edges[i]) * 2 * kPi / kAzimuths);
    }
  }
  return masses;
}

// The 1 - 1e-4 quantile of chi-square with k degrees of freedom (Wilson and Hilferty 1931).
double chi_square_limit(double k) { return k * std::pow(1 - 2 / (9 * k) + 3.719 * std::sqrt(2 / (9 * k)), 3); }

void expect_matches_density(const Sampler& sample, const Density& pdf, double width) {
  constexpr int kSamples = 400000;
  const std::vector<double> edges = polar_edges(width), masses = cell_masses(pdf, edges);
  double total = 0;
  for (double mass : masses) total += mass;
  EXPECT_NEAR(total, 1, 2e-3) << "the density does not integrate to 1";

  std::vector<int> counts(masses.size());
  for (uint32_t i = 0; i < kSamples; ++i) {
    const Vec w = sample(random_unit<double>(i, 0, 7), random_unit<double>(i, 1, 7));
    ASSERT_NEAR(length(w), 1, 1e-9);
    const double t = dot(w - Vec{0, 0, 1}, w - Vec{0, 0, 1}) / 2;
    const auto ring = std::clamp<int64_t>(std::upper_bound(edges.begin(), edges.end(), t) - edges.begin() - 1, 0,
                                          int64_t(edges.size()) - 2);
    const double turn = std::atan2(w.y, w.x) / (2 * kPi);
    ++counts[ring * kAzimuths + std::min(int((turn < 0 ? turn + 1 : turn) * kAzimuths), kAzimuths - 1)];
  }
  // Cells that expect fewer than ten samples are pooled into one.
  double chi_square = 0, pooled_expected = 0, pooled_count = 0;
  int n_cells = 0;
  for (size_t i = 0; i < masses.size(); ++i) {
    const double expected = masses[i] / total * kSamples;
    if (expected < 10) {
      pooled_expected += expected;
      pooled_count += counts[i];
      continue;
    }
    chi_square += square(counts[i] - expected) / expected;
    ++n_cells;
  }
  EXPECT_LE(pooled_count, pooled_expected + 4 * std::sqrt(pooled_expected) + 10) << "samples where the density is 0";
  if (pooled_expected >= 10) chi_square += square(pooled_count - pooled_expected) / pooled_expected;
  EXPECT_LT(chi_square, chi_square_limit(n_cells)) << n_cells << " cells";
}

TEST(Sampling, UniformSphereMatchesItsDensity) {
  expect_matches_density(sample_uniform_sphere<double>, [](Vec) { return 1 / (4 * kPi); }, 1);
}

TEST(Sampling, CosineHemisphereMatchesItsDensity) {
  expect_matches_density(sample_cosine_hemisphere<double>, [](Vec w) { return pdf_cosine_hemisphere(w.z); }, 1);
}

TEST(Sampling, GgxLobeMatchesItsDensity) {
  for (double a : {0.01, 0.09, 0.25, 0.5, 0.9, 0.9995, 1.0}) {
    SCOPED_TRACE(a);
    const auto lobe = [a](Vec w) { return ggx_d(a, sin2_half_angle(w, Vec{0, 0, 1})) * std::max(w.z, 0.0); };
    double total = 0;
    for (double mass : cell_masses(lobe, polar_edges(a))) total += mass;
    expect_matches_density([a](double u1, double u2) { return sample_ggx_lobe(u1, u2, a); },
                           [&](Vec w) { return lobe(w) / total; }, a);
  }
}

TEST(Sampling, VisibleNormalsMatchTheirDensity) {
  for (double a : {0.05, 0.3, 1.0}) {
    for (double cosine : {1.0, 0.6, 0.05}) {
      SCOPED_TRACE(testing::Message() << "a = " << a << ", v.z = " << cosine);
      const Vec v{std::sqrt(1 - cosine * cosine) * 0.8, std::sqrt(1 - cosine * cosine) * 0.6, cosine};
      // Density of h: that of the reflection times dl/dh = 4 v.h.
      expect_matches_density(
          [&](double u1, double u2) { return sample_ggx_vndf(v, u1, u2, a); },
          [&](Vec h) { return h.z > 0 && dot(v, h) > 0 ? pdf_ggx_vndf(v, h, a) * 4 * dot(v, h) : 0; }, a);
    }
  }
}

TEST(Sampling, InversionSolvesItsEquation) {
  for (double t = 1e-14; t < 1e9; t *= 3.7) {
    const double y = invert_y_minus_log1p(t);
    EXPECT_NEAR(y_minus_log1p(y) / t, 1, 1e-10) << t;
    const float yf = invert_y_minus_log1p(float(t));
    EXPECT_NEAR(yf / y, 1, 1e-5) << t;
  }
  EXPECT_EQ(invert_y_minus_log1p(0.), 0);
}

TEST(Trigonometry, CosineAndSineOfTurns) {
  for (double u = -3; u < 3; u += 0.00123) {
    const Vec2<float> at = cos_sin_of_turns(float(u));
    EXPECT_NEAR(at.x, std::cos(2 * kPi * double(float(u))), 3e-7) << u;
    EXPECT_NEAR(at.y, std::sin(2 * kPi * double(float(u))), 3e-7) << u;
  }
  const Vec2<float> far = cos_sin_of_turns(999999.25f);
  EXPECT_NEAR(far.x, 0, 1e-6);
  EXPECT_NEAR(far.y, 1, 1e-6);
}

TEST(Trigonometry, ArcTangent) {
  for (int i = 0; i < 4000; ++i) {
    const double angle = (i - 2000) * kPi / 2000, length = std::pow(10., i % 60 - 30);
    const float y = float(length * std::sin(angle)), x = float(length * std::cos(angle));
    const double exact = std::atan2(double(y), double(x));
    EXPECT_NEAR(arc_tangent(y, x), exact, 2.5e-7 * std::abs(exact)) << y << " " << x;
  }
  EXPECT_EQ(arc_tangent(0.f, 0.f), 0.f);
  EXPECT_EQ(arc_tangent(0.f, 1.f), 0.f);
  EXPECT_FLOAT_EQ(arc_tangent(0.f, -1.f), float(kPi));
  EXPECT_TRUE(std::isnan(arc_tangent(NAN, 1.f)));
  EXPECT_TRUE(std::isnan(arc_tangent(1.f, NAN)));
  EXPECT_TRUE(std::isnan(arc_tangent(NAN, NAN)));
}

// Against the library's, over all magnitudes.
TEST(Sampling, LogarithmOfOnePlus) {
  for (double y = 1e-12; y < 1e30; y *= 1.37) {
    EXPECT_NEAR(log1p_of_positive(y) / std::log1p(y), 1, 5e-16) << y;
    EXPECT_NEAR(log1p_of_positive(float(y)) / std::log1p(double(float(y))), 1, 2.5e-7) << y;
  }
  EXPECT_EQ(log1p_of_positive(0.), 0);
}

TEST(Sampling, SeriesMeetsTheLogarithm) {
  for (double y : {0.0999999, 0.1}) { EXPECT_NEAR(y_minus_log1p(y) / (y - std::log1p(y)), 1, 1e-12) << y; }
}

TEST(Sampling, LobeEndsAreExact) {
  for (float a : {1e-4f, 0.01f, 0.5f, 1.f}) {
    const Vec3<float> centre = sample_ggx_lobe(0.f, 0.3f, a);
    EXPECT_NEAR(centre.z, 1.f, 1e-6f);
    const Vec3<float> edge = sample_ggx_lobe(unit_from_bits<float>(0xffffffffu), 0.3f, a);
    EXPECT_GE(edge.z, -1e-6f);
    EXPECT_NEAR(length(edge), 1.f, 1e-5f);
  }
}

TEST(Sampling, RandomUnitStaysBelowOneAndIsUniform) {
  EXPECT_LT(unit_from_bits<float>(0xffffffffu), 1.f);
  EXPECT_EQ(unit_from_bits<float>(0u), 0.f);
  // Consecutive counters in each of the three places fill 64 bins evenly.
  for (int place = 0; place < 3; ++place) {
    std::vector<int> counts(64);
    constexpr int kSamples = 64000;
    for (uint32_t i = 0; i < kSamples; ++i) {
      const uint32_t c[3] = {place == 0 ? i : 5u, place == 1 ? i : 6u, place == 2 ? i : 7u};
      ++counts[int(random_unit<double>(c[0], c[1], c[2]) * 64)];
    }
    double chi_square = 0;
    for (int count : counts) chi_square += square(count - kSamples / 64.) / (kSamples / 64.);
    EXPECT_LT(chi_square, chi_square_limit(63)) << "place " << place;
  }
}

TEST(Sampling, NeighbouringCountersAreUncorrelated) {
  double covariance = 0;
  constexpr int kSamples = 100000;
  for (uint32_t i = 0; i < kSamples; ++i) {
    covariance += (random_unit<double>(i, 0) - 0.5) * (random_unit<double>(i, 1) - 0.5) / kSamples;
  }
  EXPECT_LT(std::abs(covariance), 4. / 12 / std::sqrt(double(kSamples)));
}

// Largest gap between the lattice's share of anchored boxes and their area.
double discrepancy(const std::vector<Vec2<double>>& points) {
  double worst = 0;
  for (double x = 0.1; x < 1; x += 0.1) {
    for (double y = 0.1; y < 1; y += 0.1) {
      int inside = 0;
      for (const auto& p : points) inside += p.x < x && p.y < y;
      worst = std::max(worst, std::abs(double(inside) / double(points.size()) - x * y));
    }
  }
  return worst;
}

TEST(Sampling, LatticesFillTheSquareEvenly) {
  constexpr uint32_t kPoints = 1024;
  const Vec2<double> shift{0.37, 0.81};
  std::vector<Vec2<double>> fibonacci, r2;
  for (uint32_t i = 0; i < kPoints; ++i) {
    fibonacci.push_back(fibonacci_lattice(i, kPoints, shift));
    r2.push_back(r2_lattice(i, shift));
  }
  // Random points would leave about 0.02.
  EXPECT_LT(discrepancy(fibonacci), 0.005);
  EXPECT_LT(discrepancy(r2), 0.006);
  for (const auto& p : fibonacci) EXPECT_TRUE(p.x >= 0 && p.x < 1 && p.y >= 0 && p.y < 1);
}

TEST(Sampling, GoldenFractionsFollowTheGoldenRatio) {
  EXPECT_NEAR(golden_fraction<double>(1), (std::sqrt(5.) - 1) / 2, 1e-7);
  EXPECT_NEAR(golden_fraction<double>(100000u), 0.6180339887498949 * 100000 - 61803, 2e-5);
}

TEST(Sampling, WrapStaysBelowOne) {
  const float below = unit_from_bits<float>(0xffffffffu);
  EXPECT_LT(wrap_unit(below, below), 1.f);
  EXPECT_EQ(wrap_unit(1.f, 0.f), 0.f);
  EXPECT_LT(wrap_unit(0.5f, std::nextafter(0.5f, 0.f)), 1.f);
}

}  // namespace
}  // namespace splitnerf
