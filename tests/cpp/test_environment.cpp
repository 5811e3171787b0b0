// The equirectangular convention, bilinear lookups and the sampler of environment maps.
#include "splitnerf/environment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "splitnerf/environment_sampler.h"

namespace splitnerf {
namespace {

using Vec = Vec3<double>;

TEST(Environment, KnownDirections) {
  const auto at = [](double x, double y, double z) { return direction_to_equirect(Vec{x, y, z}); };
  EXPECT_DOUBLE_EQ(at(1, 0, 0).x, 0.5);  // +x is the centre column
  EXPECT_DOUBLE_EQ(at(1, 0, 0).y, 0.5);
  EXPECT_DOUBLE_EQ(at(0, 1, 0).x, 0.25);  // u grows clockwise seen from above
  EXPECT_DOUBLE_EQ(at(0, -1, 0).x, 0.75);
  EXPECT_DOUBLE_EQ(at(0, 0, 1).y, 0);  // up is the top row
  EXPECT_DOUBLE_EQ(at(0, 0, -1).y, 1);
  EXPECT_NEAR(std::abs(at(-1, 1e-9, 0).x - 0.5), 0.5, 1e-9);  // -x is the seam
}

TEST(Environment, MappingsAreInverse) {
  for (uint32_t i = 0; i < 5000; ++i) {
    const Vec d = fibonacci_sphere<double>(i, 5000);
    EXPECT_LT(length(equirect_to_direction(direction_to_equirect(d)) - d), 1e-12);
    const Vec3<float> f{float(d.x), float(d.y), float(d.z)};
    EXPECT_LT(length(equirect_to_direction(direction_to_equirect(f)) - f), 2e-6f);
  }
}

TEST(Environment, SolidAnglesSumToTheSphere) {
  for (int height : {1, 2, 7, 128}) {
    double total = 0;
    for (int row = 0; row < height; ++row) total += 2 * height * texel_solid_angle<double>(row, height, 2 * height);
    EXPECT_NEAR(total, 4 * kPi, 1e-12) << height;
  }
  // One row near the equator against (2 pi / W)(cos top - cos bottom).
  EXPECT_NEAR(texel_solid_angle<double>(3, 8, 16), 2 * kPi / 16 * (std::cos(3 * kPi / 8) - std::cos(4 * kPi / 8)),
              1e-14);
}

std::vector<double> random_map(int height, int width) {
  std::vector<double> map(size_t(height) * width * 3);
  for (size_t i = 0; i < map.size(); ++i) map[i] = random_unit<double>(uint32_t(i), 3);
  return map;
}

TEST(Environment, LookupIsLinearBetweenCentresAndWrapsAcrossTheSeam) {
  constexpr int kHeight = 4, kWidth = 8;
  const auto map = random_map(kHeight, kWidth);
  const auto texel = [&](int row, int column) { return map[(row * kWidth + column) * 3]; };
  const auto lookup = [&](double x, double y) {
    return lookup_environment(map.data(), kHeight, kWidth, equirect_to_direction(Vec2<double>{x / kWidth, y / kHeight}))
        .x;
  };
  EXPECT_NEAR(lookup(2.75, 1.5), 0.75 * texel(1, 2) + 0.25 * texel(1, 3), 1e-12);
  EXPECT_NEAR(lookup(2.5, 1.75), 0.75 * texel(1, 2) + 0.25 * texel(2, 2), 1e-12);
  EXPECT_NEAR(lookup(0.25, 1.5), 0.75 * texel(1, 0) + 0.25 * texel(1, kWidth - 1), 1e-12);
  EXPECT_NEAR(lookup(7.75, 1.5), 0.75 * texel(1, kWidth - 1) + 0.25 * texel(1, 0), 1e-12);
  EXPECT_NEAR(lookup(3.5, 0.1), texel(0, 3), 1e-12);  // rows clamp at the poles
  EXPECT_NEAR(lookup(3.5, 3.9), texel(kHeight - 1, 3), 1e-12);
}

TEST(Environment, FootprintWeightsSumToOneInEveryDirection) {
  for (const Vec3<float> d : {Vec3<float>{0, 0, 1}, {0, 0, -1}, {-1, 0.f, 0}, {-1, -0.f, 0}, {1, 0, 0}, {0, 1, 0}}) {
    const auto f = equirect_footprint(direction_to_equirect(d), 5, 7);
    float total = 0;
    for (int k = 0; k < 4; ++k) {
      total += f.weight[k];
      EXPECT_GE(f.weight[k], 0.f);
      EXPECT_TRUE(f.texel[k] >= 0 && f.texel[k] < 35);
    }
    EXPECT_NEAR(total, 1.f, 1e-6f);
  }
}

// A dim map with a bright spot at the seam and another near the pole.
std::vector<float> spotted_map(int height, int width) {
  std::vector<float> map(size_t(height) * width * 3, 0.1f);
  for (int c = 0; c < 3; ++c) {
    map[(size_t(height / 3) * width) * 3 + c] = 200.f;
    map[(size_t(1) * width + 5) * 3 + c] = 50.f;
  }
  return map;
}

TEST(EnvironmentSampler, DensityIntegratesToOneAndMatchesTheSamples) {
  constexpr int kHeight = 16, kWidth = 32, kSamples = 300000;
  const auto map = spotted_map(kHeight, kWidth);
  const EnvironmentSampler sampler(map.data(), kHeight, kWidth);
  double total = 0;
  std::vector<double> masses;
  for (int row = 0; row < kHeight; ++row) {
    for (int column = 0; column < kWidth; ++column) {
      const Vec3<float> d = equirect_to_direction(Vec2<float>{(column + 0.5f) / kWidth, (row + 0.5f) / kHeight});
      masses.push_back(sampler.pdf(d) * texel_solid_angle<double>(row, kHeight, kWidth));
      total += masses.back();
    }
  }
  EXPECT_NEAR(total, 1, 1e-5);

  std::vector<int> counts(masses.size());
  for (uint32_t i = 0; i < kSamples; ++i) {
    float pdf;
    const Vec3<float> d = sampler.sample({random_unit<float>(i, 0), random_unit<float>(i, 1)}, &pdf);
    const Vec2<float> uv = direction_to_equirect(d);
    ++counts[min_of(int(uv.y * kHeight), kHeight - 1) * kWidth + min_of(int(uv.x * kWidth), kWidth - 1)];
    if (i < 2000) { EXPECT_NEAR(sampler.pdf(d) / pdf, 1, 1e-3) << i; }
  }
  double chi_square = 0;
  for (size_t i = 0; i < masses.size(); ++i)
    chi_square += square(counts[i] - masses[i] * kSamples) / (masses[i] * kSamples);
  const double k = double(masses.size() - 1);
  EXPECT_LT(chi_square, k + 4 * std::sqrt(2 * k));
}

TEST(Environment, NaNStaysAndReadsNothingElse) {
  constexpr int kHeight = 6, kWidth = 10;
  const std::vector<float> map(3 * kHeight * kWidth, 1.f);
  for (const Vec3<float> d : {Vec3<float>{NAN, 0, 1}, Vec3<float>{0, NAN, 1}, Vec3<float>{1, 0, NAN}}) {
    const auto cell = equirect_cell(direction_to_equirect(d), kHeight, kWidth);
    EXPECT_TRUE(cell.row >= 0 && cell.next_row < kHeight && cell.column >= 0 && cell.next_column < kWidth);
    EXPECT_TRUE(std::isnan(lookup_environment(map.data(), kHeight, kWidth, d).x));
  }
}

}  // namespace
}  // namespace splitnerf
