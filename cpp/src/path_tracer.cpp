#include "splitnerf/path_tracer.h"

#include <chrono>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "path_integrator.h"
#include "splitnerf/parallel.h"

namespace splitnerf {
namespace {

using Vec = Vec3<float>;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr int64_t kPixelsPerTask = 64;
constexpr std::chrono::milliseconds kPause{100};  // between two calls of `between`

constexpr int kCameraRays = 64;  // of a pixel, traced together

// What one thread needs while it renders.
struct Worker {
  PathOffsets offsets;
  Vec origins[kCameraRays], directions[kCameraRays];
  Hit hits[kCameraRays];
};

// Direct light (luminance) that the catcher receives with the object and without it.
struct CaughtLight {
  int n_samples = 0;
  double shadowed = 0, open = 0;
};

float luminance(Vec c) { return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z; }

class PathTracer {
 public:
  PathTracer(const Scene& scene, const Surface& surface, const EnvironmentMap& environment, const Camera& camera,
             const PathTracerParams& params)
      : scene_(scene), camera_(camera), params_(params), filter_(params.filter),
        paths_(scene, surface, environment, params, params.samples_per_pixel) {}

  void render_pixel(int64_t pixel, Worker& worker, const RenderTargets& out) const {
    paths_.pattern().start_pixel(static_cast<uint32_t>(pixel), worker.offsets);
    const int spp = params_.samples_per_pixel, x = int(pixel % camera_.width), y = int(pixel / camera_.width);
    Vec3<double> radiance{}, albedo{}, normal{}, smooth_normal{};
    double roughness = 0, metallic = 0, depth = 0;
    int n_hits = 0;
    CaughtLight caught;
    for (int sample = 0; sample < spp; ++sample) {
      const int k = sample % kCameraRays;
      if (k == 0) trace_camera_rays(x, y, sample, min_of(kCameraRays, spp - sample), worker);
      if (params_.shadow_catcher && meets_catcher(worker.directions[k], worker.hits[k], sample, worker, &caught))
        continue;
      ShadingPoint first;
      const Vec path = paths_.radiance(worker.directions[k], worker.hits[k], sample, 0, worker.offsets, &first);
      if (!std::isfinite(sum(path))) {
        throw std::runtime_error("render: a path through pixel (" + std::to_string(x) + ", " + std::to_string(y) +
                                 ") has a radiance that is not finite");
      }
      if (worker.hits[k].t < 0) continue;
      ++n_hits;
      for (int c = 0; c < 3; ++c) {
        radiance[c] += path[c];
        albedo[c] += first.albedo[c];
        normal[c] += first.shading_normal[c];
        smooth_normal[c] += first.smooth_normal[c];
      }
      roughness += first.roughness;
      metallic += first.metallic;
      depth += worker.hits[k].t;
    }
    const double per_hit = 1. / max_of(n_hits, 1);
    for (int c = 0; c < 3; ++c) {
      out.radiance[pixel * 3 + c] = static_cast<float>(radiance[c] / spp);
      out.albedo[pixel * 3 + c] = static_cast<float>(albedo[c] * per_hit);
      out.normal[pixel * 3 + c] = static_cast<float>(normal[c] * per_hit);
      out.smooth_normal[pixel * 3 + c] = static_cast<float>(smooth_normal[c] * per_hit);
    }
    out.alpha[pixel] = static_cast<float>(n_hits) / spp;
    out.roughness[pixel] = static_cast<float>(roughness * per_hit);
    out.metallic[pixel] = static_cast<float>(metallic * per_hit);
    out.depth[pixel] = static_cast<float>(depth * per_hit);
    if (out.shadow) {
      const double blocked = caught.open > 0 ? 1 - caught.shadowed / caught.open : 0;
      out.shadow[pixel] = static_cast<float>(blocked * caught.n_samples / spp);
    }
  }

 private:
  // The camera rays of the samples `first` ... `first + n - 1` of a pixel, and their nearest hits.
  void trace_camera_rays(int x, int y, int first, int n, Worker& worker) const {
    for (int k = 0; k < n; ++k) {
      worker.origins[k] = camera_centre();
      worker.directions[k] = camera_ray(x, y, paths_.pattern().get(worker.offsets, first + k, 0));
    }
    scene_.trace_closest(&worker.origins[0].x, &worker.directions[0].x, n, kInfinity, worker.hits);
  }

  // Whether the catcher hides the hit; then it has caught the light of one sample.
  bool meets_catcher(Vec direction, const Hit& hit, int sample, const Worker& worker, CaughtLight* caught) const {
    const Vec origin = camera_centre();
    const float t = (params_.catcher_height - origin.z) / direction.z;
    if (!(direction.z < 0 && t > 0 && (hit.t < 0 || t < hit.t))) return false;
    catch_shadow(origin + direction * t, sample, worker, caught);
    return true;
  }

  // Irradiance of a point of the catcher by one light and one cosine sample. What is blocked is
  // compared with the same two samples unblocked: where nothing blocks, the ratio is exactly 1.
  void catch_shadow(Vec position, int sample, const Worker& worker, CaughtLight* caught) const {
    ++caught->n_samples;
    if (paths_.light().black()) return;
    const auto add = [&](Vec to_light, float pdf, float other_pdf) {
      if (!(to_light.z > 0) || !(pdf > 0)) return;
      const double light = luminance(paths_.light().radiance(to_light)) * to_light.z * mis_weight(pdf, other_pdf) / pdf;
      caught->open += light;
      if (!paths_.occluded(position, to_light)) caught->shadowed += light;
    };
    float light_pdf;
    const Vec to_light = paths_.light().sample(paths_.pattern().get(worker.offsets, sample, 1), &light_pdf);
    if (to_light.z > 0) add(to_light, light_pdf, pdf_cosine_hemisphere(to_light.z));
    const Vec2<float> u = paths_.pattern().get(worker.offsets, sample, 2);
    const Vec up = sample_cosine_hemisphere(u.x, u.y);
    add(up, pdf_cosine_hemisphere(up.z), paths_.light().pdf(up));
  }

  Vec camera_centre() const {
    const float* m = camera_.camera_to_world;
    return {m[3], m[7], m[11]};
  }

  Vec camera_ray(int x, int y, Vec2<float> u) const {
    const Vec local{(x + 0.5f + filter_(u.x) - camera_.cx) / camera_.fx,
                    -(y + 0.5f + filter_(u.y) - camera_.cy) / camera_.fy, -1.f};
    const float* m = camera_.camera_to_world;
    return normalize(Vec{dot(load3(m), local), dot(load3(m + 4), local), dot(load3(m + 8), local)});
  }

  const Scene& scene_;
  const Camera& camera_;
  const PathTracerParams& params_;
  PixelFilterSampler filter_;
  PathIntegrator paths_;
};

// Refuses what `caller` was given.
struct Checks {
  const char* caller;

  void require(bool condition, const char* what) const {
    if (!condition) throw std::invalid_argument(std::string(caller) + ": " + what);
  }
  // Textures are large, and each call reads them: these loops hold no branch, so that they run in vectors.
  void range(const float* values, int64_t n, float hi, const char* what) const {
    int bad = 0;
    for (int64_t i = 0; i < n; ++i) bad |= !(values[i] >= 0.f) | !(values[i] <= hi);  // 1 for NaN
    require(!bad, what);
  }
  void finite(const float* values, int64_t n, const char* what) const {
    int bad = 0;
    for (int64_t i = 0; i < n; ++i) bad |= !(std::abs(values[i]) <= std::numeric_limits<float>::max());
    require(!bad, what);
  }
};

int64_t texels(const Texture& texture) { return int64_t(texture.height) * texture.width; }

void check_ids(const Checks& check, const Scene& scene, const Surface& surface) {
  bool any_texture = false, any_normal_texture = false;
  for (int i = 0; i < surface.n_materials; ++i) {
    const SurfaceMaterial& m = surface.materials[i];
    any_normal_texture |= m.normal_texture.texels != nullptr;
    any_texture |= m.albedo_texture.texels || m.roughness_metallic_texture.texels || m.emission_texture.texels;
  }
  check.require(!(any_texture || any_normal_texture) || surface.uv, "textures need uv");
  check.require(!any_normal_texture || (surface.tangents && surface.normals),
                "a normal texture needs normals and tangents");
  for (int64_t i = 0; i < scene.n_triangles(); ++i) {
    check.require(surface.material_ids[i] >= 0 && surface.material_ids[i] < surface.n_materials,
                  "material_ids must name materials");
  }
  if (surface.uv) check.finite(surface.uv, scene.n_vertices() * 2, "uv must be finite");
  if (surface.tangents) check.finite(surface.tangents, scene.n_vertices() * 4, "tangents must be finite");
}

}  // namespace

void check_material(const char* caller, const SurfaceMaterial& m) {
  const Checks check{caller};
  constexpr float kMax = std::numeric_limits<float>::max();
  const float factors[5] = {m.albedo.x, m.albedo.y, m.albedo.z, m.roughness, m.metallic};
  check.range(factors, 5, 1.f, "material factors must lie in [0, 1]");
  check.range(&m.emission.x, 3, kMax, "emission must be finite and not negative");
  for (const Texture* t : {&m.albedo_texture, &m.roughness_metallic_texture, &m.normal_texture, &m.emission_texture}) {
    check.require(!t->texels || (t->height > 0 && t->width > 0), "textures must not be empty");
  }
  if (m.albedo_texture.texels) {
    check.range(m.albedo_texture.texels, texels(m.albedo_texture) * 3, 1.f, "albedo textures must lie in [0, 1]");
  }
  if (m.roughness_metallic_texture.texels) {
    check.range(m.roughness_metallic_texture.texels, texels(m.roughness_metallic_texture) * 2, 1.f,
                "roughness and metallic textures must lie in [0, 1]");
  }
  if (m.emission_texture.texels) {
    check.range(m.emission_texture.texels, texels(m.emission_texture) * 3, kMax,
                "emission textures must be finite and not negative");
  }
  if (m.normal_texture.texels) {
    check.finite(m.normal_texture.texels, texels(m.normal_texture) * 3, "normal textures must be finite");
  }
}

void check_surface(const char* caller, const Scene& scene, const Surface& surface, const EnvironmentMap& environment) {
  const Checks check{caller};
  check.require(environment.height > 0 && environment.width > 0, "the environment map must not be empty");
  const int64_t n = scene.n_vertices();
  check.range(surface.albedo, n * 3, 1.f, "albedo must lie in [0, 1]");
  check.range(surface.roughness, n, 1.f, "roughness must lie in [0, 1]");
  check.range(surface.metallic, n, 1.f, "metallic must lie in [0, 1]");
  check.range(environment.radiance, int64_t(environment.height) * environment.width * 3,
              std::numeric_limits<float>::max(), "environment radiance must be finite and not negative");
  if (surface.normals) check.finite(surface.normals, scene.n_vertices() * 3, "normals must be finite");
  if (surface.material_ids) check_ids(check, scene, surface);
}

void render(const Scene& scene, const Surface& surface, const EnvironmentMap& environment, const Camera& camera,
            const PathTracerParams& params, const RenderTargets& targets, const std::function<void()>& between) {
  const char* caller = "render";
  const Checks check{caller};
  check.require(camera.width > 0 && camera.height > 0, "camera width and height must be positive");
  check.require(int64_t(camera.width) * camera.height < int64_t(1) << 31, "the image must have fewer than 2^31 pixels");
  check.require(camera.fx > 0 && camera.fy > 0 && std::isfinite(camera.fx + camera.fy + camera.cx + camera.cy),
                "fx and fy must be positive, cx and cy finite");
  for (float m : camera.camera_to_world) check.require(std::isfinite(m), "camera_to_world must be finite");
  check.require(params.samples_per_pixel > 0, "samples_per_pixel must be positive");
  check.require(params.max_bounces >= 0, "max_bounces must not be negative");
  check.require(params.clamp_indirect >= 0, "clamp_indirect must not be negative");
  check_surface(caller, scene, surface, environment);
  check.require(std::isfinite(params.catcher_height), "catcher_height must be finite");

  const PathTracer tracer(scene, surface, environment, camera, params);
  const auto calling_thread = std::this_thread::get_id();
  auto next_call = std::chrono::steady_clock::now() + kPause;
  parallel_for_uneven(int64_t(camera.width) * camera.height, kPixelsPerTask, [&](int64_t begin, int64_t end) {
    Worker worker;
    for (int64_t pixel = begin; pixel < end; ++pixel) tracer.render_pixel(pixel, worker, targets);
    if (between && std::this_thread::get_id() == calling_thread && std::chrono::steady_clock::now() > next_call) {
      between();
      next_call = std::chrono::steady_clock::now() + kPause;
    }
  });
}

}  // namespace splitnerf
