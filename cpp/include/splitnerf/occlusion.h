// Occlusion factors: the share of the light that reaches a point past the object itself.
#pragma once

#include "splitnerf/sampling.h"
#include "splitnerf/vec.h"

namespace splitnerf {

struct OcclusionOptions {
  int n_diffuse_rays;   // cosine-weighted about n
  int n_specular_rays;  // D(w)(w.d)+ about the lobe's axis d
  float offset;         // rays start this far from the surface along n, scene units
  uint32_t seed;
};

inline constexpr double kBlackLight = 1e-4;

inline constexpr int kFanLanes = 16;  // rays of a packet
SPLITNERF_HD int64_t padded_fan(int64_t n) { return (n + kFanLanes - 1) / kFanLanes * kFanLanes; }

// Rays from one point, in directions drawn from a lobe about an axis.
template <class T> struct RayFan {
  const T *u, *v;  // [padded_fan(n)] points of a lattice on [0, 1)^2, 16 that lie together in a row
  int64_t n;
  Vec2<T> shift;   // of the lattice, modulo 1
  Frame<T> frame;  // the lobe's axis
  T edge;          // ggx_lobe_edge of the lobe; 0: the cosine lobe
  Vec3<T> normal;  // directions below its horizon do not count
};

// o = (sum L V + eps sum V) / (sum L + eps sum 1) per channel, over directions sampled from the
// kernel of the integral (so that their weights cancel). eps makes o fall back to the geometric
// share where the light is black. Directions below the surface's horizon count in neither
// sum: the BRDF table already leaves them out. o = 1 where no direction counts.
// Source: SplitNeRF Eq. (14), (15).
template <class T> SPLITNERF_HD Vec3<T> occlusion_factor(Vec3<T> open, Vec3<T> all) {
  Vec3<T> o;
  for (int c = 0; c < 3; ++c) o[c] = all[c] > T(0) ? open[c] / all[c] : T(1);
  return o;
}

}  // namespace splitnerf
