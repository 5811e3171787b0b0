// Walking along a ray through a distance field, to find the samples that a pixel is made of.
#pragma once

#include "splitnerf/march.h"
#include "splitnerf/neus.h"
#include "splitnerf/vector_math.h"

namespace splitnerf {

// Which samples of a ray are worth a gradient.
template <class T> struct SampleRules {
  T s;                  // sharpness of the density
  T anneal;             // of the cosine, see annealed_cosine
  T min_weight;         // of a sample to be kept
  T faint;              // -log(min_weight)
  T min_transmittance;  // below it the ray ends
  T reach;              // farther than this outside the surface there is no density
  T lipschitz;          // bound of |grad f|
};

// A field that is steeper than rules.lipschitz makes a walk go back and look at what it leapt over, two distances for each sample.
// It does that so many times on a ray; from then on it takes the bound to be so many times as large, and goes back no more.
inline constexpr int kMostReturns = 32, kSteeperThen = 4;

inline constexpr int kNoDepth = 20;  // where s f is above, an interval that ends there has a depth below 2e-9

// Depth of the density behind a distance f: that of an interval is the depth at its end less that at its start, see
// neus_optical_depth.
template <class T> SPLITNERF_HD T depth_at(T f, T s) {
  return s * f < T(kNoDepth) ? softplus_and_slope(-s * f, T(1)).value : T(0);
}

// A ray on its way.
template <class T> struct Walk {
  RayLattice<T> lattice;
  int64_t ray;
  int64_t next;        // the sample at which the distance is asked for next; -1 where the ray has ended
  int64_t last = -1;   // the one before, -1 for none
  int64_t stride = 1;  // so many samples on from `last`; further ones up to `next` are in empty cells
  int64_t n_evaluated = 0;
  int n_returns = 0;       // how often it went back
  T f_last = T(0);         // the distance at `last`
  T depth_last = T(0);     // depth_at there
  T transmittance = T(1);  // between the middles of the first and the last sample
  bool last_kept = false;

  SPLITNERF_HD Walk(const RayLattice<T>& lattice, int64_t ray, const MarchOptions& march, const OccupancyView& grid)
      : lattice(lattice), ray(ray), next(next_occupied(lattice, grid, march, 0)) {}
  SPLITNERF_HD bool goes_back() const { return n_returns < kMostReturns; }
};

// The neighbour of a walk's last sample.
template <class T> struct NextSample {
  T f, depth;     // the distance at its middle, and depth_at there
  T apart;        // from the last sample's middle
  T occupied;     // of that, what is not in empty cells
  T transmitted;  // share of the light that passes between the middles
};

// Whether the walk's last sample or its neighbour may weigh more than min_weight: by what lies between the middles, where with
// a slope of 1 at most f falls to (f + f_next - occupied) / 2; or as surface_weights renders them, from the slope between them.
// No interval is deeper than exp(-s f) at its end.
template <class T>
SPLITNERF_HD bool may_weigh(const SampleRules<T>& rules, const Walk<T>& walk, const NextSample<T>& next) {
  const T f = walk.f_last, step = walk.lattice.step, passed = walk.transmittance;
  const T lowest = min_of(next.f, T(0.5) * (f + next.f - next.occupied)),
          end = min_of(lowest, min_of(f, next.f) - T(0.5) * step);
  if (rules.s * end > rules.faint || passed < rules.min_weight) return false;
  if (passed * (T(1) - next.transmitted) > rules.min_weight) return true;
  const auto weighs = [&](T depth) { return depth > T(0) && passed * (T(1) - exp_of_minus(depth)) > rules.min_weight; };
  if (weighs(depth_at(lowest, rules.s) - walk.depth_last)) return true;
  const T slope = clamp((next.f - f) / next.apart, T(-1), T(1));
  const T half = T(0.5) * step * annealed_cosine(slope, rules.anneal).value;
  return weighs(depth_at(f + half, rules.s) - depth_at(f - half, rules.s)) ||
         weighs(depth_at(next.f + half, rules.s) - depth_at(next.f - half, rules.s));
}

// Takes the distance f at walk.next and moves on; keep(t_start) is called for the samples to be kept, front to back. Within
// (|f| - reach) / lipschitz no density begins, and samples there are left out; where the field turns out steeper than that,
// the walk goes back and looks, but see kMostReturns. A distance that is not finite is kept: whoever renders the samples shall see it.
template <class T, class Keep>
SPLITNERF_HD void advance(Walk<T>& walk, T f, const OccupancyView& grid, const MarchOptions& march,
                          const SampleRules<T>& rules, Keep keep) {
  const T step = walk.lattice.step;
  ++walk.n_evaluated;
  const bool jumped =
      walk.last >= 0 && walk.next > walk.last + 1 && walk.goes_back() && walk.n_evaluated < march.max_samples;
  if (jumped && (std::abs(f) < rules.reach || (f < T(0)) != (walk.f_last < T(0)))) {
    const int64_t between = next_occupied(walk.lattice, grid, march, walk.last + 1);
    if (between < walk.next) {
      walk.next = between, walk.stride = 1;
      ++walk.n_returns;
      return;
    }
  }
  bool kept = !(std::abs(f) < T(INFINITY));
  const T depth = depth_at(f, rules.s);
  if (walk.last >= 0) {
    const T transmitted = exp_of_minus(max_of(depth - walk.depth_last, T(0)));
    if (may_weigh(rules, walk, {f, depth, T(walk.next - walk.last) * step, T(walk.stride) * step, transmitted})) {
      if (!walk.last_kept) keep(walk.lattice.start(walk.last));
      kept = true;
    }
    walk.transmittance *= transmitted;
  }
  if (kept) keep(walk.lattice.start(walk.next));
  const int64_t here = walk.next;
  walk.last = here, walk.f_last = f, walk.depth_last = depth, walk.last_kept = kept;
  if (walk.transmittance < rules.min_transmittance || walk.n_evaluated >= march.max_samples) {
    walk.next = -1;
    return;
  }
  const T steepest = walk.goes_back() ? rules.lipschitz : T(kSteeperThen) * rules.lipschitz;
  const T free = (std::abs(f) - rules.reach) / (steepest * step);
  walk.stride = free > T(1) ? static_cast<int64_t>(min_of(free, T(walk.lattice.n_steps))) : 1;
  walk.next = next_occupied(walk.lattice, grid, march, here + walk.stride);
}

}  // namespace splitnerf
