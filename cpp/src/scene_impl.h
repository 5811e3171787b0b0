// What every Scene holds, whichever library traces it.
#pragma once

#include <cmath>
#include <memory>
#include <vector>

#include "splitnerf/scene.h"

namespace splitnerf {

// Embree ends the process for numbers that are not finite, or whose products are not.
inline constexpr float kFarthest = 1e12f;

inline bool fits(Vec3<float> v) {  // false for NaN
  return std::fabs(v.x) <= kFarthest && std::fabs(v.y) <= kFarthest && std::fabs(v.z) <= kFarthest;
}

// Whether a ray can be traced; one that cannot meets nothing.
inline bool can_be_traced(Vec3<float> origin, Vec3<float> direction, float t_far) {
  return fits(origin) && fits(direction) && t_far >= 0.f;
}

struct Scene::Impl {
  // Copies and validates the mesh; throws std::invalid_argument.
  Impl(const float* vertices, int64_t n_vertices, const int32_t* triangles, int64_t n_triangles);

  int64_t n_vertices, n_triangles;
  std::vector<float> vertices;     // n_vertices * 3 and one float of padding: Embree loads 16 bytes a vertex
  std::vector<int32_t> triangles;  // n_triangles * 3
  std::shared_ptr<void> tracer;    // the acceleration structure, owned through its own deleter
};

TraceCallback trace_callback();  // what set_trace_callback registered last, or null

}  // namespace splitnerf
