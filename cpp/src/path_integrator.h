// Paths through a scene: the light that leaves a point of its surface.
#pragma once

#include <cmath>
#include <limits>
#include <vector>

#include "sample_pattern.h"
#include "shading_point.h"
#include "splitnerf/environment_sampler.h"
#include "splitnerf/path_tracer.h"
#include "splitnerf/principled.h"
#include "splitnerf/sampling.h"

namespace splitnerf {

// Power heuristic with exponent 2, pdf > 0; as a ratio neither square can overflow or vanish.
// Source: Veach 1997, Eq. (9.15).
inline float mis_weight(float pdf, float other_pdf) { return 1.f / (1.f + square(other_pdf / pdf)); }

// What sets the random numbers of a pixel's paths, or a point's, apart from those of others.
using PathOffsets = std::vector<SamplePattern::Offset>;

class PathIntegrator {
 public:
  using Vec = Vec3<float>;
  static constexpr int kPairsPerBounce = 3;  // light direction; BSDF direction; lobe choice and roulette

  // n_samples: the paths that share one set of well-spread random numbers.
  PathIntegrator(const Scene& scene, const Surface& surface, const EnvironmentMap& environment,
                 const PathTracerParams& params, int n_samples)
      : scene_(scene), surface_(scene, surface), light_(environment.radiance, environment.height, environment.width),
        params_(params), pattern_(n_samples, 1 + kPairsPerBounce * (params.max_bounces + 1), params.seed) {
    float extent = 0;
    for (int64_t i = 0; i < scene.n_vertices() * 3; ++i) extent = max_of(extent, std::abs(scene.vertices()[i]));
    ray_offset_ = 1e-5f * extent;
  }

  const EnvironmentSampler& light() const { return light_; }
  const SamplePattern& pattern() const { return pattern_; }
  const float* lut() const { return lut_; }
  float ray_offset() const { return ray_offset_; }  // start of secondary rays above the surface, in scene units

  // The light that leaves a hit against `direction`; 0 where there is none. `bounce` counts the scattering before.
  //   L = sum over vertices of throughput x (emission + light sampled there + light that the BSDF sample finds).
  Vec radiance(Vec direction, Hit hit, int sample, int first_bounce, const PathOffsets& offsets,
               ShadingPoint* first = nullptr) const {
    Vec radiance{0, 0, 0}, throughput{1, 1, 1};
    Vec origin{0, 0, 0};
    float bsdf_pdf = 0;
    for (int bounce = first_bounce;; ++bounce) {
      if (bounce > first_bounce) hit = scene_.trace_closest(origin, direction, kInfinity);
      if (hit.t < 0) {
        if (bounce > first_bounce) {
          const bool both = params_.light_sampling && !light_.black();
          const float weight = both ? mis_weight(bsdf_pdf, light_.pdf(direction)) : 1.f;
          radiance += limited(throughput * light_.radiance(direction) * weight, bounce > 1);
        }
        return radiance;
      }
      if (bounce > params_.max_bounces) return radiance;

      const ShadingPoint point = surface_(hit, -direction);
      if (bounce == first_bounce && first) *first = point;
      radiance += limited(throughput * point.emission, bounce > 0);
      const Frame<float> frame(point.shading_normal);
      const PrincipledBsdf<float> bsdf(lut_, point.albedo, point.roughness, point.metallic, frame.to_local(-direction));
      const Vec start = point.position + point.geometric_normal * ray_offset_;
      const int pair = 1 + kPairsPerBounce * bounce;

      if (params_.light_sampling && !light_.black()) {
        float light_pdf;
        const Vec to_light = light_.sample(pattern_.get(offsets, sample, pair), &light_pdf);
        // Nothing arrives from below the true surface, whatever the shading normal says.
        if (dot(to_light, point.geometric_normal) > 0) {
          const BsdfValue<float> f = bsdf.evaluate(frame.to_local(to_light));
          if (f.pdf > 0 && !occluded(start, to_light)) {
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

  bool occluded(Vec origin, Vec direction) const { return scene_.occluded(origin, direction, kInfinity); }

 private:
  static constexpr float kInfinity = std::numeric_limits<float>::infinity();
  static constexpr int kRouletteStart = 3;  // bounces before Russian roulette may end a path

  Vec limited(Vec contribution, bool indirect) const {
    const float largest = max_of(contribution.x, max_of(contribution.y, contribution.z));
    if (!indirect || params_.clamp_indirect <= 0 || !(largest > params_.clamp_indirect)) return contribution;
    return contribution * (params_.clamp_indirect / largest);
  }

  const Scene& scene_;
  SurfaceLookup surface_;
  EnvironmentSampler light_;
  const PathTracerParams& params_;
  const float* lut_ = brdf_lut();
  SamplePattern pattern_;
  float ray_offset_;
};

}  // namespace splitnerf
