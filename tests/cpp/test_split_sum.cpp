// The split-sum table against exact values and a finer quadrature, and white furnaces.
#include "splitnerf/split_sum.h"

#include "check.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf {
namespace {

// E = 1 - ln 2 at rho = 1, n.v = 1: there D = 1/pi and V = 1 / (2 (1 + l.n)), and E = int c / (1 + c) dc.
TEST(BrdfTable, RoughestNormalIncidenceIsOneMinusLogTwo) {
  const LobeIntegrals fine = integrate_brdf(1, 1, 16000);
  EXPECT_NEAR(fine.f1 + fine.f2, 1 - std::log(2.0), 1e-5);
  const Vec3<double> table = sample_brdf_lut(brdf_lut(), 1.0, 1.0).value;
  EXPECT_NEAR(table.x + table.y, 1 - std::log(2.0), 1e-4);
}

TEST(BrdfTable, MirrorKeepsAllLight) {
  for (const double nv : {0.2, 0.5, 1.0}) {
    const Vec3<double> table = sample_brdf_lut(brdf_lut(), nv, 0.0).value;
    EXPECT_NEAR(table.x + table.y, 1, 2e-3) << nv;
    EXPECT_NEAR(table.y, pow5(1 - nv), 4e-3) << nv;
    EXPECT_NEAR(table.z, 1, 1e-6) << nv;
  }
}

TEST(BrdfTable, ChiMatchesMeasuredLobes) {
  const double roughness[] = {0.1, 0.3, 0.5, 0.7, 0.9}, n_dot_v[] = {0.1, 0.5, 0.9};
  const double chi[5][3] = {
      {0.993, 0.999, 1}, {0.805, 0.946, 0.984}, {0.559, 0.752, 0.877}, {0.351, 0.465, 0.581}, {0.131, 0.159, 0.183}};
  for (int r = 0; r < 5; ++r) {
    for (int v = 0; v < 3; ++v) {
      EXPECT_NEAR(integrate_brdf(n_dot_v[v], roughness[r], 50000).chi, chi[r][v], 2e-3)
          << roughness[r] << " " << n_dot_v[v];
      EXPECT_NEAR(sample_brdf_lut(brdf_lut(), n_dot_v[v], roughness[r]).value.z, chi[r][v], 6e-3)
          << roughness[r] << " " << n_dot_v[v];
    }
  }
  for (const double nv : n_dot_v) EXPECT_NEAR(sample_brdf_lut(brdf_lut(), nv, 1.0).value.z, 0, 1e-3);
}

TEST(BrdfTable, InterpolatesAFinerQuadrature) {
  Random random(2);
  Vec3<double> worst{0, 0, 0}, squares{0, 0, 0};
  double worst_dielectric = 0, worst_f2 = 0;  // away from grazing mirrors, whose F2 turns within one texel
  const int n = 600;
  for (int i = 0; i < n; ++i) {
    const double nv = square(random.uniform(0.01, 1)), roughness = random.uniform();
    const LobeIntegrals fine = integrate_brdf(nv, roughness, 60000);
    const LutSample<double> table = sample_brdf_lut(brdf_lut(), nv, roughness);
    const Vec3<double> error = table.value - Vec3<double>{fine.f1, fine.f2, fine.chi};
    worst_dielectric = std::max(worst_dielectric, std::abs(table.dielectric - fine.dielectric));
    for (int c = 0; c < 3; ++c) worst[c] = std::max(worst[c], std::abs(error[c])), squares[c] += square(error[c]) / n;
    if (nv > 0.05) worst_f2 = std::max(worst_f2, std::abs(error.y));
  }
  EXPECT_LT(worst.x, 8e-3);
  EXPECT_LT(worst.y, 5e-2);
  EXPECT_LT(worst_f2, 5e-3);
  EXPECT_LT(worst.z, 1e-2);
  EXPECT_LT(worst_dielectric, 5e-2);
  EXPECT_LT(std::sqrt(squares.x), 1e-3);
  EXPECT_LT(std::sqrt(squares.y), 3e-3);
}

TEST(BrdfTable, NeverGainsEnergy) {
  const float* lut = brdf_lut();
  for (int i = 0; i < kLutSize * kLutSize; ++i) {
    const float* entry = lut + kLutChannels * i;
    const float f1 = entry[0], f2 = entry[1], chi = entry[2];
    EXPECT_TRUE(f1 >= 0 && f2 >= 0 && f1 + f2 <= 1.001f) << i << " " << f1 << " " << f2;
    EXPECT_TRUE(chi >= 0 && chi <= 1) << i;
    // What a dielectric takes leaves its base at least 0.01, compensated too: nothing clamps it.
    EXPECT_TRUE(entry[3] > 0.01f && entry[3] <= f1 + f2 + 1e-7f && entry[3] < 0.99f) << i << " " << entry[3];
  }
}

ShadePoint<double> white_point(Random& random) {
  const Vec3<double> one{1, 1, 1};
  return {random.direction(), random.direction(), one, random.uniform(), 0, one, one, one, one, {}, {}};
}

// Under white light a white dielectric returns (1 - E) + E; a white metal E, which compensation fills up to 1.
TEST(Shading, WhiteFurnaceReturnsWhite) {
  Random random(6);
  for (int i = 0; i < 200; ++i) {
    ShadePoint<double> p = white_point(random);
    for (const bool compensate : {false, true}) {
      const Vec3<double> dielectric = split_sum_shade(brdf_lut(), {FresnelMode::kExact, compensate}, p);
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(dielectric[c], 1, 1e-12);
    }
    p.metallic = 1;
    const Vec3<double> metal = split_sum_shade(brdf_lut(), {FresnelMode::kExact, true}, p);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(metal[c], 1, 1e-12);
    EXPECT_LE(split_sum_shade(brdf_lut(), {FresnelMode::kExact, false}, p).x, 1.001);
  }
}

TEST(DielectricFresnel, MeetsItsClosedForms) {
  EXPECT_NEAR(fresnel_dielectric(1.), 0.04, 1e-12);
  EXPECT_NEAR(fresnel_dielectric(0.), 1, 1e-12);
  // At Brewster's angle, tan = 1.5, only the s part is left: ((n^2 - 1) / (n^2 + 1))^2 / 2.
  EXPECT_NEAR(fresnel_dielectric(1 / std::sqrt(1 + 2.25)), 0.5 * square(1.25 / 3.25), 1e-12);
}

TEST(DielectricTable, SmoothEndIsFresnelAndRoughEndStaysBelow) {
  for (double nv : {0.2, 0.5, 0.8, 1.0}) {
    EXPECT_NEAR(sample_brdf_lut(brdf_lut(), nv, 0.).dielectric, fresnel_dielectric(nv), 2e-3) << nv;
    EXPECT_LT(sample_brdf_lut(brdf_lut(), nv, 1.).dielectric, fresnel_dielectric(nv) + 0.02) << nv;
  }
}

}  // namespace
}  // namespace splitnerf
