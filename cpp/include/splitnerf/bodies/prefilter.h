// The pre-integrated light as a product of two lists, tile by tile: the weights of all pairs are never in memory together.
#pragma once

#include "splitnerf/prefilter.h"

namespace splitnerf {

// A light direction with its radiance, or (backward) a query with ggx_alpha^2 and its share of the gradient.
template <class T> struct alignas(4 * sizeof(T)) LobeSource {
  Vec3<T> direction;
  T alpha_squared;  // of a query
  Vec3<T> value;
};

// One query against a tile of lights: value = sum K L, total = sum K.
template <class T> struct LobeGather {
  Vec3<T> direction;
  T alpha_squared;
  Vec3<T> value{T(0), T(0), T(0)};
  T total = T(0);

  SPLITNERF_HD void add(const LobeSource<T>& light) {
    const Vec3<T> d = direction - light.direction;
    const T k = prefilter_weight(d.x, d.y, d.z, alpha_squared);
    value += light.value * k;
    total += k;
  }
};

// The transpose: one light against a tile of queries.
template <class T> struct LobeScatter {
  Vec3<T> direction;
  Vec3<T> value{T(0), T(0), T(0)};

  SPLITNERF_HD void add(const LobeSource<T>& query) {
    const Vec3<T> d = direction - query.direction;
    value += query.value * prefilter_weight(d.x, d.y, d.z, query.alpha_squared);
  }
};

// A query with no light above its horizon is black.
template <class T> SPLITNERF_HD T inverse_total(T total) { return total == T(0) ? T(0) : T(1) / total; }

// The number of parts that the list of all items is cut into, so that it fills a GPU of any size. It depends on the
// sizes alone, so that the sums have the same bits on every GPU.
inline int lobe_parts(int64_t n_items, int64_t n_sources) {
  constexpr int64_t kWanted = int64_t{1} << 18, kShortest = 256;  // threads; sources of a part
  const int64_t useful = clamp<int64_t>(kWanted / max_of<int64_t>(n_items, 1), 1, 64);
  return static_cast<int>(clamp<int64_t>(n_sources / kShortest, 1, useful));
}
SPLITNERF_HD int64_t part_begin(int64_t n, int part, int n_parts) { return n * part / n_parts; }

// The lists as the two directions of prefilter_light read them.
template <class T> struct LightList {
  int64_t n;
  const T *directions, *radiance;  // [n, 3]

  SPLITNERF_HD LobeSource<T> operator()(int64_t i) const {
    return {load3(directions + 3 * i), T(0), load3(radiance + 3 * i)};
  }
};
template <class T> struct QueryList {
  int64_t n;
  const T *directions, *roughness, *total, *grad_gbar;  // [n, 3], [n], [n], [n, 3]

  SPLITNERF_HD T alpha_squared(int64_t i) const { return square(ggx_alpha_from_roughness(roughness[i])); }
  SPLITNERF_HD LobeSource<T> operator()(int64_t i) const {
    return {load3(directions + 3 * i), alpha_squared(i), load3(grad_gbar + 3 * i) * inverse_total(total[i])};
  }
};

// Adds up the parts [n_parts, n, 4] of each query and divides: gbar [n, 3], total [n].
template <class T> struct GatherFinishBody {
  int64_t n;
  int n_parts;
  const T* parts;
  T *gbar, *total;

  SPLITNERF_HD void operator()(int64_t i) const {
    Vec3<T> value{T(0), T(0), T(0)};
    T sum = T(0);
    for (int part = 0; part < n_parts; ++part) {
      const T* p = parts + 4 * (part * n + i);
      value += load3(p);
      sum += p[3];
    }
    total[i] = sum;
    store3(gbar + 3 * i, value * inverse_total(sum));
  }
};
// The parts [n_parts, n, 3] of each light -> grad_light [n, 3].
template <class T> struct ScatterFinishBody {
  int64_t n;
  int n_parts;
  const T* parts;
  T* grad_light;

  SPLITNERF_HD void operator()(int64_t i) const {
    Vec3<T> value{T(0), T(0), T(0)};
    for (int part = 0; part < n_parts; ++part) value += load3(parts + 3 * (part * n + i));
    store3(grad_light + 3 * i, value);
  }
};

}  // namespace splitnerf
