// The path tracer against energy conservation and closed forms.
#include "splitnerf/path_tracer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <stdexcept>
#include <vector>

#include "render_job.h"
#include "splitnerf/parallel.h"
#include "splitnerf/principled.h"

namespace splitnerf {
namespace {

using Vec = Vec3<float>;

// Mean of radiance / alpha, and the largest deviation from `expected`, over covered pixels.
struct Furnace {
  double mean = 0, worst = 0;
};
Furnace compare(const Image& image, float expected) {
  Furnace f;
  int n = 0;
  for (size_t i = 0; i < image.alpha.size(); ++i) {
    if (image.alpha[i] < 1) continue;
    for (int c = 0; c < 3; ++c, ++n) {
      f.mean += image.radiance[i * 3 + c];
      f.worst = std::max(f.worst, std::abs(double(image.radiance[i * 3 + c]) - expected));
    }
  }
  EXPECT_GT(n, 300);
  f.mean /= n;
  return f;
}

TEST(PathTracer, WhiteFurnaceReturnsWhite) {
  // Nothing is absorbed, so a white object vanishes in a white room. Errors: the table's bilinear
  // lookup, noise, and bent normals at the silhouette.
  for (float metallic : {0.f, 0.5f, 1.f}) {
    for (float roughness : {0.05f, 0.25f, 0.5f, 0.75f, 1.f}) {
      RenderJob s = sphere_setup();
      s.metallic = metallic, s.roughness = roughness;
      const Image image = s.render();
      const Furnace f = compare(image, 1.f);
      double radiance = 0, alpha = 0;  // pixels of the outline included: premultiplied
      for (size_t i = 0; i < image.alpha.size(); ++i) radiance += image.radiance[i * 3], alpha += image.alpha[i];
      EXPECT_NEAR(radiance / alpha, 1, 0.004) << "metallic " << metallic << " roughness " << roughness;
      EXPECT_NEAR(f.mean, 1, 0.002) << "metallic " << metallic << " roughness " << roughness;
      EXPECT_LT(f.worst, 0.06) << "metallic " << metallic << " roughness " << roughness;
    }
  }
}

TEST(PathTracer, WhiteFurnaceHoldsInConcavities) {
  // A white well of depth 2 in a white room: all bounces together bring back 1. Paths are long
  // here, so that Russian roulette must keep the balance too.
  RenderJob s;
  add_quad(s.mesh, {-1, -1, 0}, {2, 0, 0}, {0, 2, 0});
  for (const Vec along : {Vec{2, 0, 0}, {0, 2, 0}}) {
    const Vec across = Vec{2, 2, 0} - along;
    add_quad(s.mesh, {-1, -1, 0}, along, {0, 0, 2});
    add_quad(s.mesh, Vec{-1, -1, 0} + across, along, {0, 0, 2});
  }
  s.camera = look_at_origin({0.6f, 0.3f, 6}, 16, 1.2f);
  s.params.samples_per_pixel = 256;
  s.params.max_bounces = 60;
  s.roughness = 1.f;
  EXPECT_NEAR(compare(s.render(), 1.f).mean, 1, 0.003);
  s.metallic = 1.f;
  EXPECT_NEAR(compare(s.render(), 1.f).mean, 1, 0.008);  // the table's error, a bounce after another
}

TEST(PathTracer, DiffuseSphereUnderTheSkyFollowsTheCosineLaw) {
  // Irradiance of a half-bright sky on a plane tilted by theta: pi (1 + cos theta) / 2. The
  // specular layer of F0 = 0.04 is taken off by the difference of a white and a black sphere.
  RenderJob s = sphere_setup(48);
  s.roughness = 1.f;
  s.set_map(128, 256, [](Vec d) { return d.z > 0 ? 1.f : 0.f; });
  s.albedo = {0.5f, 0.5f, 0.5f};
  const Image grey = s.render();
  s.albedo = {0.f, 0.f, 0.f};
  const Image black = s.render();
  double mean_error = 0;
  int n = 0;
  for (size_t i = 0; i < grey.alpha.size(); ++i) {
    if (grey.alpha[i] < 1) continue;
    const Vec normal = normalize(load3(&grey.normal[i * 3]));
    const Vec eye{s.camera.camera_to_world[3], s.camera.camera_to_world[7], s.camera.camera_to_world[11]};
    const float cosine = dot(normal, normalize(eye - normal));
    if (cosine < 0.3f) continue;
    const Vec table = sample_brdf_lut(brdf_lut(), cosine, 1.f).value;
    const float gain = 1 + 0.04f * (1 / (table.x + table.y) - 1);
    const float e = sample_brdf_lut(brdf_lut(), cosine, 1.f).dielectric * gain;
    const double expected = (1 - e) * 0.5 * (1 + normal.z) / 2;
    mean_error += std::abs(grey.radiance[i * 3] - black.radiance[i * 3] - expected);
    ++n;
  }
  EXPECT_GT(n, 500);
  EXPECT_LT(mean_error / n, 0.004);
}

// A metal ball over a floor under a small bright sun and a dim sky.
RenderJob sun_setup(float roughness, float metallic) {
  RenderJob s;
  s.mesh = sphere_mesh(32, 64);
  add_quad(s.mesh, {-2, -2, -1}, {4, 0, 0}, {0, 4, 0});
  s.roughness = roughness, s.metallic = metallic, s.albedo = {0.7f, 0.6f, 0.5f};
  s.camera = look_at_origin({3, 2, 2}, 12, 3.f);
  const Vec sun = normalize(Vec{1, -0.5f, 1.5f});
  s.set_map(32, 64, [=](Vec d) { return dot(d, sun) > 0.97f ? 30.f : 0.3f + 0.2f * d.z; });
  return s;
}

TEST(PathTracer, LightSamplingAgreesWithBsdfSampling) {
  for (float metallic : {0.f, 1.f}) {
    for (float roughness : {0.2f, 0.6f}) {
      RenderJob s = sun_setup(roughness, metallic);
      s.params.samples_per_pixel = 1024;
      const Image both = s.render();
      s.params.light_sampling = false;
      s.params.samples_per_pixel = 8192;
      const Image single = s.render();
      double sum_both = 0, sum_single = 0;
      for (size_t i = 0; i < both.radiance.size(); ++i) sum_both += both.radiance[i], sum_single += single.radiance[i];
      EXPECT_NEAR(sum_both / sum_single, 1, 0.01) << "metallic " << metallic << " roughness " << roughness;
    }
  }
}

TEST(PathTracer, ClampLimitsIndirectLightOnly) {
  RenderJob s = sun_setup(0.2f, 1.f);
  s.params.clamp_indirect = 1e-6f;
  const Image clamped = s.render();
  s.params.clamp_indirect = 0;
  s.params.max_bounces = 0;
  const Image direct = s.render();
  for (size_t i = 0; i < direct.radiance.size(); ++i) {
    ASSERT_NEAR(clamped.radiance[i], direct.radiance[i], 1e-4f * (1 + direct.radiance[i]));
  }
}

TEST(PathTracer, SameSeedSameImageWhateverTheThreads) {
  RenderJob s = sun_setup(0.3f, 0.f);
  s.params.samples_per_pixel = 16;
  const Image first = s.render();
  set_parallel_backend([](int64_t n, int64_t, RangeBody body, void* context) { body(0, n, context); });
  const Image serial = s.render();
  set_parallel_backend(nullptr);
  EXPECT_EQ(first.radiance, serial.radiance);
  s.params.seed = 1;
  EXPECT_NE(first.radiance, s.render().radiance);
}

TEST(PathTracer, FeaturesDescribeTheFirstHit) {
  RenderJob s = sphere_setup(33);
  s.albedo = {0.1f, 0.2f, 0.3f}, s.roughness = 0.4f, s.metallic = 0.7f;
  s.params.samples_per_pixel = 64;
  s.params.max_bounces = 0;
  const Image image = s.render();
  const size_t centre = 16 * 33 + 16;
  EXPECT_EQ(image.alpha[centre], 1.f);
  EXPECT_EQ(image.alpha[0], 0.f);
  EXPECT_EQ(image.depth[0], 0.f);
  EXPECT_EQ(image.radiance[0], 0.f);
  const Vec eye{3, 1, 1.5f}, normal = load3(&image.normal[centre * 3]);
  EXPECT_LT(length(normal - normalize(eye)), 0.02f);
  EXPECT_NEAR(image.depth[centre], length(eye) - 1, 0.002f);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(image.albedo[centre * 3 + c], s.albedo[c], 1e-5f);
  EXPECT_NEAR(image.roughness[centre], 0.4f, 1e-5f);
  EXPECT_NEAR(image.metallic[centre], 0.7f, 1e-5f);
  // Covered area: a sphere of radius 1 at distance d has an outline of radius 1 / sqrt(d^2 - 1) at unit distance.
  double area = 0;
  for (float a : image.alpha) area += a / (s.camera.fx * s.camera.fy);
  EXPECT_NEAR(area * (dot(eye, eye) - 1) / kPi, 1, 0.003);
}

TEST(PathTracer, ExtremeMaterialsStayFinite) {
  for (float roughness : {0.f, 1.f}) {
    for (float metallic : {0.f, 1.f}) {
      for (float albedo : {0.f, 1.f}) {
        RenderJob s = sun_setup(roughness, metallic);
        s.albedo = {albedo, albedo, albedo};
        s.params.samples_per_pixel = 64;
        EXPECT_NO_THROW(s.render());
      }
    }
  }
  RenderJob s = sun_setup(0.5f, 0.f);
  s.map.assign(s.map.size(), 0.f);  // a black light
  for (float value : s.render().radiance) ASSERT_EQ(value, 0.f);
}

TEST(PathTracer, RejectsUnusableInputs) {
  const auto refused = [](const auto& change) {
    RenderJob s = sphere_setup(2);
    change(s);
    EXPECT_THROW(s.render(), std::invalid_argument);
  };
  refused([](RenderJob& s) { s.roughness = 1.5f; });
  refused([](RenderJob& s) { s.albedo.y = std::nanf(""); });
  refused([](RenderJob& s) { s.map[3] = -1.f; });
  refused([](RenderJob& s) { s.params.samples_per_pixel = 0; });
  refused([](RenderJob& s) { s.camera.fx = 0; });
}

// Under uniform light what the split sum says is the integral of this BSDF, term by term.
TEST(Principled, DirectionalAlbedoIsTheSplitSum) {
  const Vec3<double> one{1, 1, 1}, albedo{0.02, 0.4, 0.9};
  for (const double roughness : {0.2, 0.5, 0.9}) {
    for (const double cosine : {0.2, 0.5, 0.9}) {
      for (const double metallic : {0.0, 0.3, 1.0}) {
        const Vec3<double> view{std::sqrt(1 - cosine * cosine), 0, cosine};
        const PrincipledBsdf<double> bsdf(brdf_lut(), albedo, roughness, metallic, view);
        Vec3<double> sum{0, 0, 0};
        constexpr int kPoints = 1 << 16;
        for (int i = 0; i < kPoints; ++i) {
          const Vec2<double> u = fibonacci_lattice<double>(i, kPoints);
          const BsdfValue<double> f = bsdf.evaluate(bsdf.sample(random_unit<double>(i), u.x, u.y));
          if (f.pdf > 0) sum += f.f_cos * (1 / (f.pdf * kPoints));
        }
        const ShadePoint<double> p{{0, 0, 1}, view, albedo, roughness, metallic, one, one, one, one, {}, {}};
        const Vec3<double> split = split_sum_shade(brdf_lut(), {FresnelMode::kExact, true}, p);
        for (int c = 0; c < 3; ++c)
          EXPECT_NEAR(sum[c], split[c], 0.01 * split[c] + 1e-3) << roughness << " " << cosine << " " << metallic;
      }
    }
  }
}

}  // namespace
}  // namespace splitnerf
