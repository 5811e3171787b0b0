// What sums over directions add to the rays' colours: which points get one, and by which share of the ray it counts.
#pragma once

#include "splitnerf/accumulate.h"
#include "splitnerf/split_sum.h"

namespace splitnerf {

// Points among n whose lobes are wide enough for such a sum: its share grows smoothly from 0 at the roughness `low` to 1 at `high`.
// On the CPU `candidates` has been checked. On the GPU it has not; any value keeps all accesses inside the arrays.
template <class T> struct WideLobes {
  const int64_t* candidates;
  const T* roughness;
  int64_t n_points;
  T low, high;

  SPLITNERF_HD int64_t point(int64_t i) const { return clamp<int64_t>(candidates[i], 0, n_points - 1); }
  SPLITNERF_HD T share(int64_t i) const { return smoothstep(low, high, roughness[point(i)]); }
};

// All candidates stay; those past the number that counts get a share of 0.
template <class T> struct ShareWideLobesBody {
  WideLobes<T> lobes;
  const int64_t* n_candidates;
  int64_t* at;
  T* share;

  SPLITNERF_HD void operator()(int64_t i) const {
    at[i] = lobes.point(i);
    share[i] = i < *n_candidates ? lobes.share(i) : T(0);
  }
};
SPLITNERF_ON_GPU(ShareWideLobesBody);

// Only those with a share stay: how many each gives, counted into counts [1 + i], and where they go, offsets [i].
template <class T> struct CountWideLobesBody {
  WideLobes<T> lobes;
  int64_t* counts;

  SPLITNERF_HD void operator()(int64_t i) const { counts[1 + i] = lobes.share(i) > T(0) ? 1 : 0; }
};
SPLITNERF_ON_GPU(CountWideLobesBody);

template <class T> struct PackWideLobesBody {
  WideLobes<T> lobes;
  const int64_t* offsets;
  int64_t* at;
  T* share;

  SPLITNERF_HD void operator()(int64_t i) const {
    if (offsets[i + 1] == offsets[i]) return;
    at[offsets[i]] = lobes.point(i);
    share[offsets[i]] = lobes.share(i);
  }
};
SPLITNERF_ON_GPU(PackWideLobesBody);

// The shaded samples of rays, in segments that lie one after the other, with the weight that each stands for.
template <class T> struct ShadedSegments {
  int64_t n_shaded, n_samples, n_rays;
  const int64_t *shaded, *ray_indices, *segment;  // [n_shaded] the sample of each, [n_samples], [n_shaded]
  const T *weights, *opacity;                     // [n_shaded], [n_rays]
  T min_opacity;

  SPLITNERF_HD int64_t ray_of(int64_t k) const {
    return clamp<int64_t>(ray_indices[clamp<int64_t>(shaded[k], 0, n_samples - 1)], 0, n_rays - 1);
  }
  // The share of the ray's opacity that the segment of shaded sample k carries.
  SPLITNERF_HD T part_of(int64_t k) const {
    int64_t first = k;
    while (first > 0 && segment[first - 1] == segment[k]) --first;
    T carried = T(0);
    for (int64_t j = first; j < n_shaded && segment[j] == segment[k]; ++j) carried += weights[j];
    return carried / max_of(opacity[ray_of(k)], min_opacity);
  }
};

// mean [n_rays, 3] += part correction, at the ray of each corrected sample.
template <class T> struct AddCorrectionsBody {
  static constexpr bool adds_to_shared = true;
  ShadedSegments<T> segments;
  const int64_t* at;
  const T* correction;
  T* mean;

  SPLITNERF_HD void operator()(int64_t i) const {
    const int64_t k = clamp<int64_t>(at[i], 0, segments.n_shaded - 1);
    add3_to(mean + 3 * segments.ray_of(k), load3(correction + 3 * i) * segments.part_of(k));
  }
};
SPLITNERF_ON_GPU(AddCorrectionsBody);

// grad_correction = part grad_mean
template <class T> struct AddCorrectionsBackwardBody {
  ShadedSegments<T> segments;
  const int64_t* at;
  const T* grad_mean;
  T* grad_correction;

  SPLITNERF_HD void operator()(int64_t i) const {
    const int64_t k = clamp<int64_t>(at[i], 0, segments.n_shaded - 1);
    store3(grad_correction + 3 * i, load3(grad_mean + 3 * segments.ray_of(k)) * segments.part_of(k));
  }
};
SPLITNERF_ON_GPU(AddCorrectionsBackwardBody);

}  // namespace splitnerf
