// The choice of a ray's shaded samples, and the two shaded neighbours of every sample.
#pragma once

#include <cstdint>

#include "splitnerf/vec.h"

namespace splitnerf {

// Systematic sampling: the weights are laid end to end with `per_ray` evenly spaced marks on them, and draw(i) is
// called, ascending, for each sample that a mark falls on. A sample with more than 1 / per_ray of all weight is always
// drawn. phase in [0, 1) is the position of the first mark. Neighbouring samples more than `gap` apart along the ray
// may lie on two surfaces, so the ray is split there into segments; if no mark falls on a segment, its heaviest sample
// is drawn. per_ray = 0 draws all samples.
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

// The position of t between t_first and t_second, in [0, 1].
template <class T> SPLITNERF_HD T share_between(T t, T t_first, T t_second) {
  return t_second > t_first ? clamp((t - t_first) / (t_second - t_first), T(0), T(1)) : T(0);
}

// A ray's samples [begin, end), and its shaded samples: positions [at, at + drawn) in `shaded`, drawn > 0.
template <class T> struct SpreadRay {
  const T *weights, *t;
  int64_t begin, end;
  const int64_t* shaded;
  int64_t at, drawn;
};

// The position in `shaded` of the largest weight of the ray.
template <class T> SPLITNERF_HD int64_t heaviest_drawn(const SpreadRay<T>& ray) {
  int64_t heaviest = ray.at;
  for (int64_t k = ray.at; k < ray.at + ray.drawn; ++k)
    if (ray.weights[ray.shaded[k]] > ray.weights[ray.shaded[heaviest]]) heaviest = k;
  return heaviest;
}

// Finds the shaded neighbours of the ray's samples. Fills first, second and share of all samples, stretch (the segment,
// counted from n_before) of the shaded samples, and the leader of each segment. Returns the number of segments, which
// is at most the number of shaded samples.
template <class T>
SPLITNERF_HD int64_t arrange_spread(const SpreadRay<T>& ray, T gap, int64_t n_before, int64_t* first, int64_t* second,
                                    T* share, int64_t* leaders, int64_t* stretch) {
  const int64_t last = ray.at + ray.drawn - 1;
  int64_t at = ray.at, n_stretches = 0, stretch_end = ray.begin;
  for (int64_t i = ray.begin, first_drawn = at; i < ray.end; ++i) {
    if (i == stretch_end) {  // a new stretch: its neighbours are drawn samples of its own
      for (stretch_end = i + 1; stretch_end < ray.end && !(ray.t[stretch_end] - ray.t[stretch_end - 1] > gap);)
        ++stretch_end;
      while (ray.shaded[first_drawn] < i) ++first_drawn;
      at = first_drawn;
      int64_t leader = at, after = at;
      for (; after <= last && ray.shaded[after] < stretch_end; ++after) {
        if (ray.weights[ray.shaded[after]] > ray.weights[ray.shaded[leader]]) leader = after;
        stretch[after] = n_before + n_stretches;
      }
      leaders[n_stretches++] = leader;
    }
    while (at < last && ray.shaded[at + 1] <= i) ++at;
    const bool more = at < last && ray.shaded[at + 1] < stretch_end;
    first[i] = at, second[i] = ray.shaded[at] < i && more ? at + 1 : at;
    share[i] = share_between(ray.t[i], ray.t[ray.shaded[first[i]]], ray.t[ray.shaded[second[i]]]);
  }
  return n_stretches;
}

}  // namespace splitnerf
