// The mesh that a Scene holds and the registry of handles: all that needs no ray tracer.
#include <atomic>
#include <cmath>
#include <mutex>
#include <stdexcept>
#include <string>
#include <unordered_map>

#include "scene_impl.h"

namespace splitnerf {

Scene::Impl::Impl(const float* vertex_data, int64_t vertex_count, const int32_t* triangle_data, int64_t triangle_count)
    : n_vertices(vertex_count), n_triangles(triangle_count) {
  if (n_vertices <= 0 || n_triangles <= 0) {
    throw std::invalid_argument("Scene: the mesh must have vertices and triangles, got " + std::to_string(n_vertices) +
                                " vertices and " + std::to_string(n_triangles) + " triangles");
  }
  if (n_triangles >= int64_t(1) << 32) {
    throw std::invalid_argument("Scene: at most 2^32 - 1 triangles, got " + std::to_string(n_triangles));
  }
  for (int64_t i = 0; i < n_vertices * 3; ++i) {
    if (!(std::fabs(vertex_data[i]) <= kFarthest)) {
      throw std::invalid_argument("Scene: vertex " + std::to_string(i / 3) +
                                  " is not finite, or farther than 1e12 from the origin");
    }
  }
  for (int64_t i = 0; i < n_triangles * 3; ++i) {
    if (triangle_data[i] < 0 || triangle_data[i] >= n_vertices) {
      throw std::invalid_argument("Scene: triangle " + std::to_string(i / 3) + " names vertex " +
                                  std::to_string(triangle_data[i]) + ", but there are " + std::to_string(n_vertices) +
                                  " vertices");
    }
  }
  vertices.reserve(n_vertices * 3 + 1);
  vertices.assign(vertex_data, vertex_data + n_vertices * 3);
  vertices.push_back(0.f);
  triangles.assign(triangle_data, triangle_data + n_triangles * 3);
}

Scene::~Scene() = default;

int64_t Scene::n_vertices() const { return impl_->n_vertices; }
int64_t Scene::n_triangles() const { return impl_->n_triangles; }
const float* Scene::vertices() const { return impl_->vertices.data(); }
const int32_t* Scene::triangles() const { return impl_->triangles.data(); }

namespace {

struct Registry {
  std::mutex mutex;
  std::unordered_map<int64_t, std::shared_ptr<const Scene>> scenes;
  int64_t next_handle = 1;
};

// Never destroyed: scenes may be released by objects that outlive static destruction.
Registry& registry() {
  static Registry* instance = new Registry;
  return *instance;
}

}  // namespace

int64_t register_scene(std::shared_ptr<const Scene> scene) {
  if (!scene) throw std::invalid_argument("register_scene: the scene is null");
  Registry& r = registry();
  std::lock_guard<std::mutex> lock(r.mutex);
  r.scenes.emplace(r.next_handle, std::move(scene));
  return r.next_handle++;
}

std::shared_ptr<const Scene> get_scene(int64_t handle) {
  Registry& r = registry();
  std::lock_guard<std::mutex> lock(r.mutex);
  const auto found = r.scenes.find(handle);
  if (found == r.scenes.end()) {
    throw std::out_of_range("get_scene: no scene has the handle " + std::to_string(handle));
  }
  return found->second;
}

void release_scene(int64_t handle) {
  std::shared_ptr<const Scene> released;  // destroyed after the lock is gone
  Registry& r = registry();
  std::lock_guard<std::mutex> lock(r.mutex);
  const auto found = r.scenes.find(handle);
  if (found == r.scenes.end()) return;
  released = std::move(found->second);
  r.scenes.erase(found);
}

namespace {

std::atomic<TraceCallback> registered_callback{nullptr};

}  // namespace

void set_trace_callback(TraceCallback callback) { registered_callback = callback; }
TraceCallback trace_callback() { return registered_callback; }

}  // namespace splitnerf
