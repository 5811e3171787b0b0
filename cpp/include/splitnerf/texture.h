// Bilinear lookups of textures that repeat, and tangent-space normals.
#pragma once

#include <cmath>
#include <cstdint>

#include "splitnerf/sampling.h"

namespace splitnerf {

// [height, width, channels] float32, top row first, texel centres at +0.5; empty where texels is null.
struct Texture {
  const float* texels = nullptr;
  int height = 0, width = 0;
};

// The four texels around (u, v), (0, 0) being the top left corner of the texture, which repeats.
struct TextureFootprint {
  int64_t texel[4];  // row * width + column
  float weight[4];
};

SPLITNERF_HD TextureFootprint texture_footprint(const Texture& texture, Vec2<float> uv) {
  const float x = (uv.x - std::floor(uv.x)) * texture.width - 0.5f,
              y = (uv.y - std::floor(uv.y)) * texture.height - 0.5f;
  const float x_floor = std::floor(x), y_floor = std::floor(y), fx = x - x_floor, fy = y - y_floor;
  // uv - floor(uv) may round to 1: both floors lie in -1 ... size - 1.
  const int x0 = static_cast<int>(x_floor), y0 = static_cast<int>(y_floor);
  const int64_t left = x0 < 0 ? texture.width - 1 : x0, right = x0 + 1 < texture.width ? x0 + 1 : 0;
  const int64_t top = y0 < 0 ? texture.height - 1 : y0, bottom = y0 + 1 < texture.height ? y0 + 1 : 0;
  const int64_t w = texture.width;
  return {{top * w + left, top * w + right, bottom * w + left, bottom * w + right},
          {(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy}};
}

SPLITNERF_HD Vec3<float> lookup_texture3(const Texture& texture, Vec2<float> uv) {
  const TextureFootprint f = texture_footprint(texture, uv);
  Vec3<float> value{0, 0, 0};
  for (int k = 0; k < 4; ++k) value += load3(texture.texels + f.texel[k] * 3) * f.weight[k];
  return value;
}

SPLITNERF_HD Vec2<float> lookup_texture2(const Texture& texture, Vec2<float> uv) {
  const TextureFootprint f = texture_footprint(texture, uv);
  Vec2<float> value{0, 0};
  for (int k = 0; k < 4; ++k) {
    value.x += texture.texels[f.texel[k] * 2] * f.weight[k];
    value.y += texture.texels[f.texel[k] * 2 + 1] * f.weight[k];
  }
  return value;
}

// World direction (of any length) of a tangent-space normal; normal and tangent as interpolated
// from the vertices, not normalised, which is what MikkTSpace bakes for.
SPLITNERF_HD Vec3<float> apply_normal_map(Vec3<float> mapped, Vec3<float> normal, Vec3<float> tangent,
                                          float bitangent_sign) {
  return tangent * mapped.x + cross(normal, tangent) * (bitangent_sign * mapped.y) + normal * mapped.z;
}

}  // namespace splitnerf
