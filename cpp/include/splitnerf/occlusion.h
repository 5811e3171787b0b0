// Occlusion factors: the share of the light that reaches a point past the object itself.
#pragma once

#include "splitnerf/vec.h"

namespace splitnerf {

struct OcclusionOptions {
  int n_diffuse_rays;   // cosine-weighted about n
  int n_specular_rays;  // D(w)(w.d)+ about the lobe's axis d
  float offset;         // rays start this far from the surface along n, scene units
  uint32_t seed;
  bool along_ray = false;  // they start as far along themselves
};

inline constexpr double kBlackLight = 1e-4;

// o = (sum L V + eps sum V) / (sum L + eps sum 1) per channel, over directions sampled from the
// kernel of the integral (so that their weights cancel). eps makes o fall back to the geometric
// share where the light is black. Directions below the surface's horizon count in neither
// sum: the BRDF table already leaves them out. o = 1 where no direction counts.
// Source: SplitNeRF Eq. (14), (15).
template <class T> struct OcclusionSum {
  Vec3<T> open{T(0), T(0), T(0)}, all{T(0), T(0), T(0)};

  SPLITNERF_HD void add(Vec3<T> light, bool visible) {
    const Vec3<T> weight = light + Vec3<T>{T(kBlackLight), T(kBlackLight), T(kBlackLight)};
    all += weight;
    if (visible) open += weight;
  }
  SPLITNERF_HD Vec3<T> factor() const {
    Vec3<T> o;
    for (int c = 0; c < 3; ++c) o[c] = all[c] > T(0) ? open[c] / all[c] : T(1);
    return o;
  }
};

}  // namespace splitnerf
