// Which samples of a ray are shaded, and between which of these each sample lies.
#pragma once

#include <cstdint>

#include "splitnerf/vec.h"

namespace splitnerf {

// Calls draw(i) for the samples on which one of `per_ray` evenly spaced marks falls when the weights are laid end to end,
// ascending: systematic sampling. One of more than 1 / per_ray of all weight is always drawn. phase in [0, 1): where the
// marks begin. Samples farther than `gap` apart along the ray may be of two surfaces: of each stretch without such a gap the
// heaviest sample is drawn if no mark falls there. per_ray = 0 draws all.
template <class T, class Draw>
SPLITNERF_HD void spread_by_weight(const T* weights, const T* t, int64_t n, T gap, int per_ray, double phase,
                                   Draw draw) {
  double total = 0;
  for (int64_t i = 0; i < n; ++i) total += weights[i];
  const double scale = total > 0 ? per_ray / total : 0;
  double mark = std::floor(phase), before = phase;
  for (int64_t begin = 0, end = 0; begin < n; begin = end) {
    int64_t heaviest = begin;
    for (end = begin + 1; end < n && !(t[end] - t[end - 1] > gap); ++end)
      if (weights[end] > weights[heaviest]) heaviest = end;
    double within = before, after = before;
    for (int64_t i = begin; i < end; ++i) after += weights[i] * scale;
    const bool marked = std::floor(after) > mark;
    for (int64_t i = begin; i < end; ++i) {
      within += weights[i] * scale;
      const bool drawn = per_ray == 0 || (marked ? std::floor(within) > mark : i == heaviest);
      mark = std::floor(within);
      if (drawn) draw(i);
    }
    before = within;
  }
}

// How far t is on the way from t_first to t_second, in [0, 1].
template <class T> SPLITNERF_HD T share_between(T t, T t_first, T t_second) {
  return t_second > t_first ? clamp((t - t_first) / (t_second - t_first), T(0), T(1)) : T(0);
}

}  // namespace splitnerf
