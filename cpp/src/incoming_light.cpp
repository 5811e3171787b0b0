#include "splitnerf/incoming_light.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "path_integrator.h"
#include "splitnerf/parallel.h"

namespace splitnerf {
namespace {

using Vec = Vec3<float>;

constexpr int64_t kPointsPerTask = 16;

class LightGatherer {
 public:
  LightGatherer(const Scene& scene, const Surface& surface, const EnvironmentMap& environment,
                const SurfacePoints& points, const PathTracerParams& path, int n_directions)
      : scene_(scene), points_(points), n_(n_directions), seed_(path.seed),
        paths_(scene, surface, environment, path, n_directions) {}

  // The rays of one point.
  struct Worker {
    PathOffsets offsets;
    std::vector<int> numbers;  // of their directions
    std::vector<Vec> origins, directions;
    std::vector<Hit> hits;
    explicit Worker(int n) : hits(n) {}
  };

  void gather(int64_t point, Worker& worker, const IncomingLightTargets& out) const {
    draw(point, worker, out);
    const int n_rays = static_cast<int>(worker.numbers.size());
    std::fill_n(out.visible + point * n_, n_, 0.f);
    std::fill_n(out.sent + 3 * point * n_, 3 * n_, 0.f);
    if (n_rays == 0) return;
    scene_.trace_closest(&worker.origins[0].x, &worker.directions[0].x, n_rays, std::numeric_limits<float>::infinity(),
                         worker.hits.data());
    paths_.pattern().start_pixel(static_cast<uint32_t>(point), worker.offsets);
    for (int ray = 0; ray < n_rays; ++ray) {
      const int i = worker.numbers[ray];
      const int64_t at = point * n_ + i;
      if (worker.hits[ray].t < 0) {
        out.visible[at] = 1.f;
        continue;
      }
      const Vec sent = paths_.radiance(worker.directions[ray], worker.hits[ray], i, 1, worker.offsets);
      if (!std::isfinite(sum(sent))) {
        throw std::runtime_error("incoming_light: the light at point " + std::to_string(point) + " is not finite");
      }
      store3(out.sent + 3 * at, sent);
    }
  }

 private:
  // Directions of a point, the solid angle that each stands for, and rays along those from which light can arrive.
  void draw(int64_t point, Worker& worker, const IncomingLightTargets& out) const {
    const Vec normal = load3(points_.normals + 3 * point), geometric = load3(points_.geometric_normals + 3 * point);
    const Frame<float> frame(normal);
    Vec view = frame.to_local(load3(points_.views + 3 * point));
    view.z = max_of(view.z, float(kMinNdotV));
    const PrincipledBsdf<float> bsdf(paths_.lut(), load3(points_.albedo + 3 * point), points_.roughness[point],
                                     points_.metallic[point], normalize(view));
    const Vec start = load3(points_.positions + 3 * point) + geometric * paths_.ray_offset();
    const EnvironmentSampler& light = paths_.light();
    const auto counter = static_cast<uint32_t>(point);
    const auto shift = [&](uint32_t k) {
      return Vec2<float>{random_unit<float>(seed_, counter, k), random_unit<float>(seed_, counter, k + 1)};
    };
    // Directions drawn by the light rarely fall into a narrow lobe; the diffuse lobe of a glossy point needs some still.
    const float glossy = bsdf.specular_probability() * (1.f - ggx_alpha_from_roughness(points_.roughness[point]));
    const float light_share = light.black() ? 0.f : 0.5f - 0.25f * glossy;
    const int n_light = static_cast<int>(light_share * n_ + 0.5f), n_bsdf = n_ - n_light;
    const Vec2<float> light_shift = shift(0), bsdf_shift = shift(2);
    const float lobe_shift = random_unit<float>(seed_, counter, 4);
    worker.numbers.clear(), worker.origins.clear(), worker.directions.clear();
    for (int i = 0; i < n_; ++i) {
      Vec direction;
      float light_pdf;
      if (i < n_light) {
        direction = light.sample(fibonacci_lattice<float>(i, n_light, light_shift), &light_pdf);
      } else {
        const int k = i - n_light;
        const Vec2<float> u = fibonacci_lattice<float>(k, n_bsdf, bsdf_shift);
        const float lobe = wrap_unit(r2_lattice<float>(k).x, lobe_shift);
        direction = normalize(frame.to_world(bsdf.sample(lobe, u.x, u.y)));
        light_pdf = n_light ? light.pdf(direction) : 0.f;
      }
      const float bsdf_pdf = bsdf.evaluate(frame.to_local(direction)).pdf;
      const bool counts = bsdf_pdf > 0;
      store3(out.directions + 3 * (point * n_ + i), direction);
      out.solid_angles[point * n_ + i] = counts ? 1.f / (n_light * light_pdf + n_bsdf * bsdf_pdf) : 0.f;
      // Nothing arrives from below the true surface, whatever the shading normal says.
      if (!counts || !(dot(direction, geometric) > 0)) continue;
      worker.numbers.push_back(i), worker.origins.push_back(start), worker.directions.push_back(direction);
    }
  }

  const Scene& scene_;
  const SurfacePoints& points_;
  int n_;
  uint32_t seed_;
  PathIntegrator paths_;
};

}  // namespace

void incoming_light(const Scene& scene, const Surface& surface, const EnvironmentMap& environment,
                    const SurfacePoints& points, const IncomingLightParams& params,
                    const IncomingLightTargets& targets) {
  check_surface("incoming_light", scene, surface, environment);
  PathTracerParams path;
  path.max_bounces = params.max_bounces;
  path.seed = params.seed;
  path.clamp_indirect = params.clamp_indirect;
  const LightGatherer gatherer(scene, surface, environment, points, path, params.n_directions);
  parallel_for(points.n, kPointsPerTask, [&](int64_t begin, int64_t end) {
    LightGatherer::Worker worker(params.n_directions);
    for (int64_t point = begin; point < end; ++point) gatherer.gather(point, worker, targets);
  });
}

}  // namespace splitnerf
