// The pre-integrated light: exact lights, linearity, the transpose, and the error of a rotated lattice.
#include "splitnerf/prefilter.h"

#include "check.h"
#include "splitnerf/kernels.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/sampling.h"

namespace splitnerf {
namespace {

constexpr double kRoughness[] = {0.1, 0.2, 0.3, 0.5, 0.7, 1.0};

struct Lights {
  std::vector<double> directions, radiance;
};

template <class Light> Lights lattice(uint32_t n, const Frame<double>& rotation, Light light) {
  Lights lights{std::vector<double>(3 * n), std::vector<double>(3 * n)};
  for (uint32_t i = 0; i < n; ++i) {
    const Vec3<double> w = rotation.to_world(fibonacci_sphere<double>(i, n));
    store3(&lights.directions[3 * i], w);
    store3(&lights.radiance[3 * i], light(w));
  }
  return lights;
}

std::vector<double> gbar(const std::vector<double>& queries, const std::vector<double>& roughness, const Lights& lights,
                         std::vector<double>* total = nullptr) {
  std::vector<double> out(queries.size()), sums(roughness.size());
  cpu::prefilter_light(int64_t(roughness.size()), queries.data(), roughness.data(), int64_t(lights.radiance.size() / 3),
                       lights.directions.data(), lights.radiance.data(), out.data(), sums.data());
  if (total) *total = sums;
  return out;
}

const Frame<double> kUnturned(Vec3<double>{0, 0, 1});

// A smooth sky: blue gradient over a brown floor and a soft warm glow of half-width 30 degrees, 4 times as bright.
Vec3<double> sky(Vec3<double> w) {
  const double up = 1 / (1 + std::exp(-6 * w.z)),
               glow = 4 * std::exp(8 * (dot(w, normalize(Vec3<double>{1, 0.5, 0.7})) - 1));
  return Vec3<double>{0.3, 0.5, 0.9} * (up * (0.6 + 0.4 * w.z)) + Vec3<double>{0.2, 0.15, 0.1} * (1 - up) +
         Vec3<double>{1, 0.8, 0.5} * glow;
}

TEST(Prefilter, ConstantLightStaysItselfAtEveryRoughness) {
  Random random(1);
  const size_t n = 200;
  const std::vector<double> queries = random.directions(n);
  std::vector<double> roughness = random.uniforms(n);
  roughness[0] = 0, roughness[1] = 1;
  const std::vector<double> out =
      gbar(queries, roughness, lattice(500, kUnturned, [](Vec3<double>) { return Vec3<double>{0.5, 2, 7}; }));
  for (size_t i = 0; i < n; ++i) {
    EXPECT_NEAR(out[3 * i], 0.5, 1e-12);
    EXPECT_NEAR(out[3 * i + 1], 2, 1e-12);
    EXPECT_NEAR(out[3 * i + 2], 7, 1e-12);
  }
}

// L = 1 + k.w: at rho = 1 the lobe is cos / pi, so gbar = 1 + (2/3) k.n.
TEST(Prefilter, RoughestLobeOfALinearLightIsClosedForm) {
  Random random(2);
  const Vec3<double> k{0.3, -0.2, 0.5};
  const std::vector<double> queries = random.directions(50), roughness(50, 1.0);
  const Lights lights =
      lattice(20000, kUnturned, [&](Vec3<double> w) { return Vec3<double>{1, 1, 1} * (1 + dot(k, w)); });
  const std::vector<double> out = gbar(queries, roughness, lights);
  for (size_t i = 0; i < 50; ++i) EXPECT_NEAR(out[3 * i], 1 + dot(k, load3(&queries[3 * i])) * 2 / 3, 1e-4);
}

TEST(Prefilter, IsLinearInTheLight) {
  Random random(3);
  const std::vector<double> queries = random.directions(40), roughness = random.uniforms(40);
  Lights a = lattice(700, kUnturned, sky), b = a, both = a;
  b.radiance = random.uniforms(a.radiance.size());
  for (size_t i = 0; i < a.radiance.size(); ++i) both.radiance[i] = 2 * a.radiance[i] - 3 * b.radiance[i];
  const std::vector<double> ga = gbar(queries, roughness, a), gb = gbar(queries, roughness, b),
                            g = gbar(queries, roughness, both);
  for (size_t i = 0; i < g.size(); ++i) EXPECT_NEAR(g[i], 2 * ga[i] - 3 * gb[i], 1e-12);
}

// Linear in the light: <g, gbar(light)> = <gradient, light>. Central differences say the same.
TEST(Prefilter, BackwardIsTheTranspose) {
  Random random(4);
  const size_t n = 37;
  const std::vector<double> queries = random.directions(n), roughness = random.uniforms(n, 0.05),
                            g = random.uniforms(3 * n, -1);
  Lights lights = lattice(45, kUnturned, sky);
  std::vector<double> total, gradient(lights.radiance.size());
  const std::vector<double> out = gbar(queries, roughness, lights, &total);
  cpu::prefilter_light_backward(int64_t(n), queries.data(), roughness.data(), total.data(), g.data(), 45,
                                lights.directions.data(), gradient.data());
  EXPECT_NEAR(inner(gradient, lights.radiance), inner(g, out), 1e-12);
  expect_gradient([&] { return inner(g, gbar(queries, roughness, lights)); }, lights.radiance, gradient, 1e-6, "light",
                  1e-4);
}

TEST(Prefilter, WeightsAreTheLobe) {
  // Up to the common factor pi a^2 this is D (w.w_s)+.
  Random random(5);
  for (int i = 0; i < 200; ++i) {
    const Vec3<double> a = random.direction(), b = random.direction(), d = a - b;
    const double ggx_alpha = random.uniform(0.01, 1);
    EXPECT_NEAR(prefilter_weight(d.x, d.y, d.z, ggx_alpha * ggx_alpha),
                kPi * ggx_alpha * ggx_alpha * ggx_d(ggx_alpha, sin2_half_angle(a, b)) * std::max(dot(a, b), 0.0),
                1e-12);
  }
}

TEST(Prefilter, NoLightAboveTheHorizonGivesBlack) {
  Lights lights{{0, 0, -1}, {1, 1, 1}};
  std::vector<double> total, gradient(3, -7);
  const std::vector<double> out = gbar({0, 0, 1}, {0.5}, lights, &total), g{1, 1, 1}, query{0, 0, 1}, roughness{0.5};
  EXPECT_EQ(out, std::vector<double>(3, 0));
  cpu::prefilter_light_backward<double>(1, query.data(), roughness.data(), total.data(), g.data(), 1,
                                        lights.directions.data(), gradient.data());
  EXPECT_EQ(gradient, std::vector<double>(3, 0));
}

// 8192 directions under a random rotation, the smooth sky above, against 400,000 directions.
TEST(Prefilter, RotatedFibonacciErrorAtTheRoughestIsSmall) {
  Random random(6);
  const size_t n = 24;
  const std::vector<double> queries = random.directions(n);
  const Lights fine = lattice(400000, kUnturned, sky);
  for (const double rho : {0.5, 1.0}) {
    const std::vector<double> roughness(n, rho), reference = gbar(queries, roughness, fine);
    double error = 0, iid_error = 0, scale = 0;
    for (int turn = 0; turn < 8; ++turn) {
      const Lights turned = lattice(8192, Frame<double>(random.direction()), sky);
      Lights iid{random.directions(8192), std::vector<double>(3 * 8192)};
      for (int i = 0; i < 8192; ++i) store3(&iid.radiance[3 * i], sky(load3(&iid.directions[3 * i])));
      const std::vector<double> got = gbar(queries, roughness, turned), noisy = gbar(queries, roughness, iid);
      for (size_t i = 0; i < got.size(); ++i) {
        error += square(got[i] - reference[i]), iid_error += square(noisy[i] - reference[i]);
        scale += square(reference[i]);
      }
    }
    const double relative = std::sqrt(error / scale), iid_relative = std::sqrt(iid_error / scale);
    EXPECT_LT(relative, 3e-3) << rho;
    EXPECT_LT(relative, 0.5 * iid_relative) << rho;
    RecordProperty("relative_rmse_" + std::to_string(int(rho * 10)),
                   std::to_string(relative) + " iid " + std::to_string(iid_relative));
  }
}

// The mean over exact lobe samples estimates the same integral, narrow lobes included.
TEST(Prefilter, LobeSamplesAgreeWithTheSharedSet) {
  const Lights fine = lattice(400000, kUnturned, sky);
  Random random(7);
  const std::vector<double> queries = random.directions(6);
  for (const double rho : kRoughness) {
    const std::vector<double> roughness(6, rho), reference = gbar(queries, roughness, fine);
    std::vector<double> samples(3 * 6 * 1024);
    cpu::run(6, SampleLobeBody<double>{queries.data(), roughness.data(), 1024, 3, samples.data()});
    for (size_t i = 0; i < 6; ++i) {
      Vec3<double> mean{0, 0, 0};
      for (int k = 0; k < 1024; ++k) mean += sky(load3(&samples[3 * (1024 * i + k)])) / 1024.0;
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(mean[c] / reference[3 * i + c], 1, 0.01) << "rho " << rho;
    }
  }
}

TEST(Prefilter, FloatFollowsDouble) {
  Random random(8);
  const size_t n = 64;
  const std::vector<float> queries = random.directions<float>(n);
  std::vector<float> roughness = random.uniforms<float>(n, 0.05);
  const Lights lights = lattice(8192, kUnturned, sky);
  const std::vector<float> directions(lights.directions.begin(), lights.directions.end()),
      radiance(lights.radiance.begin(), lights.radiance.end());
  std::vector<float> out(3 * n), total(n);
  cpu::prefilter_light<float>(int64_t(n), queries.data(), roughness.data(), 8192, directions.data(), radiance.data(),
                              out.data(), total.data());
  const std::vector<double> exact = gbar({queries.begin(), queries.end()}, {roughness.begin(), roughness.end()},
                                         {{directions.begin(), directions.end()}, {radiance.begin(), radiance.end()}});
  for (size_t i = 0; i < exact.size(); ++i) EXPECT_NEAR(out[i] / exact[i], 1, 1e-4) << i;
}

template <class T> void every_lobe_kernel_agrees_with_base() {
  Random random(9);
  const int64_t n_queries = 33, n_lights = 517;
  const auto plane = [&](int64_t n) { return random.uniforms<T>(size_t(n), -0.57, 0.57); };
  const auto qx = plane(n_queries), qy = plane(n_queries), qz = plane(n_queries), g = plane(n_queries);
  const auto a2 = random.uniforms<T>(size_t(n_queries), 0.01);
  const auto lx = plane(n_lights), ly = plane(n_lights), lz = plane(n_lights), light = plane(n_lights);
  const LobeSide<T> queries{qx.data(), qy.data(), qz.data(), a2.data(), g.data(), g.data(), g.data(), n_queries};
  const LobeSide<T> lights{lx.data(),    ly.data(),    lz.data(),    nullptr,
                           light.data(), light.data(), light.data(), n_lights};
  std::vector<T> base_gather, base_scatter;
  for (const Kernels<T>& k : usable_kernels<T>()) {
    std::vector<T> gather(4 * n_queries), scatter(3 * n_lights);
    k.lobe_gather(queries, lights, 0, n_queries, gather.data());
    k.lobe_scatter(queries, lights, 0, n_lights, scatter.data());
    if (base_gather.empty()) base_gather = gather, base_scatter = scatter;
    const double tolerance =
        sizeof(T) == 4 ? 1e-4 : 1e-12;  // 1e-6 and 1e-14 of the sum of the weights, in the hundreds
    for (size_t i = 0; i < gather.size(); ++i) {
      const double weights = base_gather[4 * (i / 4) + 3];
      ASSERT_NEAR(gather[i], base_gather[i], 0.01 * tolerance * (1 + weights)) << k.name;
    }
    for (size_t i = 0; i < scatter.size(); ++i) ASSERT_NEAR(scatter[i], base_scatter[i], tolerance) << k.name;
  }
}

TEST(LobeKernels, EveryInstructionSetAgreesWithBase) {
  every_lobe_kernel_agrees_with_base<float>();
  every_lobe_kernel_agrees_with_base<double>();
}

}  // namespace
}  // namespace splitnerf
