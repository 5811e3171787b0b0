// A triangle mesh in an Embree acceleration structure, and a registry that lets torch operators
// name a scene by an integer handle.
#pragma once

#include <cstdint>
#include <memory>

#include "splitnerf/config.h"
#include "splitnerf/vec.h"

namespace splitnerf {

struct Hit {
  float t;            // distance along the ray; negative when nothing was hit
  uint32_t triangle;  // index into the mesh's triangles
  float u, v;         // barycentric coordinates of vertices 1 and 2
};

class SPLITNERF_API Scene {
 public:
  // vertices [n_vertices, 3] float32, triangles [n_triangles, 3] int32 (both are copied). Throws
  // std::invalid_argument for an empty mesh, an index out of range, or a vertex that is not finite or farther than 1e12
  // from the origin.
  Scene(const float* vertices, int64_t n_vertices, const int32_t* triangles, int64_t n_triangles);
  ~Scene();
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  // Rays that are not finite, or whose numbers exceed 1e12 (t_far aside), meet nothing.

  // visible[i] = 1 where the segment origin + t direction, t in (0, t_far), meets no triangle.
  // Rays go in packets of 16: neighbours in the arrays should be neighbours in space.
  void trace_visibility(const float* origins, const float* directions, int64_t n_rays, float t_far,
                        uint8_t* visible) const;

  // The same for rays from one point, directions one array a component; n is a multiple of 16. active[i] is -1, or 0 for a
  // ray that is masked out; visible[i] is 0 where something is in the way, else -1.
  void trace_fan(Vec3<float> origin, const float* x, const float* y, const float* z, int64_t n, const int32_t* active,
                 int32_t* visible) const;

  // The nearest hit of each ray with t in (0, t_far); packets of 16 here too.
  void trace_closest(const float* origins, const float* directions, int64_t n_rays, float t_far, Hit* hits) const;

  Hit trace_closest(Vec3<float> origin, Vec3<float> direction, float t_far) const;
  bool occluded(Vec3<float> origin, Vec3<float> direction, float t_far) const;

  int64_t n_vertices() const;
  int64_t n_triangles() const;
  const float* vertices() const;
  const int32_t* triangles() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The registry is thread-safe; a handle is never reused. get_scene throws std::out_of_range.
SPLITNERF_API int64_t register_scene(std::shared_ptr<const Scene> scene);
SPLITNERF_API std::shared_ptr<const Scene> get_scene(int64_t handle);
SPLITNERF_API void release_scene(int64_t handle);

// In a build without Embree (and only there) every ray goes to this callback, which fills `hits`
// with the nearest hits in (0, t_far). `tracer` belongs to the scene, starts empty and may hold
// whatever the callback wants to keep with it. A build with Embree never calls it.
using TraceCallback = void (*)(const Scene& scene, std::shared_ptr<void>& tracer, const float* origins,
                               const float* directions, int64_t n_rays, float t_far, Hit* hits);
SPLITNERF_API void set_trace_callback(TraceCallback callback);

SPLITNERF_API const char* embree_version();  // "3.13.5", or "" in a build without Embree

}  // namespace splitnerf
