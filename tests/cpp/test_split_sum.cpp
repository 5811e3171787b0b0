// The split-sum table against exact values and a finer quadrature, white furnaces, and adjoints.
#include "splitnerf/split_sum.h"

#include "check.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf {
namespace {

constexpr FresnelMode kModes[] = {FresnelMode::kExact, FresnelMode::kPaper, FresnelMode::kCode};

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

TEST(BrdfTable, EntriesFollowAFinerQuadrature) {
  double worst = 0, worst_chi = 0;
  for (int row = 0; row < kLutSize; row += 3) {
    for (int column = 0; column < kLutSize; ++column) {
      const LobeIntegrals fine = integrate_brdf(square(column / (kLutSize - 1.0)), row / (kLutSize - 1.0), 1 << 16);
      const float* entry = brdf_lut() + (row * kLutSize + column) * kLutChannels;
      worst = std::max(
          {worst, std::abs(entry[0] - fine.f1), std::abs(entry[1] - fine.f2), std::abs(entry[3] - fine.dielectric)});
      worst_chi = std::max(worst_chi, std::abs(entry[2] - fine.chi));
    }
  }
  EXPECT_LT(worst, 1e-3);
  EXPECT_LT(worst_chi, 2e-3);
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

TEST(BrdfTable, DerivativesFollowTheValues) {
  Random random(3);
  for (int i = 0; i < 50; ++i) {
    std::vector<double> x{random.uniform(0.01, 1), random.uniform()};
    const LutSample<double> s = sample_brdf_lut(brdf_lut(), x[0], x[1]);
    for (int c = 0; c < 3; ++c)
      expect_gradient([&] { return sample_brdf_lut(brdf_lut(), x[0], x[1]).value[c]; }, x,
                      {s.d_n_dot_v[c], s.d_roughness[c]}, 1e-6, "table", 1e-6 * x[0]);
    expect_gradient([&] { return sample_brdf_lut(brdf_lut(), x[0], x[1]).dielectric; }, x,
                    {s.dielectric_by_n_dot_v, s.dielectric_by_roughness}, 1e-6, "dielectric", 1e-6 * x[0]);
  }
  EXPECT_EQ(sample_brdf_lut(brdf_lut(), 1e-5, 0.5).d_n_dot_v.x, 0);
  EXPECT_EQ(sample_brdf_lut(brdf_lut(), 0.5, 1.5).d_roughness.x, 0);
}

// ---- query_direction ----

TEST(QueryDirection, MirrorsWhenSmoothAndFollowsTheNormalWhenRough) {
  Random random(4);
  for (int i = 0; i < 100; ++i) {
    const Vec3<double> n = random.direction(), v = random.direction();
    const Vec3<double> turned = n * facing(n, v), w_r = reflect(turned, v);
    EXPECT_NEAR(dot(w_r, turned), dot(v, turned), 1e-12);
    EXPECT_LT(length(query_direction(brdf_lut(), true, n, v, 0.3) - w_r), 1e-12);
    EXPECT_LT(length(query_direction(brdf_lut(), false, n, v, 0.9) - w_r), 1e-12);
    EXPECT_LT(length(query_direction(brdf_lut(), true, n, v, 1.0) - turned), 3e-3);
    EXPECT_LT(length(query_direction(brdf_lut(), true, n, v, 0.6) - query_direction(brdf_lut(), true, -n, v, 0.6)),
              1e-12);
    EXPECT_NEAR(length(query_direction(brdf_lut(), true, n, v, 0.6)), 1, 1e-12);
  }
}

TEST(QueryDirection, AdjointFollowsCentralDifferences) {
  Random random(5);
  for (int i = 0; i < 60; ++i) {
    const bool mean = i % 3 != 0;
    const Vec3<double> n = random.direction(), v = random.direction(), g = random.direction();
    std::vector<double> x{n.x, n.y, n.z, v.x, v.y, v.z, random.uniform(0.05, 0.95)};
    const auto f = [&] { return dot(g, query_direction(brdf_lut(), mean, load3(&x[0]), load3(&x[3]), x[6])); };
    const QueryDirectionGrad<double> d = query_direction_backward(brdf_lut(), mean, n, v, x[6], g);
    expect_gradient(f, x, {d.normal.x, d.normal.y, d.normal.z, d.view.x, d.view.y, d.view.z, d.roughness}, 1e-6,
                    mean ? "mean" : "reflection", 1e-6);
  }
}

// ---- shading ----

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

TEST(Shading, IsLinearInLightAndOcclusion) {
  Random random(7);
  ShadePoint<double> p = white_point(random);
  p.albedo = {0.8, 0.5, 0.2}, p.metallic = 0.3, p.diffuse = {1, 2, 3}, p.specular = {4, 5, 6};
  const Vec3<double> both = split_sum_shade(brdf_lut(), {}, p);
  ShadePoint<double> diffuse = p, specular = p;
  diffuse.occlusion_s = specular.occlusion_d = {0, 0, 0};
  EXPECT_LT(length(split_sum_shade(brdf_lut(), {}, diffuse) + split_sum_shade(brdf_lut(), {}, specular) - both), 1e-12);
  diffuse.occlusion_d = {0, 0, 0};
  EXPECT_EQ(length(split_sum_shade(brdf_lut(), {}, diffuse)), 0);
  ShadePoint<double> turned = p;
  turned.normal = -p.normal;
  EXPECT_LT(length(split_sum_shade(brdf_lut(), {}, turned) - both), 1e-12);
}

// By hand at n.v = 1/4: (3/4)^5 = 243/1024.
TEST(Shading, FresnelModesAsPublished) {
  const double c5 = 243.0 / 1024;
  EXPECT_NEAR(fresnel_term(FresnelMode::kPaper, 0.04, 0.5, 0.25).value, 0.04 + 0.46 * c5, 1e-15);
  EXPECT_NEAR(fresnel_term(FresnelMode::kPaper, 0.04, 0.99, 0.25).value, 0.04 - 0.03 * c5, 1e-15);
  EXPECT_NEAR(fresnel_term(FresnelMode::kCode, 0.04, 0.5, 0.25).value, 0.04 + 0.46 * c5, 1e-15);
  EXPECT_NEAR(fresnel_term(FresnelMode::kCode, 0.04, 0.99, 0.25).value, 0.04, 1e-15);
}

TEST(Shading, AdjointFollowsCentralDifferences) {
  Random random(8);
  const int64_t n = 24;
  for (const FresnelMode mode : kModes) {
    for (const bool compensate : {false, true}) {
      for (const int channels : {1, 3}) {
        const ShadeOptions options{mode, compensate};
        // The nine inputs in one array, each at its offset.
        std::vector<size_t> at{0};
        for (const int width : {3, 3, 3, 1, 1, 3, 3, channels, channels}) at.push_back(at.back() + size_t(width * n));
        std::vector<double> x = random.uniforms(at[9], 0.05, 0.95);
        const std::vector<double> directions = random.directions(2 * n), g = random.uniforms(3 * n, -1, 1);
        std::copy(directions.begin(), directions.end(), x.begin());
        std::vector<double> gradient(x.size()), radiance(3 * n);
        const auto arrays = [&](auto* p) {
          return ShadeArrays<std::remove_pointer_t<decltype(p)>>{p + at[0], p + at[1], p + at[2], p + at[3],
                                                                 p + at[4], p + at[5], p + at[6], p + at[7],
                                                                 p + at[8], nullptr,   nullptr};
        };
        const auto f = [&] {
          cpu::run(n, ShadeBody<double>{brdf_lut(), options, channels, arrays(static_cast<const double*>(x.data())),
                                        radiance.data()});
          return inner(g, radiance);
        };
        cpu::run(n,
                 ShadeBackwardBody<double>{brdf_lut(), options, channels, arrays(static_cast<const double*>(x.data())),
                                           g.data(), arrays(gradient.data())});
        const std::string what = "mode " + std::to_string(int(mode)) + " compensate " + std::to_string(compensate) +
                                 " channels " + std::to_string(channels);
        expect_gradient(f, x, gradient, 1e-6, what.c_str(), 1e-6);
      }
    }
  }
}

TEST(Shading, FloatFollowsDouble) {
  Random random(9);
  for (int i = 0; i < 200; ++i) {
    ShadePoint<double> p = white_point(random);
    p.albedo = {random.uniform(), random.uniform(), random.uniform()}, p.metallic = random.uniform();
    p.indirect_s = {random.uniform(), 0, 2}, p.indirect_d = {0, random.uniform(), 1};
    ShadePoint<float> q;
    const auto narrow = [](Vec3<double> v) { return Vec3<float>{float(v.x), float(v.y), float(v.z)}; };
    q = {narrow(p.normal),      narrow(p.view),       narrow(p.albedo),    float(p.roughness),
         float(p.metallic),     narrow(p.specular),   narrow(p.diffuse),   narrow(p.occlusion_s),
         narrow(p.occlusion_d), narrow(p.indirect_s), narrow(p.indirect_d)};
    const Vec3<double> exact = split_sum_shade(brdf_lut(), {}, p);
    const Vec3<float> got = split_sum_shade(brdf_lut(), {}, q);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(got[c], exact[c], 2e-5);
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
