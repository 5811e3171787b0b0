#include "splitnerf/visibility_cache.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "planes.h"
#include "splitnerf/kernels.h"
#include "splitnerf/occlusion.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"

namespace splitnerf::cpu {
namespace {

constexpr int64_t kVertexGrain = 32, kPointGrain = 64;

int32_t heaviest_vertex(const int32_t* triangle, const Hit& hit) {
  const float w = 1.f - hit.u - hit.v;
  return triangle[w >= hit.u && w >= hit.v ? 0 : hit.u >= hit.v ? 1 : 2];
}

template <class T> Vec3<T> ratio(const T* above, const T* below) {
  Vec3<T> o;
  for (int c = 0; c < 3; ++c) o[c] = below[c] > T(0) ? min_of(above[c] / below[c], T(1)) : T(1);
  return o;
}

}  // namespace

void visibility_bits(const Scene& scene, int64_t n, const float* positions, const float* normals, int64_t n_directions,
                     const float* directions, float offset, uint32_t* bits, int32_t* hits) {
  const int64_t n_words = n_directions / kBitsPerWord;
  parallel_for(n, kVertexGrain, [&](int64_t begin, int64_t end) {
    std::vector<float> origins(3 * n_directions), rays(3 * n_directions);
    std::vector<int64_t> above(n_directions);  // the directions above the horizon
    std::vector<uint8_t> open(n_directions);
    std::vector<Hit> found(hits ? n_directions : 0);
    for (int64_t v = begin; v < end; ++v) {
      const Vec3<float> normal = load3(normals + 3 * v), origin = load3(positions + 3 * v) + normal * offset;
      int64_t n_rays = 0;
      for (int64_t i = 0; i < n_directions; ++i) {
        const Vec3<float> w = load3(directions + 3 * i);
        if (!(dot(w, normal) > 0.f)) continue;
        store3(&origins[3 * n_rays], origin);
        store3(&rays[3 * n_rays], w);
        above[n_rays++] = i;
      }
      uint32_t *open_words = bits + 2 * v * n_words, *blocked_words = open_words + n_words;
      std::fill(open_words, open_words + 2 * n_words, 0u);
      if (hits) {
        std::fill(hits + v * n_directions, hits + (v + 1) * n_directions, -1);
        scene.trace_closest(origins.data(), rays.data(), n_rays, INFINITY, found.data());
        for (int64_t k = 0; k < n_rays; ++k) {
          open[k] = found[k].t < 0.f;
          if (open[k]) continue;
          const int32_t* triangle = scene.triangles() + 3 * int64_t(found[k].triangle);
          hits[v * n_directions + above[k]] = heaviest_vertex(triangle, found[k]);
        }
      } else {
        scene.trace_visibility(origins.data(), rays.data(), n_rays, INFINITY, open.data());
      }
      for (int64_t k = 0; k < n_rays; ++k) {
        (open[k] ? open_words : blocked_words)[above[k] / kBitsPerWord] |= 1u << above[k] % kBitsPerWord;
      }
    }
  });
}

template <class T>
void build_vertex_grids(int64_t n_vertices, const T* vertices, T radius, int n_levels, int64_t n_buckets,
                        int32_t* starts, int32_t* order) {
  std::vector<int32_t> bucket(n_vertices);
  T inverse_size = T(0.5) / radius;
  for (int level = 0; level < n_levels; ++level, inverse_size *= T(0.5)) {
    int32_t* first = starts + level * (n_buckets + 1);
    std::fill(first, first + n_buckets + 1, 0);
    for (int64_t v = 0; v < n_vertices; ++v) {
      bucket[v] = static_cast<int32_t>(grid_cell(load3(vertices + 3 * v), inverse_size).bucket(n_buckets));
      ++first[bucket[v] + 1];
    }
    for (int64_t b = 0; b < n_buckets; ++b) first[b + 1] += first[b];
    std::vector<int32_t> next(first, first + n_buckets);
    for (int64_t v = 0; v < n_vertices; ++v) order[level * n_vertices + next[bucket[v]]++] = static_cast<int32_t>(v);
  }
}

namespace {

// Reads the cache for one point after the other; holds what a point needs while it is worked on.
template <class T> class CacheReader {
 public:
  CacheReader(const VisibilityCache<T>& cache, const LobeSide<T>& directions)
      : cache_(cache), directions_(directions), n_words_(cache.n_directions / kBitsPerWord), above_(n_words_),
        cosine_(cache.n_directions), known_(cache.n_directions), visible_(cache.n_directions),
        lobe_(cache.n_directions) {}

  struct Result {
    Vec3<T> occlusion_d{T(1), T(1), T(1)}, occlusion_s{T(1), T(1), T(1)};
    Vec3<T> indirect_d{T(0), T(0), T(0)}, indirect_s{T(0), T(0), T(0)};
  };

  Result read(Vec3<T> position, Vec3<T> normal, Vec3<T> lobe_dir, T roughness) {
    Result result;
    const T check = sum(position) + sum(normal) + sum(lobe_dir) + roughness;
    if (!std::isfinite(check)) {
      const T nan = std::numeric_limits<T>::quiet_NaN();
      result.occlusion_d = result.occlusion_s = result.indirect_d = result.indirect_s = {nan, nan, nan};
      return result;
    }
    const Neighbours<T> near = find_neighbours(cache_.grids, position, normal);
    if (!look(near, normal)) return result;

    const T alpha = cached_lobe_alpha(roughness, static_cast<int>(cache_.n_directions));
    T sums[14];
    kernels<T>().visibility_sums(directions_, {cosine_.data(), &lobe_dir.x, alpha * alpha}, visible_.data(),
                                 lobe_.data(), sums);
    result.occlusion_d = ratio(sums, sums + 3);
    result.occlusion_s = ratio(sums + 7, sums + 10);
    if (cache_.hits) add_indirect(near, sums[6], sums[13], result);
    return result;
  }

  // V_i [n_directions] and, with hits, (1 - V_i) C_i [n_directions, 3].
  void read_directions(Vec3<T> position, Vec3<T> normal, T* visible, T* arriving) {
    const bool finite = std::isfinite(sum(position) + sum(normal));
    const T nan = std::numeric_limits<T>::quiet_NaN();
    std::fill(visible, visible + cache_.n_directions, finite ? T(1) : nan);
    if (cache_.hits) std::fill(arriving, arriving + 3 * cache_.n_directions, finite ? T(0) : nan);
    if (!finite) return;
    const Neighbours<T> near = find_neighbours(cache_.grids, position, normal);
    if (!look(near, normal)) return;
    std::copy(visible_.begin(), visible_.end(), visible);
    if (!cache_.hits) return;
    for_each_blocked(near, [&](int64_t i, T share, Vec3<T> sent) {
      store3(arriving + 3 * i, load3(arriving + 3 * i) + sent * share);
    });
  }

 private:
  const uint32_t* words(int32_t vertex) const { return cache_.bits + 2 * int64_t(vertex) * n_words_; }
  const uint32_t* blocked_words(int32_t vertex) const { return words(vertex) + n_words_; }

  // Whether no neighbour has a blocked direction above the point's horizon; so without neighbours.
  bool all_open(const Neighbours<T>& near) const {
    uint32_t blocked = 0;
    for (int k = 0; k < near.n; ++k) {
      for (int64_t word = 0; word < n_words_; ++word) blocked |= blocked_words(near.vertex[k])[word] & above_[word];
    }
    return blocked == 0;
  }

  // Takes the shares of the neighbours together; false where they block nothing.
  bool look(const Neighbours<T>& near, Vec3<T> normal) {
    kernels<T>().visibility_horizon(directions_, &normal.x, cosine_.data(), above_.data());
    if (all_open(near)) return false;
    const uint32_t* bits[kMaxNeighbours];
    for (int k = 0; k < near.n; ++k) bits[k] = words(near.vertex[k]);
    kernels<T>().visibility_shares(cache_.n_directions, {bits, near.weight, near.n}, known_.data(), visible_.data());
    return true;
  }

  // visit(direction, a neighbour's share of those that know it, what the mesh sends from there). Few directions above
  // the horizon are blocked: they are taken one by one.
  template <class Visit> void for_each_blocked(const Neighbours<T>& near, Visit&& visit) const {
    for (int k = 0; k < near.n; ++k) {
      const int32_t* hits = cache_.hits + int64_t(near.vertex[k]) * cache_.n_directions;
      for (int64_t word = 0; word < n_words_; ++word) {
        for (uint32_t blocked = blocked_words(near.vertex[k])[word] & above_[word]; blocked; blocked &= blocked - 1) {
          const int64_t i = word * kBitsPerWord + lowest_bit(blocked);
          if (hits[i] < 0 || hits[i] >= cache_.n_radiance) continue;
          visit(i, near.weight[k] / known_[i], load3(cache_.radiance + 3 * int64_t(hits[i])));
        }
      }
    }
  }

  // sum (1 - V_i) C_i c_i / sum c_i over both kernels.
  void add_indirect(const Neighbours<T>& near, T total_d, T total_s, Result& result) const {
    const T per_d = total_d > T(0) ? T(1) / total_d : T(0), per_s = total_s > T(0) ? T(1) / total_s : T(0);
    for_each_blocked(near, [&](int64_t i, T share, Vec3<T> sent) {
      result.indirect_d += sent * (cosine_[i] * share);
      result.indirect_s += sent * (lobe_[i] * share);
    });
    result.indirect_d = result.indirect_d * per_d;
    result.indirect_s = result.indirect_s * per_s;
  }

  const VisibilityCache<T>& cache_;
  const LobeSide<T>& directions_;
  const int64_t n_words_;
  std::vector<uint32_t> above_;
  std::vector<T> cosine_, known_, visible_, lobe_;
};

}  // namespace

template <class T> void run(int64_t n, const CachedOcclusionBody<T>& b) {
  const VisibilityCache<T>& cache = b.cache;
  const Planes<T> direction(cache.directions, cache.n_directions);
  Planes<T> light(cache.light, cache.n_directions);
  for (auto* plane : {&light.x, &light.y, &light.z}) {
    for (T& value : *plane) value += T(kBlackLight);
  }
  const LobeSide<T> directions{direction.x.data(), direction.y.data(), direction.z.data(), nullptr,
                               light.x.data(),     light.y.data(),     light.z.data(),     cache.n_directions};
  parallel_for(n, kPointGrain, [&](int64_t begin, int64_t end) {
    CacheReader<T> reader(cache, directions);
    for (int64_t i = begin; i < end; ++i) {
      const auto result =
          reader.read(load3(b.positions + 3 * i), load3(b.normals + 3 * i), load3(b.lobe_dirs + 3 * i), b.roughness[i]);
      store3(b.occlusion_d + 3 * i, result.occlusion_d);
      store3(b.occlusion_s + 3 * i, result.occlusion_s);
      if (!cache.hits) continue;
      store3(b.indirect_d + 3 * i, result.indirect_d);
      store3(b.indirect_s + 3 * i, result.indirect_s);
    }
  });
}
template void run<float>(int64_t, const CachedOcclusionBody<float>&);
template void run<double>(int64_t, const CachedOcclusionBody<double>&);

template <class T> void run(int64_t n, const CachedVisibilityBody<T>& b) {
  const VisibilityCache<T>& cache = b.cache;
  const Planes<T> direction(cache.directions, cache.n_directions);
  const LobeSide<T> directions{
      direction.x.data(), direction.y.data(), direction.z.data(), nullptr, nullptr, nullptr, nullptr,
      cache.n_directions};
  const int64_t k = cache.n_directions;
  parallel_for(n, kPointGrain, [&](int64_t begin, int64_t end) {
    CacheReader<T> reader(cache, directions);
    for (int64_t i = begin; i < end; ++i) {
      reader.read_directions(load3(b.positions + 3 * i), load3(b.normals + 3 * i), b.visible + k * i,
                             cache.hits ? b.arriving + 3 * k * i : nullptr);
    }
  });
}
template void run<float>(int64_t, const CachedVisibilityBody<float>&);
template void run<double>(int64_t, const CachedVisibilityBody<double>&);

template void build_vertex_grids<float>(int64_t, const float*, float, int, int64_t, int32_t*, int32_t*);
template void build_vertex_grids<double>(int64_t, const double*, double, int, int64_t, int32_t*, int32_t*);

}  // namespace splitnerf::cpu
