// Lookups in the visibility cache, one group of threads per point: each thread handles some of the fixed directions.
#pragma once

#include "splitnerf/group.h"
#include "splitnerf/occlusion.h"
#include "splitnerf/prefilter.h"
#include "splitnerf/visibility_cache.h"

namespace splitnerf {

// The visibility of one direction from the neighbours of a point.
template <class T> struct DirectionShares {
  T known, open;     // sums of the neighbours' weights
  uint32_t blocked;  // bit k: neighbour k sees it blocked

  SPLITNERF_HD T visible() const { return known > T(0) ? open / known : T(1); }
};
template <class T>
SPLITNERF_HD DirectionShares<T> direction_shares(const VisibilityCache<T>& cache, const Neighbours<T>& near,
                                                 int64_t i) {
  const int64_t n_words = cache.n_directions / kBitsPerWord, word = i / kBitsPerWord;
  const auto bit = static_cast<int>(i % kBitsPerWord);
  DirectionShares<T> shares{T(0), T(0), 0};
  for (int k = 0; k < near.n; ++k) {
    const uint32_t* words = cache.bits + 2 * int64_t(near.vertex[k]) * n_words;
    const bool open = words[word] >> bit & 1u, blocked = words[n_words + word] >> bit & 1u;
    if (open) shares.open += near.weight[k];
    if (open || blocked) shares.known += near.weight[k];
    if (blocked) shares.blocked |= 1u << k;
  }
  return shares;
}

// Whether no neighbour has a blocked direction above the point's horizon; true without neighbours.
template <class T, class Group>
SPLITNERF_HD bool sees_all(const Group& group, const VisibilityCache<T>& cache, const Neighbours<T>& near,
                           Vec3<T> normal) {
  bool any = false;
  for (int64_t i = group.lane(); i < cache.n_directions; i += Group::size)
    any = any || (dot(normal, load3(cache.directions + 3 * i)) > T(0) && direction_shares(cache, near, i).blocked);
  return group.ballot(any) == 0;
}

// sum of what the mesh sends from direction i, each by its neighbour's share of those that know the direction.
template <class T>
SPLITNERF_HD Vec3<T> sent_by_mesh(const VisibilityCache<T>& cache, const Neighbours<T>& near,
                                  const DirectionShares<T>& shares, int64_t i) {
  Vec3<T> sent{T(0), T(0), T(0)};
  for (uint32_t left = shares.blocked; left; left &= left - 1) {
    const int k = lowest_bit(left);
    const int32_t hit = cache.hits[int64_t(near.vertex[k]) * cache.n_directions + i];
    if (hit < 0 || hit >= cache.n_radiance) continue;
    sent += load3(cache.radiance + 3 * int64_t(hit)) * (near.weight[k] / shares.known);
  }
  return sent;
}

template <class T> SPLITNERF_HD bool is_finite(T x) { return std::fabs(x) < T(INFINITY); }

// occlusion_d, occlusion_s [n, 3] and, with hits, indirect_d, indirect_s [n, 3].
template <class T> struct CachedOcclusionBody {
  VisibilityCache<T> cache;
  const T *positions, *normals, *lobe_dirs, *roughness;
  T *occlusion_d, *occlusion_s, *indirect_d, *indirect_s;

  template <class Group> SPLITNERF_HD void operator()(const Group& group, int64_t p) const {
    const Vec3<T> position = load3(positions + 3 * p), normal = load3(normals + 3 * p), lobe = load3(lobe_dirs + 3 * p);
    const T check = sum(position) + sum(normal) + sum(lobe) + roughness[p];
    if (!is_finite(check)) return keep(group, p, {check - check, check - check, check - check}, check - check);
    const Neighbours<T> near = find_neighbours(cache.grids, position, normal);
    if (sees_all(group, cache, near, normal)) return keep(group, p, {T(1), T(1), T(1)}, T(0));

    const T alpha_squared = square(cached_lobe_alpha(roughness[p], static_cast<int>(cache.n_directions)));
    const Vec3<T> none{T(0), T(0), T(0)};
    Vec3<T> open_d = none, all_d = none, open_s = none, all_s = none, sent_d = none, sent_s = none;
    T total_d = T(0), total_s = T(0);
    for (int64_t i = group.lane(); i < cache.n_directions; i += Group::size) {
      const Vec3<T> w = load3(cache.directions + 3 * i), delta = lobe - w;
      const T d = max_of(dot(normal, w), T(0));
      const T s = d > T(0) ? prefilter_weight(delta.x, delta.y, delta.z, alpha_squared) : T(0);
      const Vec3<T> light = load3(cache.light + 3 * i) + Vec3<T>{T(kBlackLight), T(kBlackLight), T(kBlackLight)};
      const DirectionShares<T> shares = direction_shares(cache, near, i);
      const T visible = shares.visible();
      all_d += light * d, total_d += d, open_d += light * (visible * d);
      all_s += light * s, total_s += s, open_s += light * (visible * s);
      if (!cache.hits || !(d > T(0)) || !shares.blocked) continue;
      const Vec3<T> sent = sent_by_mesh(cache, near, shares, i);
      sent_d += sent * d, sent_s += sent * s;
    }
    const Vec3<T> o_d = ratio(sum3(group, open_d), sum3(group, all_d)),
                  o_s = ratio(sum3(group, open_s), sum3(group, all_s));
    total_d = group.sum(total_d), total_s = group.sum(total_s);
    sent_d = sum3(group, sent_d), sent_s = sum3(group, sent_s);
    if (group.lane() > 0) return;
    store3(occlusion_d + 3 * p, o_d), store3(occlusion_s + 3 * p, o_s);
    if (!cache.hits) return;
    store3(indirect_d + 3 * p, sent_d * (total_d > T(0) ? T(1) / total_d : T(0)));
    store3(indirect_s + 3 * p, sent_s * (total_s > T(0) ? T(1) / total_s : T(0)));
  }

 private:
  SPLITNERF_HD static Vec3<T> ratio(Vec3<T> above, Vec3<T> below) {
    Vec3<T> o;
    for (int c = 0; c < 3; ++c) o[c] = below[c] > T(0) ? min_of(above[c] / below[c], T(1)) : T(1);
    return o;
  }
  // One result for both factors.
  template <class Group> SPLITNERF_HD void keep(const Group& group, int64_t p, Vec3<T> occlusion, T indirect) const {
    if (group.lane() > 0) return;
    store3(occlusion_d + 3 * p, occlusion), store3(occlusion_s + 3 * p, occlusion);
    if (!cache.hits) return;
    const Vec3<T> sent{indirect, indirect, indirect};
    store3(indirect_d + 3 * p, sent), store3(indirect_s + 3 * p, sent);
  }
};
SPLITNERF_ON_GPU(CachedOcclusionBody);

// visible [n, n_directions] and, with hits, arriving [n, n_directions, 3].
template <class T> struct CachedVisibilityBody {
  VisibilityCache<T> cache;
  const T *positions, *normals;
  T *visible, *arriving;

  template <class Group> SPLITNERF_HD void operator()(const Group& group, int64_t p) const {
    const Vec3<T> position = load3(positions + 3 * p), normal = load3(normals + 3 * p);
    const T check = sum(position) + sum(normal);
    const bool finite = is_finite(check);
    Neighbours<T> near;
    bool open = true;
    if (finite) near = find_neighbours(cache.grids, position, normal), open = sees_all(group, cache, near, normal);
    for (int64_t i = group.lane(); i < cache.n_directions; i += Group::size) {
      const int64_t at = p * cache.n_directions + i;
      const DirectionShares<T> shares = open ? DirectionShares<T>{T(0), T(0), 0} : direction_shares(cache, near, i);
      visible[at] = finite ? shares.visible() : check - check;
      if (!cache.hits) continue;
      const bool above = dot(normal, load3(cache.directions + 3 * i)) > T(0);
      Vec3<T> sent{T(0), T(0), T(0)};
      if (above && shares.blocked) sent = sent_by_mesh(cache, near, shares, i);
      if (!finite) sent = {check - check, check - check, check - check};
      store3(arriving + 3 * at, sent);
    }
  }
};
SPLITNERF_ON_GPU(CachedVisibilityBody);

}  // namespace splitnerf
