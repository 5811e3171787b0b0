// Rays against meshes whose visibility is known in closed form.
#include "splitnerf/scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "meshes.h"
#include "splitnerf/sampling.h"

namespace splitnerf {
namespace {

using Vec = Vec3<float>;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

std::vector<uint8_t> visibility(const Scene& scene, const std::vector<Vec>& origins,
                                const std::vector<Vec>& directions) {
  std::vector<uint8_t> visible(origins.size(), 7);
  scene.trace_visibility(reinterpret_cast<const float*>(origins.data()),
                         reinterpret_cast<const float*>(directions.data()), int64_t(origins.size()), kInfinity,
                         visible.data());
  return visible;
}

TEST(Scene, CubeHitsStandAtTheirClosedFormDistance) {
  const Scene scene = make_scene(cube_mesh());
  for (uint32_t i = 0; i < 2000; ++i) {
    // From the centre a ray leaves the cube [-1, 1]^3 at t = 1 / max |d|.
    const Vec d = fibonacci_sphere<float>(i, 2000);
    const float expected = 1.f / max_of(std::abs(d.x), max_of(std::abs(d.y), std::abs(d.z)));
    const Hit hit = scene.trace_closest({0, 0, 0}, d, kInfinity);
    ASSERT_NEAR(hit.t, expected, 1e-5f) << i;
    ASSERT_LT(hit.triangle, 12u);
    EXPECT_TRUE(hit.u >= -1e-5f && hit.v >= -1e-5f && hit.u + hit.v <= 1 + 1e-5f);
    EXPECT_TRUE(scene.occluded({0, 0, 0}, d, expected * 1.001f));
    EXPECT_FALSE(scene.occluded({0, 0, 0}, d, expected * 0.999f));
  }
  EXPECT_LT(scene.trace_closest({3, 0, 0}, {1, 0, 0}, kInfinity).t, 0);
}

TEST(Scene, EveryCountIsHandled) {
  const Scene scene = make_scene(cube_mesh());
  for (int n : {0, 1, 15, 16, 17, 4095, 4097}) {
    std::vector<Vec> origins(n, Vec{0, 0, 0}), directions(n);
    for (int i = 0; i < n; ++i) {
      if (i % 5 == 0) origins[i] = {0, 0, 5};
      directions[i] = {0, 0, 1};
    }
    const auto all = visibility(scene, origins, directions);
    for (int i = 0; i < n; ++i) ASSERT_EQ(all[i], i % 5 == 0) << n << " " << i;
  }
}

TEST(Scene, PacketsAgreeWithSingleRays) {
  const Scene scene = make_scene(sphere_mesh(20, 40));
  std::vector<Vec> origins, directions;
  for (uint32_t i = 0; i < 5003; ++i) {
    origins.push_back(fibonacci_sphere<float>(i, 5003) * (0.5f + 2 * random_unit<float>(i, 0)));
    directions.push_back(sample_uniform_sphere(random_unit<float>(i, 1), random_unit<float>(i, 2)));
  }
  const auto visible = visibility(scene, origins, directions);
  std::vector<Hit> hits(origins.size());
  scene.trace_closest(&origins[0].x, &directions[0].x, int64_t(origins.size()), kInfinity, hits.data());
  for (size_t i = 0; i < origins.size(); ++i) {
    ASSERT_EQ(visible[i], !scene.occluded(origins[i], directions[i], kInfinity)) << i;
    ASSERT_EQ(visible[i], hits[i].t < 0) << i;
  }
}

TEST(Scene, RaysWithTracesOfRoundingMeetWhatIsThere) {
  // Up to the lamp above a sphere, from points below it: x and y of points in its planes of symmetry are about 1e-22.
  const Scene scene = make_scene(sphere_mesh(64, 128));
  for (const float trace : {0.f, 3e-22f, 6.6e-22f, 1e-20f, 1e-15f}) {
    std::vector<Vec> origins, directions;
    for (uint32_t i = 0; i < 1024; ++i) {
      const float across = 0.5f * random_unit<float>(i, 0) - 0.25f;
      origins.push_back(i % 2 ? Vec{trace, across, -2} : Vec{across, -trace, -2});
      directions.push_back(normalize(Vec{0, 0, 3} - origins.back()));
    }
    for (uint8_t v : visibility(scene, origins, directions)) ASSERT_EQ(v, 0) << trace;
    std::vector<Hit> hits(origins.size());
    scene.trace_closest(&origins[0].x, &directions[0].x, int64_t(origins.size()), kInfinity, hits.data());
    for (const Hit& hit : hits) ASSERT_GT(hit.t, 0) << trace;
  }
}

TEST(Scene, RegistryNamesScenesUntilTheyAreReleased) {
  const TestMesh mesh = cube_mesh();
  auto scene = std::make_shared<const Scene>(mesh.vertices.data(), 8, mesh.triangles.data(), 12);
  const int64_t first = register_scene(scene), second = register_scene(scene);
  EXPECT_NE(first, second);
  EXPECT_EQ(get_scene(first), scene);
  release_scene(first);
  EXPECT_THROW(get_scene(first), std::out_of_range);
  EXPECT_EQ(get_scene(second), scene);
  release_scene(second);
  release_scene(second);  // releasing twice is harmless
  EXPECT_EQ(scene.use_count(), 1);
  EXPECT_NE(register_scene(scene), first);
}

}  // namespace
}  // namespace splitnerf
