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
  T max_depth;   // optical depth at which the ray ends
  T reach;       // farther than this outside the surface there is no density
  T lipschitz;   // bound of |grad f|
};

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

  SPLITNERF_HD Walk(const RayLattice<T>& lattice, int64_t ray, const MarchOptions& march, const uint8_t* cells)
      : lattice(lattice), ray(ray), next(next_occupied(lattice, cells, march, 0)) {}
};

// Optical depth that either of two neighbouring samples may have, f and f_next at their middles, `apart` from each other:
// as surface_weights renders them, from the slope between them; and of what may lie between the middles, where with a slope of 1 at
// most f falls to (f + f_next - apart) / 2.
template <class T> SPLITNERF_HD T possible_depth(const SampleRules<T>& rules, T f, T f_next, T apart, T step) {
  const T slope = clamp((f_next - f) / apart, T(-1), T(1));
  const T half = T(0.5) * step * annealed_cosine(slope, rules.anneal).value;
  const T between = neus_optical_depth(f, min_of(f_next, T(0.5) * (f + f_next - apart)), rules.s);
  return max_of(between, max_of(neus_optical_depth(f - half, f + half, rules.s),
                                neus_optical_depth(f_next - half, f_next + half, rules.s)));
}

// Takes the distance f at walk.next and moves on; keep(t_start) is called for the samples to be kept, front to back. Within
// (|f| - reach) / lipschitz no density begins, and samples there are left out. A distance that is not finite is kept:
// whoever renders the samples shall see it.
template <class T, class Keep>
SPLITNERF_HD void advance(Walk<T>& walk, T f, const uint8_t* cells, const MarchOptions& march, const SampleRules<T>& rules, Keep keep) {
  const T step = walk.lattice.step;
  bool kept = !(std::abs(f) < T(INFINITY));
  if (walk.last >= 0) {
    const T tau = possible_depth(rules, walk.f_last, f, T(walk.next - walk.last) * step, step);
    if (std::exp(-walk.depth) * -std::expm1(-tau) > rules.min_weight) {
      if (!walk.last_kept) keep(walk.lattice.start(walk.last));
      kept = true;
    }
    walk.depth += neus_optical_depth(walk.f_last, f, rules.s);
  }
  if (kept) keep(walk.lattice.start(walk.next));
  ++walk.n_evaluated;
  const int64_t here = walk.next;
  walk.last = here, walk.f_last = f, walk.last_kept = kept;
  if (walk.depth > rules.max_depth || walk.n_evaluated >= march.max_samples) {
    walk.next = -1;
    return;
  }
  const T free = (std::abs(f) - rules.reach) / (rules.lipschitz * step);
  const int64_t stride = free > T(1) ? static_cast<int64_t>(min_of(free, T(walk.lattice.n_steps))) : 1;
  walk.next = next_occupied(walk.lattice, cells, march, here + stride);
}

}  // namespace splitnerf
