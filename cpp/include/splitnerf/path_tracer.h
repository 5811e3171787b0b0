// Forward path tracer for metallic-roughness meshes under an environment light: renders the demo
// data and relights assets, and is the ground truth that split-sum shading approximates.
//
// BSDF, as Blender's Principled reads a glTF material: a metal and a coated diffuse base, mixed,
//   f = m F_m gain_m D V + (1 - m) [F_d gain_d D V + (1 - E_d) albedo / pi]
//   F_m = albedo + (1 - albedo)(1 - v.h)^5, F_d the exact Fresnel term of refractive index 1.5,
//   gain = 1 + F0 (1 / (F1 + F2) - 1),  E_d = gain_d int F_d D V ...
// with GGX D, height-correlated Smith V and the tables of split_sum.h; gain restores the energy of
// multiple scattering (Turquin 2019).
#pragma once

#include <cstdint>
#include <functional>

#include "splitnerf/config.h"
#include "splitnerf/pixel_filter.h"
#include "splitnerf/scene.h"
#include "splitnerf/texture.h"

namespace splitnerf {

// Pinhole camera; OpenGL axes (x right, y up, looking along -z), pixel centres at +0.5.
struct Camera {
  float camera_to_world[12];  // row-major [3, 4]
  float fx, fy, cx, cy;       // pixels
  int width, height;          // pixels
};

// One glTF metallic-roughness material: each quantity is its factor times its texture.
struct SurfaceMaterial {
  Vec3<float> albedo{1, 1, 1};         // linear, in [0, 1]
  float roughness = 1;                 // perceptual, in [0, 1]
  float metallic = 1;                  // in [0, 1]
  Vec3<float> emission{0, 0, 0};       // radiance, not negative
  Texture albedo_texture;              // 3 channels, linear
  Texture roughness_metallic_texture;  // 2 channels
  Texture normal_texture;              // 3 channels in [-1, 1], tangent space, y along the bitangent
  Texture emission_texture;            // 3 channels, linear
};

// Throws std::invalid_argument for a factor or a texel outside its range; the error begins with the caller's name.
// render() relies on it: big textures are checked once, not for each view.
SPLITNERF_API void check_material(const char* caller, const SurfaceMaterial& material);

// Materials and normals of a mesh. All arrays are read during the call only.
struct Surface {
  const float* albedo;     // [n_vertices, 3] linear, in [0, 1], interpolated as the next two
  const float* roughness;  // [n_vertices] perceptual, in [0, 1]
  const float* metallic;   // [n_vertices] in [0, 1]
  const float* normals;    // [n_vertices, 3] shading normals, or null for flat shading

  // Optional, and multiplied with the above: the material of each triangle.
  const SurfaceMaterial* materials = nullptr;
  int n_materials = 0;
  const int32_t* material_ids = nullptr;  // [n_triangles]
  const float* uv = nullptr;              // [n_vertices, 2], needed where a material has a texture
  const float* tangents = nullptr;        // [n_vertices, 4], needed for normal textures: along +u, and the sign of
                                          // the bitangent, sign * cross(normal, tangent)
};

// Equirectangular map, see environment.h.
struct EnvironmentMap {
  const float* radiance;  // [height, width, 3] linear, finite, not negative
  int height, width;
};

// Throws std::invalid_argument where arrays of the surface or the map do not fit or lie outside their ranges; the error
// begins with the caller's name. The materials must have passed check_material.
SPLITNERF_API void check_surface(const char* caller, const Scene& scene, const Surface& surface,
                                 const EnvironmentMap& environment);

struct PathTracerParams {
  int samples_per_pixel = 64;  // paths a pixel, jittered over the pixel's box
  int max_bounces = 4;         // scattering events after the first one; 0: direct light only
  uint32_t seed = 0;           // equal seeds give equal images, whatever the number of threads
  bool light_sampling = true;  // sample the light too, combined by multiple importance sampling
  // Largest channel that one indirect contribution may add to a path (a brighter one is scaled
  // down); 0: no limit, unbiased. It trades caustics, which few samples show as specks, for noise.
  float clamp_indirect = 0;
  PixelFilter filter = PixelFilter::kBox;
  // An invisible ground plane z = catcher_height that shows the shadow of the direct light.
  bool shadow_catcher = false;
  float catcher_height = 0;
};

// Outputs, all but shadow required. The features are those of the first hit, averaged over the sub-samples
// that hit the mesh, and 0 where none does.
struct RenderTargets {
  float* radiance;       // [height, width, 3] linear, premultiplied by alpha
  float* alpha;          // [height, width] covered fraction of the pixel; the light itself is transparent
  float* albedo;         // [height, width, 3]
  float* roughness;      // [height, width]
  float* metallic;       // [height, width]
  float* normal;         // [height, width, 3] world space, shading normal turned to the camera
  float* smooth_normal;  // [height, width, 3] the same without normal texture
  float* depth;          // [height, width] distance from the camera's centre along the ray
  // [height, width] or null: opacity of the black shadow on the catcher; alpha + shadow <= 1.
  float* shadow;
};

// Throws std::invalid_argument for unusable inputs and std::runtime_error for a path whose radiance is not finite. The
// calling thread calls `between` after every 64 pixels, but at most ten times a second; what that throws ends the
// rendering.
SPLITNERF_API void render(const Scene& scene, const Surface& surface, const EnvironmentMap& environment,
                          const Camera& camera, const PathTracerParams& params, const RenderTargets& targets,
                          const std::function<void()>& between = {});

}  // namespace splitnerf
