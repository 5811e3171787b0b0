// Textures, normal maps, emission, pixel filters and the shadow catcher of the path tracer.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "check.h"
#include "render_job.h"
#include "splitnerf/pixel_filter.h"
#include "splitnerf/texture.h"

namespace splitnerf {
namespace {

using Vec = Vec3<float>;

TEST(Texture, TexelCentresAreExactAndTheTextureRepeats) {
  Random random(0);
  const int height = 3, width = 5;
  const std::vector<float> values = random.uniforms<float>(height * width * 3);
  const Texture texture{values.data(), height, width};
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) {
      for (const float turn : {0.f, 1.f, -2.f}) {
        const Vec2<float> uv{(column + 0.5f) / width + turn, (row + 0.5f) / height - turn};
        const Vec value = lookup_texture3(texture, uv);
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(value[c], values[(row * width + column) * 3 + c], 2e-6f);
      }
    }
  }
}

TEST(Texture, BetweenTexelsItIsBilinearAlsoAcrossTheBorder) {
  const std::vector<float> values{0, 1, 2, 3, 4, 5, 6, 7};  // 2 rows, 2 columns, 2 channels
  const Texture texture{values.data(), 2, 2};
  EXPECT_FLOAT_EQ(lookup_texture2(texture, {0.5f, 0.25f}).x, 1);  // between the columns of row 0
  EXPECT_FLOAT_EQ(lookup_texture2(texture, {0.25f, 0.5f}).y, 3);  // between the rows of column 0
  EXPECT_FLOAT_EQ(lookup_texture2(texture, {0.f, 0.25f}).x, 1);   // the border: half the last, half the first
  EXPECT_FLOAT_EQ(lookup_texture2(texture, {1.f, 0.f}).x, 3);     // a corner: all four
  EXPECT_FLOAT_EQ(lookup_texture2(texture, {0.375f, 0.25f}).x, 0.5f);
}

TEST(PixelFilter, OffsetsOfTheBoxFillThePixel) {
  const PixelFilterSampler box(PixelFilter::kBox);
  double square = 0;
  const int n = 30000;
  for (int i = 0; i < n; ++i) {
    const float x = box((i + 0.5f) / n);
    square += x * x;
    ASSERT_LE(std::abs(x), 0.5f);
  }
  EXPECT_NEAR(square / n, 1. / 12, 1e-5);
}

// The square [-1, 1]^2 at z = 0, seen from above: image rows run from +y to -y.
struct SquareJob : RenderJob {
  std::vector<float> uv{0, 1, 1, 1, 1, 0, 0, 0};  // v grows downward, as glTF has it
  std::vector<float> normals, tangents;
  std::vector<int32_t> ids{0, 0};
  std::vector<SurfaceMaterial> materials{1};

  SquareJob() {
    add_quad(mesh, {-1, -1, 0}, {2, 0, 0}, {0, 2, 0});
    for (int k = 0; k < 4; ++k) {
      normals.insert(normals.end(), {0, 0, 1});
      tangents.insert(tangents.end(), {1, 0, 0, 1});
    }
    camera = look_at_origin({0, 0, 4}, 4, 2);
    params.samples_per_pixel = 64;
    metallic = 1;
    adapt = [this](Surface& s) {
      s.normals = normals.data(), s.tangents = tangents.data(), s.uv = uv.data();
      s.materials = materials.data(), s.n_materials = int(materials.size()), s.material_ids = ids.data();
    };
  }
};

TEST(TexturedPath, TexelsMeetTheirPixels) {
  SquareJob job;
  Random random(1);
  const std::vector<float> colours = random.uniforms<float>(4 * 4 * 3), rough_metal = random.uniforms<float>(4 * 4 * 2);
  job.albedo = {0.5f, 1, 1};
  job.materials[0].albedo = {1, 0.25f, 1};
  job.materials[0].roughness = 0.5f;
  job.materials[0].albedo_texture = {colours.data(), 4, 4};
  job.materials[0].roughness_metallic_texture = {rough_metal.data(), 4, 4};
  job.roughness = 1;
  const Image image = job.render();
  // Averaged over a pixel that is a texel, a bilinear texture is (1 6 1) / 8 of texels on each axis.
  for (int row = 1; row < 3; ++row) {
    for (int column = 1; column < 3; ++column) {
      const int pixel = row * 4 + column;
      double mean[5] = {};
      for (int i = -1; i <= 1; ++i) {
        for (int j = -1; j <= 1; ++j) {
          const double weight = (i ? 1 : 6) * (j ? 1 : 6) / 64.;
          const int texel = (row + i) * 4 + column + j;
          for (int c = 0; c < 3; ++c) mean[c] += weight * colours[texel * 3 + c];
          for (int c = 0; c < 2; ++c) mean[3 + c] += weight * rough_metal[texel * 2 + c];
        }
      }
      EXPECT_NEAR(image.albedo[pixel * 3], 0.5 * mean[0], 0.01);
      EXPECT_NEAR(image.albedo[pixel * 3 + 1], 0.25 * mean[1], 0.01);
      EXPECT_NEAR(image.albedo[pixel * 3 + 2], mean[2], 0.01);
      EXPECT_NEAR(image.roughness[pixel], 0.5 * mean[3], 0.01);
      EXPECT_NEAR(image.metallic[pixel], mean[4], 0.01);
    }
  }
}

TEST(TexturedPath, NormalMapTurnsTheReflectionAndOnlyTheShadingNormal) {
  // A mirror tilted by the map about each tangent axis shows the map's pole direction: the light
  // equals d.x + 2 (positive), so a smooth metal returns the x of the reflected direction.
  SquareJob job;
  job.camera = look_at_origin({0, 0, 40}, 4, 1);
  job.materials[0].roughness = 0;
  job.set_map(64, 128, [](Vec d) { return 2 + d.x + 0.5f * d.y; });
  const float tilt = 0.3f;
  for (const std::array<float, 3> mapped : {std::array<float, 3>{std::sin(tilt), 0, std::cos(tilt)},
                                            std::array<float, 3>{0, std::sin(tilt), std::cos(tilt)}}) {
    job.materials[0].normal_texture = {mapped.data(), 1, 1};
    for (const float sign : {1.f, -1.f}) {
      for (int k = 0; k < 4; ++k) job.tangents[k * 4 + 3] = sign;
      const Image image = job.render();
      const Vec n{mapped[0], sign * mapped[1], mapped[2]};
      const Vec reflected{2 * n.z * n.x, 2 * n.z * n.y, 2 * n.z * n.z - 1};
      for (int pixel : {5, 6, 9, 10}) {
        for (int c = 0; c < 3; ++c) {
          EXPECT_NEAR(image.normal[pixel * 3 + c], n[c], 1e-5f);
          EXPECT_NEAR(image.smooth_normal[pixel * 3 + c], c == 2, 1e-6f);
        }
        EXPECT_NEAR(image.radiance[pixel * 3], 2 + reflected.x + 0.5f * reflected.y, 0.02f);
      }
    }
  }
}

TEST(TexturedPath, EmissionIsSeenDirectlyAndLightsOthers) {
  SquareJob job;
  job.set_map(2, 4, [](Vec) { return 0.f; });
  job.albedo = {0, 0, 0};
  job.metallic = 0;
  const std::vector<float> glow{1, 0.5f, 0.25f};
  job.materials[0].emission = {2, 2, 2};
  job.materials[0].emission_texture = {glow.data(), 1, 1};
  const Image image = job.render();
  EXPECT_NEAR(image.radiance[5 * 3], 2, 1e-6f);
  EXPECT_NEAR(image.radiance[5 * 3 + 1], 1, 1e-6f);
  EXPECT_NEAR(image.radiance[5 * 3 + 2], 0.5f, 1e-6f);
}

TEST(TexturedPath, UnusableMaterialsAreRefused) {
  const std::vector<float> texel{0.5f, 0.5f, 2};
  const auto refused = [&](auto change) {
    SquareJob job;
    change(job);
    const auto use = [&] { check_material("render", job.materials[0]), job.render(); };
    EXPECT_THROW(use(), std::invalid_argument);
  };
  refused([](SquareJob& j) { j.ids = {0, 1}; });
  refused([](SquareJob& j) { j.materials[0].roughness = NAN; });
  refused([](SquareJob& j) { j.materials[0].emission.y = -1; });
  refused([](SquareJob& j) { j.uv[3] = INFINITY; });
  refused([&](SquareJob& j) { j.materials[0].albedo_texture = {texel.data(), 1, 1}; });
  refused([&](SquareJob& j) {
    j.materials[0].normal_texture = {texel.data(), 1, 1};
    j.adapt = [inner = j.adapt](Surface& s) { inner(s), s.tangents = nullptr; };
  });
  refused([&](SquareJob& j) {
    j.materials[0].emission_texture = {texel.data(), 1, 1};
    j.adapt = [inner = j.adapt](Surface& s) { inner(s), s.uv = nullptr; };
  });
}

TEST(ShadowCatcher, BelowASphereItHidesTheSpheresFormFactor) {
  // A sphere of radius 1 centred a distance d above a plane covers 1 / d^2 of the cosine-weighted
  // hemisphere of the point below it. Under uniform light that is the opacity of the shadow.
  RenderJob job = sphere_setup(2);
  job.params.shadow_catcher = true;
  job.params.samples_per_pixel = 4096;
  for (const float d : {1.5f, 2.f, 3.f}) {
    job.params.catcher_height = -d;
    // Seen from just below the sphere, straight down.
    job.camera = look_at_origin({0, 0, 1}, 2, 1e-3f);
    job.camera.camera_to_world[11] = -1.1f;
    const Image image = job.render();
    for (int pixel = 0; pixel < 4; ++pixel) {
      EXPECT_EQ(image.alpha[pixel], 0);
      EXPECT_NEAR(image.shadow[pixel], 1 / (d * d), 0.01) << d;
    }
  }
}

TEST(ShadowCatcher, NothingBlockedIsExactlyClearAndTheObjectCoversTheRest) {
  RenderJob job = sphere_setup(24);
  job.params.samples_per_pixel = 16;
  job.params.shadow_catcher = true;
  job.params.catcher_height = -1;
  job.set_map(16, 32, [](Vec d) { return d.z > 0.9f ? 5.f : 0.f; });  // light from above: a small shadow
  job.camera = look_at_origin({6, 0, 3}, 24, 8);
  const Image image = job.render();
  bool some = false;
  for (size_t i = 0; i < image.alpha.size(); ++i) {
    EXPECT_LE(image.alpha[i] + image.shadow[i], 1 + 1e-6f);
    some |= image.shadow[i] > 0.5f;
  }
  EXPECT_TRUE(some);
  EXPECT_EQ(image.shadow[23 * 24], 0);
  job.params.shadow_catcher = false;
  for (const float value : job.render().shadow) EXPECT_EQ(value, 0);
}

}  // namespace
}  // namespace splitnerf
