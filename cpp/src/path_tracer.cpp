#include "splitnerf/path_tracer.h"

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "splitnerf/environment_sampler.h"
#include "splitnerf/parallel.h"
#include "splitnerf/principled.h"
#include "splitnerf/sampling.h"

namespace splitnerf {
namespace {

using Vec = Vec3<float>;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr int kRouletteStart = 3;  // bounces before Russian roulette may end a path
constexpr int64_t kPixelsPerTask = 64;
constexpr int kPairsPerBounce = 3;  // light direction; BSDF direction; lobe choice and roulette

// Well-spread sample points: every pair of dimensions holds the spp-point Fibonacci lattice in a
// random order of its own; each pixel starts at a random place of the order and shifts the points
// modulo 1. Each sample is then uniform, so estimates stay unbiased.
class SamplePattern {
 public:
  SamplePattern(int spp, int n_pairs, uint32_t seed) : spp_(spp), n_pairs_(n_pairs), seed_(hash_u32(seed)) {
    points_.resize(size_t(spp) * n_pairs);
    for (int pair = 0; pair < n_pairs; ++pair) {
      Vec2<float>* points = points_.data() + size_t(pair) * spp;
      for (int i = 0; i < spp; ++i) points[i] = fibonacci_lattice<float>(i, spp);
      for (int i = spp - 1; i > 0; --i) {  // Fisher-Yates
        std::swap(points[i], points[hash_u32(i, pair, seed_) % uint32_t(i + 1)]);
      }
    }
  }

  struct Offset {
    Vec2<float> shift;
    uint32_t start;
  };
  void start_pixel(uint32_t pixel, std::vector<Offset>& offsets) const {
    offsets.resize(n_pairs_);
    for (int pair = 0; pair < n_pairs_; ++pair) {
      const uint32_t bits = hash_u32(pixel, 3 * pair, seed_ + 1);
      offsets[pair] = {{unit_from_bits<float>(hash_u32(bits + 1)), unit_from_bits<float>(hash_u32(bits + 2))},
                       bits % uint32_t(spp_)};
    }
  }
  Vec2<float> get(const std::vector<Offset>& offsets, int sample, int pair) const {
    const Offset& o = offsets[pair];
    const Vec2<float> p = points_[size_t(pair) * spp_ + (o.start + sample) % spp_];
    return {wrap_unit(p.x, o.shift.x), wrap_unit(p.y, o.shift.y)};
  }

 private:
  int spp_, n_pairs_;
  uint32_t seed_;
  std::vector<Vec2<float>> points_;  // [n_pairs, spp]
};

struct ShadingPoint {
  Vec position;
  Vec geometric_normal, shading_normal;  // both on the viewer's side
  Vec albedo;
  float roughness, metallic;
};

struct FirstHit {
  bool hit = false;
  ShadingPoint point{};
  float depth = 0;
};

// Power heuristic with exponent 2, pdf > 0; as a ratio neither square can overflow or vanish.
// Source: Veach 1997, Eq. (9.15).
float mis_weight(float pdf, float other_pdf) { return 1.f / (1.f + square(other_pdf / pdf)); }

class PathTracer {
 public:
  PathTracer(const Scene& scene, const Surface& surface, const EnvironmentMap& environment, const Camera& camera,
             const PathTracerParams& params)
      : scene_(scene),
        surface_(surface),
        light_(environment.radiance, environment.height, environment.width),
        camera_(camera),
        params_(params),
        lut_(brdf_lut()),
        pattern_(params.samples_per_pixel, 1 + kPairsPerBounce * (params.max_bounces + 1), params.seed) {
    float extent = 0;
    for (int64_t i = 0; i < scene.n_vertices() * 3; ++i) extent = max_of(extent, std::abs(scene.vertices()[i]));
    ray_offset_ = 1e-5f * extent;
  }

  void render_pixel(int64_t pixel, std::vector<SamplePattern::Offset>& offsets, const RenderTargets& out) const {
    pattern_.start_pixel(static_cast<uint32_t>(pixel), offsets);
    const int spp = params_.samples_per_pixel, x = int(pixel % camera_.width), y = int(pixel / camera_.width);
    Vec3<double> radiance{}, albedo{}, normal{};
    double roughness = 0, metallic = 0, depth = 0;
    int n_hits = 0;
    for (int sample = 0; sample < spp; ++sample) {
      FirstHit first;
      const Vec path = trace_path(x, y, sample, offsets, &first);
      if (!std::isfinite(sum(path))) {
        throw std::runtime_error("render: a path through pixel (" + std::to_string(x) + ", " + std::to_string(y) +
                                 ") has a radiance that is not finite");
      }
      if (!first.hit) continue;
      ++n_hits;
      for (int c = 0; c < 3; ++c) {
        radiance[c] += path[c];
        albedo[c] += first.point.albedo[c];
        normal[c] += first.point.shading_normal[c];
      }
      roughness += first.point.roughness;
      metallic += first.point.metallic;
      depth += first.depth;
    }
    const double per_hit = 1. / max_of(n_hits, 1);
    for (int c = 0; c < 3; ++c) {
      out.radiance[pixel * 3 + c] = static_cast<float>(radiance[c] / spp);
      out.albedo[pixel * 3 + c] = static_cast<float>(albedo[c] * per_hit);
      out.normal[pixel * 3 + c] = static_cast<float>(normal[c] * per_hit);
    }
    out.alpha[pixel] = static_cast<float>(n_hits) / spp;
    out.roughness[pixel] = static_cast<float>(roughness * per_hit);
    out.metallic[pixel] = static_cast<float>(metallic * per_hit);
    out.depth[pixel] = static_cast<float>(depth * per_hit);
  }

 private:
  // L = sum over vertices of throughput x (light sampled there + light that the BSDF sample finds).
  Vec trace_path(int x, int y, int sample, const std::vector<SamplePattern::Offset>& offsets,
                 FirstHit* first) const {
    Vec radiance{0, 0, 0}, throughput{1, 1, 1};
    Vec origin = camera_centre(), direction = camera_ray(x, y, pattern_.get(offsets, sample, 0));
    float bsdf_pdf = 0;
    for (int bounce = 0;; ++bounce) {
      const Hit hit = scene_.trace_closest(origin, direction, kInfinity);
      if (hit.t < 0) {
        if (bounce > 0) {
          const bool both = params_.light_sampling && !light_.black();
          const float weight = both ? mis_weight(bsdf_pdf, light_.pdf(direction)) : 1.f;
          radiance += limited(throughput * light_.radiance(direction) * weight, bounce > 1);
        }
        return radiance;
      }
      if (bounce > params_.max_bounces) return radiance;

      const ShadingPoint point = shading_point(hit, -direction);
      if (bounce == 0) *first = {true, point, hit.t};
      const Frame<float> frame(point.shading_normal);
      const PrincipledBsdf<float> bsdf(lut_, point.albedo, point.roughness, point.metallic,
                                       frame.to_local(-direction));
      const Vec start = point.position + point.geometric_normal * ray_offset_;
      const int pair = 1 + kPairsPerBounce * bounce;

      if (params_.light_sampling && !light_.black()) {
        float light_pdf;
        const Vec to_light = light_.sample(pattern_.get(offsets, sample, pair), &light_pdf);
        // Nothing arrives from below the true surface, whatever the shading normal says.
        if (dot(to_light, point.geometric_normal) > 0) {
          const BsdfValue<float> f = bsdf.evaluate(frame.to_local(to_light));
          if (f.pdf > 0 && !scene_.occluded(start, to_light, kInfinity)) {
            const float weight = mis_weight(light_pdf, f.pdf) / light_pdf;
            radiance += limited(throughput * f.f_cos * light_.radiance(to_light) * weight, bounce > 0);
          }
        }
      }

      const Vec2<float> choice = pattern_.get(offsets, sample, pair + 2);
      const Vec2<float> u = pattern_.get(offsets, sample, pair + 1);
      const Vec next = bsdf.sample(choice.x, u.x, u.y);
      const BsdfValue<float> f = bsdf.evaluate(next);
      direction = normalize(frame.to_world(next));
      if (!(f.pdf > 0) || !(dot(direction, point.geometric_normal) > 0)) return radiance;
      throughput *= f.f_cos / f.pdf;
      if (bounce >= kRouletteStart) {
        const float survival = min_of(max_of(throughput.x, max_of(throughput.y, throughput.z)), 0.95f);
        if (choice.y >= survival) return radiance;
        throughput = throughput / survival;
      }
      bsdf_pdf = f.pdf;
      origin = start;
    }
  }

  Vec limited(Vec contribution, bool indirect) const {
    const float largest = max_of(contribution.x, max_of(contribution.y, contribution.z));
    if (!indirect || params_.clamp_indirect <= 0 || !(largest > params_.clamp_indirect)) return contribution;
    return contribution * (params_.clamp_indirect / largest);
  }

  Vec camera_centre() const {
    const float* m = camera_.camera_to_world;
    return {m[3], m[7], m[11]};
  }

  Vec camera_ray(int x, int y, Vec2<float> jitter) const {
    const Vec local{(x + jitter.x - camera_.cx) / camera_.fx, -(y + jitter.y - camera_.cy) / camera_.fy, -1.f};
    const float* m = camera_.camera_to_world;
    return normalize(Vec{dot(load3(m), local), dot(load3(m + 4), local), dot(load3(m + 8), local)});
  }

  ShadingPoint shading_point(const Hit& hit, Vec view) const {
    const int32_t* corners = scene_.triangles() + int64_t(hit.triangle) * 3;
    const float weights[3] = {1.f - hit.u - hit.v, hit.u, hit.v};
    const auto corner = [&](const float* values, int k) { return load3(values + int64_t(corners[k]) * 3); };
    const Vec a = corner(scene_.vertices(), 0), b = corner(scene_.vertices(), 1), c = corner(scene_.vertices(), 2);
    ShadingPoint p{};
    // From the corners rather than origin + t direction: the error does not grow with the distance.
    p.position = a * weights[0] + b * weights[1] + c * weights[2];
    p.geometric_normal = normalize(cross(b - a, c - a), 1e-36f);
    if (dot(p.geometric_normal, view) < 0) p.geometric_normal = -p.geometric_normal;
    if (surface_.per_triangle) {
      p.albedo = load3(surface_.albedo + int64_t(hit.triangle) * 3);
      p.roughness = surface_.roughness[hit.triangle];
      p.metallic = surface_.metallic[hit.triangle];
    } else {
      for (int k = 0; k < 3; ++k) {
        p.albedo += corner(surface_.albedo, k) * weights[k];
        p.roughness += surface_.roughness[corners[k]] * weights[k];
        p.metallic += surface_.metallic[corners[k]] * weights[k];
      }
    }
    p.shading_normal = shading_normal(corners, weights, p.geometric_normal, view);
    return p;
  }

  // The interpolated normal on the side of the geometric one; where it turns away from the viewer
  // it is bent back until n.v = kMinCosine, so that the BSDF stays defined.
  Vec shading_normal(const int32_t* corners, const float* weights, Vec geometric_normal, Vec view) const {
    Vec n = geometric_normal;
    if (surface_.normals) {
      Vec mean{0, 0, 0};
      for (int k = 0; k < 3; ++k) mean += load3(surface_.normals + int64_t(corners[k]) * 3) * weights[k];
      if (dot(mean, mean) > 1e-12f) n = normalize(mean);
      if (dot(n, geometric_normal) < 0) n = -n;
    }
    constexpr float kMinCosine = 1e-3f;
    const float cosine = dot(n, view);
    if (cosine >= kMinCosine) return n;
    // |n - (n.v) v| stands square to v; adding kMinCosine v of its length gives the wanted angle.
    const Vec across = normalize(n - view * cosine);
    return normalize(across + view * kMinCosine);
  }

  const Scene& scene_;
  const Surface& surface_;
  EnvironmentSampler light_;
  const Camera& camera_;
  const PathTracerParams& params_;
  const float* lut_;
  SamplePattern pattern_;
  float ray_offset_;  // start of secondary rays above the surface, in scene units
};

void require(bool condition, const char* what) {
  if (!condition) throw std::invalid_argument(std::string("render: ") + what);
}

void require_range(const float* values, int64_t n, float hi, const char* what) {
  bool good = true;
  for (int64_t i = 0; i < n; ++i) good &= values[i] >= 0.f && values[i] <= hi;  // false for NaN
  require(good, what);
}

}  // namespace

void render(const Scene& scene, const Surface& surface, const EnvironmentMap& environment, const Camera& camera,
            const PathTracerParams& params, const RenderTargets& targets) {
  require(camera.width > 0 && camera.height > 0, "camera width and height must be positive");
  require(int64_t(camera.width) * camera.height < int64_t(1) << 31, "the image must have fewer than 2^31 pixels");
  require(camera.fx > 0 && camera.fy > 0 && std::isfinite(camera.fx + camera.fy + camera.cx + camera.cy),
          "fx and fy must be positive, cx and cy finite");
  for (float m : camera.camera_to_world) require(std::isfinite(m), "camera_to_world must be finite");
  require(environment.height > 0 && environment.width > 0, "the environment map must not be empty");
  require(params.samples_per_pixel > 0, "samples_per_pixel must be positive");
  require(params.max_bounces >= 0, "max_bounces must not be negative");
  require(params.clamp_indirect >= 0, "clamp_indirect must not be negative");
  const int64_t n = surface.per_triangle ? scene.n_triangles() : scene.n_vertices();
  require_range(surface.albedo, n * 3, 1.f, "albedo must lie in [0, 1]");
  require_range(surface.roughness, n, 1.f, "roughness must lie in [0, 1]");
  require_range(surface.metallic, n, 1.f, "metallic must lie in [0, 1]");
  require_range(environment.radiance, int64_t(environment.height) * environment.width * 3,
                std::numeric_limits<float>::max(), "environment radiance must be finite and not negative");
  if (surface.normals) {
    for (int64_t i = 0; i < scene.n_vertices() * 3; ++i) {
      require(std::isfinite(surface.normals[i]), "normals must be finite");
    }
  }

  const PathTracer tracer(scene, surface, environment, camera, params);
  parallel_for(int64_t(camera.width) * camera.height, kPixelsPerTask, [&](int64_t begin, int64_t end) {
    std::vector<SamplePattern::Offset> offsets;
    for (int64_t pixel = begin; pixel < end; ++pixel) tracer.render_pixel(pixel, offsets, targets);
  });
}

}  // namespace splitnerf
