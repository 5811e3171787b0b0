// Kernels of the pre-integrated light, against the CPU.
#include "check.h"
#include "gpu.h"
#include "runtime/cuda_on_cpu.h"
#include "splitnerf/light_tables.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/ops_cuda.h"
#include "splitnerf/bodies/prefilter.h"

namespace splitnerf {
namespace {

template <class T> void check_prefilter(int64_t n_queries, int64_t n_lights, double tolerance) {
  Random random(6);
  const auto dirs = random.directions<T>(n_queries), lights = random.directions<T>(n_lights);
  const auto rho = random.uniforms<T>(n_queries), radiance = random.uniforms<T>(3 * n_lights),
             g = random.uniforms<T>(3 * n_queries, -1);
  auto gbar = unwritten<T>(3 * n_queries), total = unwritten<T>(n_queries), to_light = unwritten<T>(3 * n_lights);
  auto gbar1 = gbar, total1 = total, to_light1 = to_light;
  Gpu gpu;
  cpu::prefilter_light(n_queries, dirs.data(), rho.data(), n_lights, lights.data(), radiance.data(), gbar.data(),
                       total.data());
  cuda::prefilter_light(gpu.queue(), n_queries, dirs.data(), rho.data(), n_lights, lights.data(), radiance.data(),
                        gbar1.data(), total1.data());
  expect_near(gbar1, gbar, tolerance), expect_near(total1, total, tolerance);
  cpu::prefilter_light_backward(n_queries, dirs.data(), rho.data(), total.data(), g.data(), n_lights, lights.data(),
                                to_light.data());
  cuda::prefilter_light_backward(gpu.queue(), n_queries, dirs.data(), rho.data(), total.data(), g.data(), n_lights,
                                 lights.data(), to_light1.data());
  expect_near(to_light1, to_light, tolerance);
}

// Blocks of 256 items, tiles of 128 sources, parts of at least 256.
TEST(LightKernels, PrefilteredLight) {
  ASSERT_GT(lobe_parts(23, 700), 1);
  for (const auto& [queries, lights] : std::initializer_list<std::pair<int64_t, int64_t>>{
           {23, 700}, {0, 5}, {5, 0}, {1, 1}, {300, 129}, {129, 300}, {256, 128}}) {
    check_prefilter<double>(queries, lights, 1e-13);
    check_prefilter<float>(queries, lights, 1e-4);
  }
}

TEST(LightKernels, PartsCoverTheList) {
  for (const int64_t items : {int64_t{0}, int64_t{1}, int64_t{16384}, int64_t{1} << 30})
    for (const int64_t sources : {0, 1, 255, 8192, 1 << 20}) {
      const int n_parts = lobe_parts(items, sources);
      ASSERT_GE(n_parts, 1);
      ASSERT_LE(n_parts, 64);
      EXPECT_EQ(part_begin(sources, 0, n_parts), 0);
      EXPECT_EQ(part_begin(sources, n_parts, n_parts), sources);
    }
  EXPECT_EQ(lobe_parts(16384, 8192), 16);
  EXPECT_EQ(lobe_parts(1 << 20, 8192), 1);
}

template <class T> struct Pyramid {
  std::vector<T> levels, sh, zonal;
  LightPyramid<T> view{};

  explicit Pyramid(Random& random) {
    levels = random.uniforms<T>(3 * (16 * 16 + 8 * 8), 0.1, 1.1),
    sh = random.uniforms<T>(3 * kShCoefficients, -0.05, 0.05);
    sh[0] = sh[1] = sh[2] = 3;
    for (const double factor : zonal_factors(0.5, 9)) zonal.push_back(T(factor));
    // So little of the constant that the sums lie about the floor, those of the second channel close to it.
    for (size_t row = 0; row < zonal.size(); row += kShBands) zonal[row] *= T(1e-3);
    for (int i = 1; i < kShCoefficients; ++i) sh[3 * i + 1] *= T(0.01);
    view.levels = levels.data(), view.sh = sh.data(), view.zonal = zonal.data(), view.n_levels = 2, view.n_zonal = 9;
    view.resolution[0] = 16, view.resolution[1] = 8, view.offset[1] = 16 * 16;
    view.node[0] = T(0.05), view.node[1] = T(0.3), view.node[2] = T(0.5);
    view.recurrence = &sh_recurrence<T>();
  }
};

template <class T> void check_lookup(int64_t n, double tolerance) {
  Random random(8);
  const Pyramid<T> pyramid(random);
  const LightPyramid<T>& p = pyramid.view;
  const auto dirs = random.directions<T>(n), g = random.uniforms<T>(3 * n, -1);
  auto rho = random.uniforms<T>(n);
  const T special[] = {T(0.5), T(0.3), T(0.05), T(1), T(0)};
  std::copy_n(special, std::min<int64_t>(n, 5), rho.begin());
  auto radiance = unwritten<T>(3 * n), to_dirs = unwritten<T>(3 * n), to_rho = unwritten<T>(n),
       to_levels = unwritten<T>(pyramid.levels.size()), to_sh = unwritten<T>(pyramid.sh.size());
  auto radiance1 = radiance, to_dirs1 = to_dirs, to_rho1 = to_rho, to_levels1 = to_levels, to_sh1 = to_sh;
  cpu::run(n, LightLookupBody<T>{p, *p.recurrence, dirs.data(), rho.data(), radiance.data()});
  on_gpu(n, LightLookupBody<T>{p, *p.recurrence, dirs.data(), rho.data(), radiance1.data()});
  Gpu gpu;
  cpu::light_lookup_backward(p, n, dirs.data(), rho.data(), g.data(), to_dirs.data(), to_rho.data(), to_levels.data(),
                             to_sh.data());
  cuda_on_cpu::take_counts();
  cuda::light_lookup_backward(gpu.queue(), p, n, dirs.data(), rho.data(), g.data(), to_dirs1.data(), to_rho1.data(),
                              to_levels1.data(), to_sh1.data());
  EXPECT_LE(cuda_on_cpu::take_counts().atomics,  // four texels of two levels at most, in three channels
            24 * n + 3 * kShCoefficients * std::min<int64_t>((n + 31) / 32, 1024));
  expect_near(radiance1, radiance, tolerance), expect_near(to_dirs1, to_dirs, 10 * tolerance);
  expect_near(to_rho1, to_rho, 10 * tolerance);
  expect_near(to_levels1, to_levels, tolerance), expect_near(to_sh1, to_sh, tolerance);
}

TEST(LightKernels, Lookup) {
  for (const int64_t n : {0, 1, 32, 203, 300}) check_lookup<double>(n, 1e-13);
  check_lookup<float>(203, 1e-4);
}
// The most blocks that there are, of 32 points each, all have a tile, and some a second one.
TEST(LightKernels, LookupOfMoreTilesThanBlocks) { check_lookup<double>(32 * 1024 + 41, 1e-12); }

}  // namespace
}  // namespace splitnerf
