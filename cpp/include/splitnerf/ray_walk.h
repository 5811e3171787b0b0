// Walking along a ray through a distance field, to find the samples that a pixel is made of.
#pragma once

#include "splitnerf/march.h"
#include "splitnerf/neus.h"

namespace splitnerf {

// Which samples of a ray are worth a gradient.
template <class T> struct SampleRules {
  T s;           // sharpness of the density
  T anneal;      // of the cosine, see annealed_cosine
  T min_weight;  // of a sample to be kept
  T faint;       // -log(min_weight)
  T max_depth;   // optical depth at which the ray ends
  T reach;       // farther than this outside the surface there is no density
  T lipschitz;   // bound of |grad f|
};

inline constexpr int kNoDepth = 20;  // where s f is above, an interval that ends there has a depth below 2e-9

// A ray on its way.
template <class T> struct Walk {
  RayLattice<T> lattice;
  int64_t ray;
  int64_t next;             // the sample at which the distance is asked for next; -1 where the ray has ended
  int64_t last = -1;        // the one before, -1 for none
  int64_t n_evaluated = 0;
  T f_last = T(0);          // the distance at `last`
  T depth = T(0);           // optical depth between the middles of the first and the last sample
  bool last_kept = false;

  SPLITNERF_HD Walk(const RayLattice<T>& lattice, int64_t ray, const MarchOptions& march, const OccupancyView& grid)
      : lattice(lattice), ray(ray), next(next_occupied(lattice, grid, march, 0)) {}
};

// Whether either of two neighbouring samples may weigh more than min_weight, f and f_next at their middles, `apart` from
// each other: by what may lie between the middles, where with a slope of 1 at most f falls to (f + f_next - apart) / 2; or as
// surface_weights renders them, from the slope between them. No interval is deeper than exp(-s f) at its end.
template <class T>
SPLITNERF_HD bool may_weigh(const SampleRules<T>& rules, T passed_depth, T f, T f_next, T apart, T step) {
  const T lowest = min_of(f_next, T(0.5) * (f + f_next - apart)), end = min_of(lowest, min_of(f, f_next) - T(0.5) * step);
  if (rules.s * end > rules.faint || passed_depth > rules.faint) return false;
  const T least = -std::log1p(-rules.min_weight * std::exp(passed_depth));  // the depth that weighs min_weight
  if (neus_optical_depth(f, lowest, rules.s) > least) return true;
  const T slope = clamp((f_next - f) / apart, T(-1), T(1)), half = T(0.5) * step * annealed_cosine(slope, rules.anneal).value;
  return neus_optical_depth(f - half, f + half, rules.s) > least ||
         neus_optical_depth(f_next - half, f_next + half, rules.s) > least;
}

// Takes the distance f at walk.next and moves on; keep(t_start) is called for the samples to be kept, front to back. Within
// (|f| - reach) / lipschitz no density begins, and samples there are left out; where the field turns out steeper than that,
// the walk goes back and looks. A distance that is not finite is kept: whoever renders the samples shall see it.
template <class T, class Keep>
SPLITNERF_HD void advance(Walk<T>& walk, T f, const OccupancyView& grid, const MarchOptions& march, const SampleRules<T>& rules, Keep keep) {
  const T step = walk.lattice.step;
  ++walk.n_evaluated;
  const bool jumped = walk.last >= 0 && walk.next > walk.last + 1 && walk.n_evaluated < march.max_samples;
  if (jumped && (std::abs(f) < rules.reach || (f < T(0)) != (walk.f_last < T(0)))) {
    const int64_t between = next_occupied(walk.lattice, grid, march, walk.last + 1);
    if (between < walk.next) {
      walk.next = between;
      return;
    }
  }
  bool kept = !(std::abs(f) < T(INFINITY));
  if (walk.last >= 0) {
    if (may_weigh(rules, walk.depth, walk.f_last, f, T(walk.next - walk.last) * step, step)) {
      if (!walk.last_kept) keep(walk.lattice.start(walk.last));
      kept = true;
    }
    if (rules.s * f < kNoDepth) walk.depth += neus_optical_depth(walk.f_last, f, rules.s);
  }
  if (kept) keep(walk.lattice.start(walk.next));
  const int64_t here = walk.next;
  walk.last = here, walk.f_last = f, walk.last_kept = kept;
  if (walk.depth > rules.max_depth || walk.n_evaluated >= march.max_samples) {
    walk.next = -1;
    return;
  }
  const T free = (std::abs(f) - rules.reach) / (rules.lipschitz * step);
  const int64_t stride = free > T(1) ? static_cast<int64_t>(min_of(free, T(walk.lattice.n_steps))) : 1;
  walk.next = next_occupied(walk.lattice, grid, march, here + stride);
}

}  // namespace splitnerf
