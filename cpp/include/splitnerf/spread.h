// Which samples of a ray are shaded, and between which of these each sample lies.
#pragma once

#include <cstdint>

#include "splitnerf/vec.h"

namespace splitnerf {

// Calls draw(i) for the samples on which one of `per_ray` evenly spaced marks falls when the weights are laid end to end,
// ascending: systematic sampling. One of more than 1 / per_ray of all weight is always drawn, and at least one is. phase in
// [0, 1): where the marks begin. per_ray = 0 draws all.
template <class T, class Draw>
SPLITNERF_HD void spread_by_weight(const T* weights, int64_t n, int per_ray, double phase, Draw draw) {
  if (per_ray == 0) {
    for (int64_t i = 0; i < n; ++i) draw(i);
    return;
  }
  double total = 0;
  for (int64_t i = 0; i < n; ++i) total += weights[i];
  if (!(total > 0)) {
    if (n > 0) draw(n / 2);
    return;
  }
  double before = 0, mark = std::floor(phase);
  for (int64_t i = 0; i < n; ++i) {
    before += weights[i];
    const double end = std::floor(i + 1 < n ? before * (per_ray / total) + phase : per_ray + phase);
    if (end > mark) draw(i);
    mark = end;
  }
}

// How far t is on the way from t_first to t_second, in [0, 1].
template <class T> SPLITNERF_HD T share_between(T t, T t_first, T t_second) {
  return t_second > t_first ? clamp((t - t_first) / (t_second - t_first), T(0), T(1)) : T(0);
}

}  // namespace splitnerf
