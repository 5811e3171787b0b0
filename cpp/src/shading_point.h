// What the path tracer needs to know of the surface where a ray hits it.
#pragma once

#include "splitnerf/path_tracer.h"

namespace splitnerf {

struct ShadingPoint {
  Vec3<float> position;
  // All on the viewer's side; smooth_normal is interpolated, shading_normal has the normal texture applied.
  Vec3<float> geometric_normal, smooth_normal, shading_normal;
  Vec3<float> albedo, emission;
  float roughness, metallic;
};

class SurfaceLookup {
 public:
  SurfaceLookup(const Scene& scene, const Surface& surface) : scene_(scene), surface_(surface) {}

  // view: unit, towards the viewer.
  ShadingPoint operator()(const Hit& hit, Vec3<float> view) const {
    const Corners at(scene_.triangles() + int64_t(hit.triangle) * 3, hit);
    const float* vertices = scene_.vertices();
    const Vec3<float> a = at.value3(vertices, 0), b = at.value3(vertices, 1), c = at.value3(vertices, 2);
    ShadingPoint p{};
    // From the corners rather than origin + t direction: the error does not grow with the distance.
    p.position = at.mean3(vertices);
    p.geometric_normal = normalize(cross(b - a, c - a), 1e-36f);
    if (dot(p.geometric_normal, view) < 0) p.geometric_normal = -p.geometric_normal;
    p.albedo = at.mean3(surface_.albedo);
    p.roughness = at.mean1(surface_.roughness);
    p.metallic = at.mean1(surface_.metallic);
    const SurfaceMaterial* material = nullptr;
    Vec2<float> uv{0, 0};
    if (surface_.material_ids) {
      material = surface_.materials + surface_.material_ids[hit.triangle];
      if (surface_.uv) uv = at.mean2(surface_.uv);
      apply_material(*material, uv, p);
    }
    set_normals(at, material, uv, view, p);
    return p;
  }

 private:
  // The corners of the triangle and their barycentric weights.
  struct Corners {
    Corners(const int32_t* triangle, const Hit& hit)
        : index{triangle[0], triangle[1], triangle[2]}, weight{1.f - hit.u - hit.v, hit.u, hit.v} {}
    Vec3<float> value3(const float* values, int k) const { return load3(values + int64_t(index[k]) * 3); }
    Vec3<float> mean3(const float* values, int stride = 3) const {
      Vec3<float> mean{0, 0, 0};
      for (int k = 0; k < 3; ++k) mean += load3(values + int64_t(index[k]) * stride) * weight[k];
      return mean;
    }
    Vec2<float> mean2(const float* values) const {
      Vec2<float> mean{0, 0};
      for (int k = 0; k < 3; ++k) {
        mean.x += values[int64_t(index[k]) * 2] * weight[k];
        mean.y += values[int64_t(index[k]) * 2 + 1] * weight[k];
      }
      return mean;
    }
    float mean1(const float* values) const {
      float mean = 0;
      for (int k = 0; k < 3; ++k) mean += values[index[k]] * weight[k];
      return mean;
    }
    int32_t index[3];
    float weight[3];
  };

  static void apply_material(const SurfaceMaterial& material, Vec2<float> uv, ShadingPoint& p) {
    p.albedo = p.albedo * material.albedo;
    p.roughness *= material.roughness;
    p.metallic *= material.metallic;
    p.emission = material.emission;
    if (material.albedo_texture.texels) p.albedo = p.albedo * lookup_texture3(material.albedo_texture, uv);
    if (material.roughness_metallic_texture.texels) {
      const Vec2<float> value = lookup_texture2(material.roughness_metallic_texture, uv);
      p.roughness *= value.x;
      p.metallic *= value.y;
    }
    if (material.emission_texture.texels) p.emission = p.emission * lookup_texture3(material.emission_texture, uv);
  }

  // Normals on the side of the geometric one; where a normal turns away from the viewer it is bent
  // back until n.v = kMinCosine, so that the BSDF stays defined.
  void set_normals(const Corners& at, const SurfaceMaterial* material, Vec2<float> uv, Vec3<float> view,
                   ShadingPoint& p) const {
    p.smooth_normal = p.shading_normal = p.geometric_normal;
    if (surface_.normals) {
      const Vec3<float> mean = at.mean3(surface_.normals);
      if (dot(mean, mean) > 1e-12f) {
        const float side = dot(mean, p.geometric_normal) < 0 ? -1.f : 1.f;
        p.smooth_normal = p.shading_normal = normalize(mean) * side;
        if (material && material->normal_texture.texels) {
          const Vec3<float> mapped =
              apply_normal_map(lookup_texture3(material->normal_texture, uv), mean, at.mean3(surface_.tangents, 4),
                               surface_.tangents[int64_t(at.index[0]) * 4 + 3]);
          if (dot(mapped, mapped) > 1e-12f) p.shading_normal = normalize(mapped) * side;
        }
      }
    }
    p.smooth_normal = facing_viewer(p.smooth_normal, view);
    p.shading_normal = facing_viewer(p.shading_normal, view);
  }

  static Vec3<float> facing_viewer(Vec3<float> n, Vec3<float> view) {
    constexpr float kMinCosine = 1e-3f;
    const float cosine = dot(n, view);
    if (cosine >= kMinCosine) return n;
    // |n - (n.v) v| stands square to v; adding kMinCosine v of its length gives the wanted angle.
    const Vec3<float> across = normalize(n - view * cosine);
    return normalize(across + view * kMinCosine);
  }

  const Scene& scene_;
  const Surface& surface_;
};

}  // namespace splitnerf
