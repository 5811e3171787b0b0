// The pre-integrated light where there is none, and the instruction sets. Its values: tests/reference.py.
#include "splitnerf/prefilter.h"

#include "check.h"
#include "splitnerf/kernels.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf {
namespace {

TEST(Prefilter, NoLightAboveTheHorizonGivesBlack) {
  const std::vector<double> query{0, 0, 1}, roughness{0.5}, direction{0, 0, -1}, ones(3, 1);
  std::vector<double> out(3, -7), total(1), gradient(3, -7);
  cpu::prefilter_light(1, query.data(), roughness.data(), 1, direction.data(), ones.data(), out.data(), total.data());
  EXPECT_EQ(out, std::vector<double>(3, 0));
  cpu::prefilter_light_backward<double>(1, query.data(), roughness.data(), total.data(), ones.data(), 1,
                                        direction.data(), gradient.data());
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
