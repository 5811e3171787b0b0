// The pre-integrated light: exact lights, the lobe, and the instruction sets.
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
