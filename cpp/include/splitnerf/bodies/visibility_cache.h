// Lookups in the visibility cache, a group of threads per point: one of 32 threads, as many as a word of the bits has. They look
// for the point's neighbours together, each at another vertex, and hold them together; then each takes a direction of a word.
//
// Counted for 9,000 points with 8 neighbours of 256 directions on an H100: 400 instructions of a warp for the search, 160 to see
// whether anything is blocked, 1,700 for the sums (1,300 for the visibility alone): 21 million, 23 us if each scheduler issues one
// a cycle. The bits are 64 bytes a neighbour, 5 MB. The search waits for memory four times, 2 us of a warp's 4. It never ran on a
// GPU; when each thread searched alone, the two took 1,020 and 430 us.
#pragma once

#include "splitnerf/group.h"
#include "splitnerf/occlusion.h"
#include "splitnerf/prefilter.h"
#include "splitnerf/visibility_cache.h"

namespace splitnerf {

// The neighbours of a point as its group holds them: thread k, and thread k + kMaxNeighbours, have number k % kMaxNeighbours.
template <class T> struct HeldNeighbours {
  int n = 0;
  int32_t vertex = 0;
  T weight = T(0);  // 0 where there is no such neighbour

  // Neighbours::add, by all threads with the same vertex.
  template <class Group> SPLITNERF_HD void add(const Group& group, int32_t v, T w) {
    int at = n;
    if (n == kMaxNeighbours) {
      const T lightest = group.least(weight);
      if (w <= lightest) return;
      at = lowest_bit(group.ballot(weight == lightest));
    } else {
      ++n;
    }
    if (group.lane() % kMaxNeighbours == at) vertex = v, weight = w;
  }
};

// The neighbours in one level, with their weights: the vertices of the eight cells' buckets one after the other, a vertex a
// thread.
template <class T, class Group>
SPLITNERF_HD HeldNeighbours<T> neighbours_in_level(const Group& group, const GridLevel<T>& level) {
  const int64_t bucket = level.cell(group.lane() % 8).bucket(level.grids.n_buckets);
  const int32_t begin = level.starts[bucket], size = level.starts[bucket + 1] - begin;
  const int32_t before = group.sum_before(group.lane() < 8 ? size : 0), total = group.template sum_of_run<8>(size);
  HeldNeighbours<T> found;
  for (int32_t first = 0; first < total; first += Group::size) {
    const int32_t number = first + group.lane();
    int corner = 0;
    for (int k = 1; k < 8; ++k) corner = number >= group.from(k, before) ? k : corner;
    const int32_t j = group.from(corner, begin) + number - group.from(corner, before);
    const int32_t vertex = number < total ? level.order[j] : 0;
    const T weight = number < total ? level.weight(vertex, level.cell(corner)) : T(0);
    for (uint32_t left = group.ballot(weight > T(0)); left; left &= left - 1) {
      const int thread = lowest_bit(left);
      found.add(group, group.from(thread, vertex), group.from(thread, weight));
    }
  }
  return found;
}

// find_neighbours by a group.
template <class T, class Group>
SPLITNERF_HD HeldNeighbours<T> find_neighbours(const Group& group, const VertexGrids<T>& grids, Vec3<T> position,
                                               Vec3<T> normal) {
  static_assert(Group::size == kBitsPerWord && Group::size == 2 * kMaxNeighbours);
  T reach = grids.radius;
  for (int level = 0; level < grids.n_levels; ++level, reach = reach * T(2)) {
    HeldNeighbours<T> found = neighbours_in_level(group, GridLevel<T>(grids, level, reach, position, normal));
    if (found.n == 0) continue;
    found.weight = found.weight / group.template sum_of_run<kMaxNeighbours>(found.weight);
    return found;
  }
  return {};
}

// Whether no neighbour has a blocked direction above the point's horizon; true without neighbours.
template <class T, class Group>
SPLITNERF_HD bool sees_all(const Group& group, const VisibilityCache<T>& cache, const HeldNeighbours<T>& near,
                           Vec3<T> normal) {
  const int64_t n_words = cache.n_directions / kBitsPerWord;
  const uint32_t* blocked = cache.bits + (2 * int64_t(near.vertex) + 1) * n_words;
  bool any = false;
  for (int64_t word = 0; word < n_words; ++word) {
    const Vec3<T> direction = load3(cache.directions + 3 * (word * kBitsPerWord + group.lane()));
    const uint32_t above = group.ballot(dot(normal, direction) > T(0));
    if (near.weight > T(0)) any = any || (blocked[word] & above) != 0;
  }
  return group.ballot(any) == 0;
}

// What the neighbours of a point know of one direction.
template <class T> struct DirectionShares {
  T known = T(0), open = T(0);     // sums of the neighbours' weights
  Vec3<T> sent{T(0), T(0), T(0)};  // what the mesh sends from there, weighted alike

  SPLITNERF_HD T visible() const { return known > T(0) ? open / known : T(1); }
  SPLITNERF_HD Vec3<T> arriving() const { return known > T(0) ? sent * (T(1) / known) : sent; }
};
// Of the direction of a word that a thread has; `sends`: whether it wants to know what the mesh sends. The first half of the
// threads loads the neighbours' words of open directions, the second half those of blocked ones.
template <class T, class Group>
SPLITNERF_HD DirectionShares<T> direction_shares(const Group& group, const VisibilityCache<T>& cache,
                                                 const HeldNeighbours<T>& near, int64_t word, bool sends) {
  const int64_t n_words = cache.n_directions / kBitsPerWord, i = word * kBitsPerWord + group.lane();
  const int64_t row = 2 * int64_t(near.vertex) + group.lane() / kMaxNeighbours;
  const uint32_t mine = near.weight > T(0) ? cache.bits[row * n_words + word] : 0;
  DirectionShares<T> shares;
  for (int k = 0; k < near.n; ++k) {
    const bool open = group.from(k, mine) >> group.lane() & 1u,
               blocked = group.from(k + kMaxNeighbours, mine) >> group.lane() & 1u;
    const T weight = group.from(k, near.weight);
    const int32_t vertex = group.from(k, near.vertex);
    if (open) shares.open += weight;
    if (open || blocked) shares.known += weight;
    if (!blocked || !sends) continue;
    const int32_t hit = cache.hits[int64_t(vertex) * cache.n_directions + i];
    if (hit >= 0 && hit < cache.n_radiance) shares.sent += load3(cache.radiance + 3 * int64_t(hit)) * weight;
  }
  return shares;
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
    const HeldNeighbours<T> near = find_neighbours(group, cache.grids, position, normal);
    if (sees_all(group, cache, near, normal)) return keep(group, p, {T(1), T(1), T(1)}, T(0));

    const T alpha_squared = square(cached_lobe_alpha(roughness[p], static_cast<int>(cache.n_directions)));
    const Vec3<T> none{T(0), T(0), T(0)};
    Vec3<T> open_d = none, all_d = none, open_s = none, all_s = none, sent_d = none, sent_s = none;
    T total_d = T(0), total_s = T(0);
    for (int64_t word = 0; word < cache.n_directions / kBitsPerWord; ++word) {
      const int64_t i = word * kBitsPerWord + group.lane();
      const Vec3<T> w = load3(cache.directions + 3 * i), delta = lobe - w;
      const T d = max_of(dot(normal, w), T(0));
      const T s = d > T(0) ? prefilter_weight(delta.x, delta.y, delta.z, alpha_squared) : T(0);
      const Vec3<T> light = load3(cache.light + 3 * i) + Vec3<T>{T(kBlackLight), T(kBlackLight), T(kBlackLight)};
      const DirectionShares<T> shares = direction_shares(group, cache, near, word, cache.hits && d > T(0));
      const T visible = shares.visible();
      all_d += light * d, total_d += d, open_d += light * (visible * d);
      all_s += light * s, total_s += s, open_s += light * (visible * s);
      sent_d += shares.arriving() * d, sent_s += shares.arriving() * s;
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
    HeldNeighbours<T> near;
    bool open = true;
    if (finite)
      near = find_neighbours(group, cache.grids, position, normal), open = sees_all(group, cache, near, normal);
    for (int64_t word = 0; word < cache.n_directions / kBitsPerWord; ++word) {
      const int64_t i = word * kBitsPerWord + group.lane(), at = p * cache.n_directions + i;
      const bool above = dot(normal, load3(cache.directions + 3 * i)) > T(0);
      DirectionShares<T> shares;
      if (!open) shares = direction_shares(group, cache, near, word, cache.hits && above);
      visible[at] = finite ? shares.visible() : check - check;
      if (!cache.hits) continue;
      store3(arriving + 3 * at, finite ? shares.arriving() : Vec3<T>{check - check, check - check, check - check});
    }
  }
};
SPLITNERF_ON_GPU(CachedVisibilityBody);

}  // namespace splitnerf
