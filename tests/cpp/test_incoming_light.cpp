// incoming_light against energy conservation, without torch.
#include "splitnerf/incoming_light.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <vector>

#include "meshes.h"
#include "splitnerf/principled.h"
#include "splitnerf/split_sum.h"

namespace splitnerf {
namespace {

using Vec = Vec3<float>;

// A white well of depth 2 in a white room, seen from straight above the middle of its floor, n times.
struct Well {
  static constexpr int n = 600, n_directions = 32;
  TestMesh mesh;
  float roughness = 0.6f, metallic = 0;
  std::vector<float> map = std::vector<float>(2 * 4 * 3, 1.f);
  std::vector<float> directions, solid_angles, visible, sent;

  Well() {
    add_quad(mesh, {-1, -1, 0}, {2, 0, 0}, {0, 2, 0});
    for (const Vec along : {Vec{2, 0, 0}, {0, 2, 0}}) {
      const Vec across = Vec{2, 2, 0} - along;
      add_quad(mesh, {-1, -1, 0}, along, {0, 0, 2});
      add_quad(mesh, Vec{-1, -1, 0} + across, along, {0, 0, 2});
    }
  }

  void gather(uint32_t seed = 0) {
    const size_t n_vertices = mesh.vertices.size() / 3;
    const std::vector<float> white(3 * n_vertices, 1.f), rough(n_vertices, roughness), metal(n_vertices, metallic);
    const std::vector<float> positions(3 * n, 0.f), albedo(3 * n, 1.f), rho(n, roughness), m(n, metallic);
    std::vector<float> up;
    for (int i = 0; i < n; ++i) up.insert(up.end(), {0.f, 0.f, 1.f});
    for (auto* image : {&directions, &sent}) image->assign(size_t(n) * n_directions * 3, -1.f);
    for (auto* image : {&solid_angles, &visible}) image->assign(size_t(n) * n_directions, -1.f);
    const SurfacePoints points{n,         positions.data(), up.data(),  up.data(),
                               up.data(), albedo.data(),    rho.data(), m.data()};
    incoming_light(make_scene(mesh), {white.data(), rough.data(), metal.data(), false, nullptr}, {map.data(), 2, 4},
                   points, {n_directions, 60, seed, 0.f},
                   {directions.data(), solid_angles.data(), visible.data(), sent.data()});
  }
};

TEST(IncomingLight, AWhiteWellInAWhiteRoomIsWhite) {
  for (float metallic : {0.f, 1.f}) {
    Well well;
    well.metallic = metallic;
    well.gather();
    const PrincipledBsdf<float> bsdf(brdf_lut(), {1, 1, 1}, well.roughness, metallic, {0, 0, 1});
    double reflected = 0, open = 0, solid_angle = 0;
    for (size_t i = 0; i < well.visible.size(); ++i) {
      const double f = bsdf.evaluate(load3(&well.directions[3 * i])).f_cos.x;
      reflected += well.solid_angles[i] * f * (well.visible[i] + well.sent[3 * i]) / well.n;
      open += well.visible[i] * well.solid_angles[i] / well.n;
      solid_angle += well.solid_angles[i] / well.n;
    }
    EXPECT_NEAR(reflected, 1, 0.01) << "metallic " << metallic;  // the table's error, a bounce after another
    EXPECT_NEAR(solid_angle, 2 * kPi, 0.1);
    // The opening is a square of side 2 at height 2: 4 asin(1 / (1 + 2^2)) sr.
    EXPECT_NEAR(open, 4 * std::asin(0.2), 0.05);
  }
}

TEST(IncomingLight, SeedsDecide) {
  Well first, again, other;
  first.gather(5), again.gather(5), other.gather(6);
  EXPECT_EQ(first.sent, again.sent);
  EXPECT_EQ(first.directions, again.directions);
  EXPECT_NE(first.directions, other.directions);
}

TEST(IncomingLight, RefusesLightThatIsNegative) {
  Well well;
  well.map[7] = -1;
  EXPECT_THROW(well.gather(), std::invalid_argument);
}

}  // namespace
}  // namespace splitnerf
