// Occlusion factors against closed forms of geometry and light.
#include "splitnerf/occlusion.h"

#include "check.h"
#include "meshes.h"
#include "splitnerf/environment.h"
#include "splitnerf/kernels.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf {
namespace {

constexpr int kHeight = 16, kWidth = 32;
constexpr OcclusionOptions kFine{8192, 8192, 0.0125f, 1};

template <class Light> std::vector<double> environment(Light light) {
  std::vector<double> map;
  for (int row = 0; row < kHeight; ++row)
    for (int column = 0; column < kWidth; ++column)
      for (int c = 0; c < 3; ++c)
        map.push_back(light(equirect_to_direction(Vec2<double>{(column + 0.5) / kWidth, (row + 0.5) / kHeight}), c));
  return map;
}
std::vector<double> constant(double value) {
  return environment([=](Vec3<double>, int) { return value; });
}

struct Factors {
  std::vector<double> d, s;
};
Factors factors(const Scene& scene, const std::vector<double>& positions, const std::vector<double>& normals,
                const std::vector<double>& lobes, double roughness, const std::vector<double>& map,
                OcclusionOptions options = kFine) {
  const size_t n = positions.size() / 3;
  Factors out{std::vector<double>(3 * n, -7), std::vector<double>(3 * n, -7)};
  const std::vector<double> rho(n, roughness);
  cpu::occlusion_factors(scene, options, int64_t(n), positions.data(), normals.data(), lobes.data(), rho.data(),
                         kHeight, kWidth, map.data(), out.d.data(), out.s.data());
  return out;
}

// Unit sphere with its centre at height `height` over the origin.
TestMesh lifted_sphere(float height) {
  TestMesh mesh = sphere_mesh(128, 256);
  for (size_t i = 2; i < mesh.vertices.size(); i += 3) mesh.vertices[i] += height;
  return mesh;
}

// The scene needs a tracer; a build without Embree leaves that to its host program.
class Occlusion : public testing::Test {
 protected:
  void SetUp() override {
    if (!*embree_version()) GTEST_SKIP() << "this build has no Embree";
  }
};

// Every instruction set's fans against the formulas, one ray at a time.
template <class T> void expect_fans_match(double tolerance) {
  Random random(5);
  constexpr int64_t kRays = 37;
  const int64_t n_padded = padded_fan(kRays);
  std::vector<T> u = random.uniforms<T>(n_padded), v = random.uniforms<T>(n_padded), map(3 * kHeight * kWidth);
  for (T& texel : map) texel = T(random.uniform());
  for (const Kernels<T>& set : usable_kernels<T>()) {
    for (const double alpha : {0.01, 0.3, 0.999, 1.0}) {
      const Vec3<T> axis = random.direction<T>(), normal = random.direction<T>();
      const RayFan<T> fan{u.data(), v.data(), kRays, {T(0.3), T(0.6)}, Frame<T>(axis), ggx_lobe_edge(T(alpha)), normal};
      std::vector<float> x(n_padded), y(n_padded), z(n_padded);
      std::vector<int32_t> active(n_padded), visible(n_padded);
      set.fan_directions(fan, x.data(), y.data(), z.data(), active.data());
      Vec3<T> open{0, 0, 0}, all{0, 0, 0};
      for (int i = 0; i < n_padded; ++i) {
        visible[i] = i % 3 ? -1 : 0;
        const Vec3<T> w =
            fan.frame.to_world(sample_ggx_lobe(wrap_unit(u[i], T(0.3)), wrap_unit(v[i], T(0.6)), T(alpha)));
        if (std::abs(dot(w, normal)) > 1e-4) { ASSERT_EQ(active[i] != 0, i < kRays && dot(w, normal) > 0) << i; }
        if (!active[i]) continue;
        const double apart = length(w - Vec3<T>{T(x[i]), T(y[i]), T(z[i])});
        ASSERT_LT(apart, 4e-6) << set.name << " " << alpha << " " << i;
        const Vec3<T> light = lookup_environment(map.data(), kHeight, kWidth, Vec3<T>{T(x[i]), T(y[i]), T(z[i])});
        all += light + Vec3<T>{T(kBlackLight), T(kBlackLight), T(kBlackLight)};
        if (visible[i]) open += light + Vec3<T>{T(kBlackLight), T(kBlackLight), T(kBlackLight)};
      }
      T sums[6];
      set.fan_light(map.data(), kHeight, kWidth, n_padded, x.data(), y.data(), z.data(), active.data(), visible.data(),
                    sums);
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(sums[c], open[c], tolerance * open[c]) << set.name << " " << alpha;
        EXPECT_NEAR(sums[3 + c], all[c], tolerance * all[c]) << set.name << " " << alpha;
      }
    }
  }
}
TEST(RayFans, MatchTheFormulas) {
  expect_fans_match<float>(1e-4);
  expect_fans_match<double>(1e-12);
}

TEST(RayFans, WhatIsNotFiniteDoesNotCount) {
  const float lattice[16] = {}, nan = NAN;
  const RayFan<float> fan{lattice, lattice, 16, {0, 0}, Frame<float>({nan, 0, 1}), 0, {0, 0, 1}};
  float x[16], y[16], z[16];
  int32_t active[16];
  for (const Kernels<float>& set : usable_kernels<float>()) {
    set.fan_directions(fan, x, y, z, active);
    for (int i = 0; i < 16; ++i) {
      EXPECT_EQ(active[i], 0) << set.name;
      EXPECT_TRUE(x[i] == 0 && y[i] == 0 && z[i] == 1) << set.name;
    }
  }
}

TEST_F(Occlusion, ALoneConvexBodyIsOpenEverywhere) {
  const TestMesh mesh = sphere_mesh(32, 64);
  const Scene scene = make_scene(mesh);
  const std::vector<double> points(mesh.vertices.begin(), mesh.vertices.end());
  const auto map = environment([](Vec3<double> w, int c) { return 1 + w.z + c * square(w.x); });
  for (const double roughness : {0.1, 0.5, 1.0}) {
    const Factors o = factors(scene, points, points, points, roughness, map, {64, 64, 0.0125f, 7});
    for (size_t i = 0; i < points.size(); ++i) {
      ASSERT_EQ(o.d[i], 1) << i;
      ASSERT_EQ(o.s[i], 1) << i;
    }
  }
}

// A sphere of half angle theta straight above hides sin^2 theta of the cosine-weighted hemisphere.
TEST_F(Occlusion, UnderASphereIsClosedForm) {
  for (const float height : {1.2f, 2.f, 5.f}) {
    TestMesh mesh = lifted_sphere(height);
    add_quad(mesh, {-50, -50, 0}, {100, 0, 0}, {0, 100, 0});
    const Factors o = factors(make_scene(mesh), {0, 0, 0}, {0, 0, 1}, {0, 0, 1}, 1.0, constant(3));
    const double expected = 1 - 1 / square(height - 0.0125);
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(o.d[c], expected, 2e-3) << height;
      EXPECT_NEAR(o.s[c], expected, 2e-3) << height;  // the lobe of roughness 1 about n is the cosine's
    }
  }
}

TEST_F(Occlusion, BlackLightFallsBackToGeometry) {
  const Scene scene = make_scene(lifted_sphere(2));
  const Factors black = factors(scene, {0, 0, 0}, {0, 0, 1}, {0, 0, 1}, 0.5, constant(0));
  const Factors white = factors(scene, {0, 0, 0}, {0, 0, 1}, {0, 0, 1}, 0.5, constant(1));
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(black.d[c], white.d[c], 1e-9);
    EXPECT_NEAR(black.s[c], white.s[c], 1e-9);
  }
}

// Each channel weighs with its own light: one that only shines where the sphere stands is blocked.
TEST_F(Occlusion, EachChannelWeighsWithItsOwnLight) {
  const Scene scene = make_scene(lifted_sphere(1.2f));
  const auto map = environment([](Vec3<double> w, int c) { return c == 0 ? w.z > 0.9 : c == 1 ? w.z < 0.2 : 0.; });
  const Factors o = factors(scene, {0, 0, 0}, {0, 0, 1}, {0, 0, 1}, 1.0, map);
  EXPECT_LT(o.d[0], 1e-3);
  EXPECT_GT(o.d[1], 0.99);
}

TEST_F(Occlusion, NarrowLobesSeeWhatTheyPointAt) {
  const Scene scene = make_scene(lifted_sphere(2));
  const double s = std::sqrt(0.5);
  const Factors o = factors(scene, {0, 0, 0, 0, 0, 0}, {0, 0, 1, 0, 0, 1}, {0, 0, 1, s, 0, s}, 0.1, constant(1));
  EXPECT_LT(o.s[0], 1e-2);
  EXPECT_GT(o.s[3], 0.98);
  EXPECT_NEAR(o.d[0], o.d[3], 2e-3);
}

// Rays below the surface's horizon count in neither sum.
TEST_F(Occlusion, TheSurfaceItselfIsNoOccluder) {
  TestMesh mesh;
  add_quad(mesh, {-50, -50, 0}, {100, 0, 0}, {0, 100, 0});
  const double tilt = 0.2, c = std::sqrt(1 - tilt * tilt);
  const Factors o = factors(make_scene(mesh), {0, 0, 0}, {0, 0, 1}, {c, 0, tilt}, 0.7, constant(1));
  EXPECT_EQ(o.d[0], 1);
  EXPECT_EQ(o.s[0], 1);
}

TEST_F(Occlusion, NoRayAboveTheHorizonLeavesThePointOpen) {
  const Scene scene = make_scene(lifted_sphere(2));
  EXPECT_EQ(factors(scene, {0, 0, 0}, {0, 0, 1}, {0, 0, -1}, 0.05, constant(1)).s[0], 1);
}

}  // namespace
}  // namespace splitnerf
