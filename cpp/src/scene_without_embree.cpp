// Scene in a build without Embree: rays go to the callback that the Python module registers.
#include <cmath>
#include <stdexcept>
#include <vector>

#include "scene_impl.h"

namespace splitnerf {

Scene::Scene(const float* vertices, int64_t n_vertices, const int32_t* triangles, int64_t n_triangles)
    : impl_(std::make_unique<Impl>(vertices, n_vertices, triangles, n_triangles)) {}

void Scene::trace_closest(const float* origins, const float* directions, int64_t n_rays, float t_far, Hit* hits) const {
  const TraceCallback callback = trace_callback();
  if (!callback) {
    throw std::runtime_error(
        "Scene: this build has no Embree and no trace callback is registered (set_trace_callback)");
  }
  std::vector<float> o(origins, origins + 3 * n_rays), d(directions, directions + 3 * n_rays);
  std::vector<bool> traced(n_rays);
  for (int64_t i = 0; i < n_rays; ++i) {
    traced[i] = can_be_traced(load3(&o[3 * i]), load3(&d[3 * i]), t_far);
    if (traced[i]) continue;
    store3(&o[3 * i], Vec3<float>{0.f, 0.f, 0.f});
    store3(&d[3 * i], Vec3<float>{0.f, 0.f, 1.f});
  }
  if (n_rays > 0) callback(*this, impl_->tracer, o.data(), d.data(), n_rays, t_far >= 0.f ? t_far : 0.f, hits);
  for (int64_t i = 0; i < n_rays; ++i) {
    if (!traced[i]) hits[i] = {-1.f, 0, 0.f, 0.f};
  }
}

void Scene::trace_visibility(const float* origins, const float* directions, int64_t n_rays, float t_far,
                             uint8_t* visible) const {
  std::vector<Hit> hits(n_rays);
  trace_closest(origins, directions, n_rays, t_far, hits.data());
  for (int64_t i = 0; i < n_rays; ++i) visible[i] = hits[i].t < 0.f;
}

void Scene::trace_fan(Vec3<float> origin, const float* x, const float* y, const float* z, int64_t n,
                      const int32_t* active, int32_t* visible) const {
  std::vector<float> origins(3 * n), directions(3 * n);
  std::vector<uint8_t> open(n);
  for (int64_t i = 0; i < n; ++i) {
    store3(&origins[3 * i], origin);
    store3(&directions[3 * i], Vec3<float>{x[i], y[i], z[i]});
  }
  trace_visibility(origins.data(), directions.data(), n, INFINITY, open.data());
  for (int64_t i = 0; i < n; ++i) visible[i] = active[i] && !open[i] ? 0 : -1;
}

Hit Scene::trace_closest(Vec3<float> origin, Vec3<float> direction, float t_far) const {
  Hit hit;
  trace_closest(&origin.x, &direction.x, 1, t_far, &hit);
  return hit;
}

bool Scene::occluded(Vec3<float> origin, Vec3<float> direction, float t_far) const {
  return trace_closest(origin, direction, t_far).t >= 0.f;
}

const char* embree_version() { return ""; }

}  // namespace splitnerf
