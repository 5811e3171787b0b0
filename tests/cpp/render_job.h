// Renderings of small meshes for the tests of the path tracer.
#pragma once

#include <cmath>
#include <functional>
#include <vector>

#include "meshes.h"
#include "splitnerf/environment.h"
#include "splitnerf/path_tracer.h"

namespace splitnerf {

struct Image {
  std::vector<float> radiance, alpha, albedo, roughness, metallic, normal, smooth_normal, depth, shadow;
  RenderTargets targets(size_t n) {
    for (auto* image : {&radiance, &albedo, &normal, &smooth_normal}) image->assign(n * 3, -1.f);
    for (auto* image : {&alpha, &roughness, &metallic, &depth, &shadow}) image->assign(n, -1.f);
    return {radiance.data(), alpha.data(),         albedo.data(), roughness.data(), metallic.data(),
            normal.data(),   smooth_normal.data(), depth.data(),  shadow.data()};
  }
};

struct RenderJob {
  TestMesh mesh;
  bool smooth = false;  // the vertices are the normals (unit sphere)
  Vec3<float> albedo{1, 1, 1};
  float roughness = 0.5f, metallic = 0.f;
  int map_height = 2, map_width = 4;
  std::vector<float> map = std::vector<float>(2 * 4 * 3, 1.f);
  Camera camera{};
  PathTracerParams params;
  std::function<void(Surface&)> adapt = [](Surface&) {};  // adds materials and textures

  Image render() const {
    const size_t n = mesh.vertices.size() / 3;
    std::vector<float> colours;
    for (size_t i = 0; i < n; ++i) colours.insert(colours.end(), {albedo.x, albedo.y, albedo.z});
    const std::vector<float> rough(n, roughness), metal(n, metallic);
    Surface surface{colours.data(), rough.data(), metal.data(), smooth ? mesh.vertices.data() : nullptr};
    adapt(surface);
    Image image;
    const RenderTargets targets = image.targets(size_t(camera.width) * camera.height);
    splitnerf::render(make_scene(mesh), surface, {map.data(), map_height, map_width}, camera, params, targets);
    return image;
  }
  void set_map(int height, int width, const std::function<float(Vec3<float>)>& radiance) {
    map_height = height, map_width = width;
    map.clear();
    for (int i = 0; i < height * width; ++i) {
      const Vec3<float> d = equirect_to_direction(Vec2<float>{(i % width + 0.5f) / width, (i / width + 0.5f) / height});
      map.insert(map.end(), 3, radiance(d));
    }
  }
};

// A camera at `eye` that looks at the origin, `size` pixels, about `span` wide at the origin.
inline Camera look_at_origin(Vec3<float> eye, int size, float span) {
  const Vec3<float> back = normalize(eye),
                    right =
                        normalize(cross(std::abs(back.z) > 0.99f ? Vec3<float>{0, 1, 0} : Vec3<float>{0, 0, 1}, back));
  const Vec3<float> up = cross(back, right);
  Camera c{};
  for (int r = 0; r < 3; ++r) {
    const float row[4] = {right[r], up[r], back[r], eye[r]};
    for (int k = 0; k < 4; ++k) c.camera_to_world[r * 4 + k] = row[k];
  }
  c.fx = c.fy = size * length(eye) / span;
  c.cx = c.cy = size / 2.f;
  c.width = c.height = size;
  return c;
}

inline RenderJob sphere_setup(int size = 24) {
  RenderJob s;
  s.mesh = sphere_mesh(128, 256);
  s.smooth = true;
  s.camera = look_at_origin({3, 1, 1.5f}, size, 2.5f);
  s.params.samples_per_pixel = 256;
  return s;
}

}  // namespace splitnerf
