// The light that arrives at points of an asset: directions drawn by the light and by the material, and what comes from
// each.
#pragma once

#include "splitnerf/path_tracer.h"

namespace splitnerf {

// Points of the surface and unit vectors there, views towards the viewer; both normals are on the viewer's side.
struct SurfacePoints {
  int64_t n;
  const float *positions, *geometric_normals, *normals, *views;  // [n, 3]
  const float *albedo, *roughness, *metallic;                    // [n, 3], [n], [n]
};

struct IncomingLightParams {
  // Of a point. The first ones are drawn by the light: half of all at rough and diffuse points, a quarter at mirrors,
  // none where the light is black. The others are drawn by the material.
  int n_directions = 32;
  int max_bounces = 3;       // scattering events of the light that the asset itself sends
  uint32_t seed = 0;         // equal seeds give equal numbers, whatever the number of threads
  float clamp_indirect = 0;  // as in PathTracerParams, of that light
};

// The sum over a point's directions of solid_angle * f(direction) * radiance estimates the reflected light, where
// radiance is the environment's, if it is visible, and else what the asset sends.
struct IncomingLightTargets {
  float* directions;    // [n, n_directions, 3] unit
  float* solid_angles;  // [n, n_directions] one over the density of all directions together (balance heuristic; Veach
                        // 1997); 0 where a direction does not count, which lies below the horizon of `normals`
  float* visible;       // [n, n_directions] 1 where the environment is seen, else 0; 0 below either horizon
  float* sent;          // [n, n_directions, 3] radiance that the asset sends against the direction
};

// n_directions > 0, max_bounces >= 0. Throws std::invalid_argument where check_surface does and std::runtime_error for
// light that is not finite.
SPLITNERF_API void incoming_light(const Scene& scene, const Surface& surface, const EnvironmentMap& environment,
                                  const SurfacePoints& points, const IncomingLightParams& params,
                                  const IncomingLightTargets& targets);

}  // namespace splitnerf
