// Visibility bits cached on the vertices of a mesh: which vertices answer for a point, and how widely its lobe reads
// the fixed set of directions. The sums over the directions stand in kernels/visibility.cpp.
#pragma once

#include "splitnerf/ggx.h"
#include "splitnerf/group.h"
#include "splitnerf/sampling.h"
#include "splitnerf/vec.h"

namespace splitnerf {

inline constexpr int kBitsPerWord = 32;
inline constexpr int kMaxNeighbours = 16;
inline constexpr double kLobeDirections = 2;

// The lobe's width, never so narrow that fewer than about kLobeDirections of the n directions count: the lattice's
// effective number of directions in a lobe is 3 n a^2 for small a. The floor depends on n alone, so the factor stays
// smooth as the lobe turns.
template <class T> SPLITNERF_HD T cached_lobe_alpha(T roughness, int n_directions) {
  return max_of(ggx_alpha_from_roughness(roughness), std::sqrt(T(kLobeDirections / 3) / T(n_directions)));
}

// ---- which vertices answer for a point -------------------------------------------------------

// Hash grids over the vertices of a mesh. Level l reaches radius * 2^l far and has cells twice as large, so that the
// ball around a point touches 2 x 2 x 2 of them. The vertices of bucket b are order[starts[b] ... starts[b + 1] - 1].
template <class T> struct VertexGrids {
  const T *vertices, *normals;    // [n_vertices, 3]
  const int32_t* starts;          // [n_levels, n_buckets + 1]
  const int32_t* order;           // [n_levels, n_vertices]
  int64_t n_vertices, n_buckets;  // n_buckets is a power of two
  int n_levels;
  T radius;
};

struct GridCell {
  int32_t x, y, z;

  SPLITNERF_HD bool operator==(GridCell b) const { return x == b.x && y == b.y && z == b.z; }
  SPLITNERF_HD int64_t bucket(int64_t n_buckets) const {
    return hash_u32(uint32_t(x), uint32_t(y), uint32_t(z)) & uint32_t(n_buckets - 1);
  }
};

// Coordinates are kept within what 32 bits hold; so far out all share the last cell.
template <class T> SPLITNERF_HD GridCell grid_cell(Vec3<T> x, T inverse_size, T shift = T(0)) {
  const auto index = [&](T t) {
    return static_cast<int32_t>(std::floor(clamp(t * inverse_size + shift, T(-1e9), T(1e9))));
  };
  return {index(x.x), index(x.y), index(x.z)};
}

// The vertices that answer for a point and their shares, which sum to 1; none: nothing is near.
template <class T> struct Neighbours {
  int n = 0;
  int32_t vertex[kMaxNeighbours];
  T weight[kMaxNeighbours];

  // Keeps the heaviest kMaxNeighbours.
  SPLITNERF_HD void add(int32_t v, T w) {
    int at = n;
    if (n == kMaxNeighbours) {
      at = 0;
      for (int k = 1; k < n; ++k) at = weight[k] < weight[at] ? k : at;
      if (w <= weight[at]) return;
    } else {
      ++n;
    }
    vertex[at] = v;
    weight[at] = w;
  }
};

// Share of a vertex at distance r < reach whose normal makes the cosine c with the point's: distance by the weight of
// Franke and Little (1980), ((reach - r) / (reach r))^2 up to a factor, which interpolates and has compact support, with
// a small constant in place of its pole; normals by c^4, so that the other side of a thin plate never answers.
template <class T> SPLITNERF_HD T neighbour_weight(T relative_distance, T cosine) {
  if (relative_distance >= T(1) || !(cosine > T(0))) return T(0);
  return square((T(1) - relative_distance) / (relative_distance + T(0.05))) * square(square(cosine));
}

// One level of the grids around a point: the eight cells that the ball around it touches.
template <class T> struct GridLevel {
  const VertexGrids<T>& grids;
  const int32_t *starts, *order;
  Vec3<T> position, normal;
  T reach, inverse_size;
  GridCell first;

  SPLITNERF_HD GridLevel(const VertexGrids<T>& grids, int level, T reach, Vec3<T> position, Vec3<T> normal)
      : grids(grids), starts(grids.starts + level * (grids.n_buckets + 1)),
        order(grids.order + level * grids.n_vertices), position(position), normal(normal), reach(reach),
        inverse_size(T(0.5) / reach), first(grid_cell(position, inverse_size, T(-0.5))) {}
  SPLITNERF_HD GridCell cell(int corner) const {
    return {first.x + (corner & 1), first.y + (corner >> 1 & 1), first.z + (corner >> 2)};
  }
  // The weight of a vertex as a neighbour; 0 where it is none, or stands in another cell.
  SPLITNERF_HD T weight(int32_t v, GridCell cell) const {
    const Vec3<T> vertex = load3(grids.vertices + 3 * int64_t(v));
    const T squared = dot(vertex - position, vertex - position);
    if (!(squared < reach * reach) || !(grid_cell(vertex, inverse_size) == cell)) return T(0);
    const T w = neighbour_weight(std::sqrt(squared) / reach, dot(normal, load3(grids.normals + 3 * int64_t(v))));
    return w > T(1e-6) ? w : T(0);
  }
};

// Vertices within the radius; where none answers, within twice, four times ... the radius.
template <class T>
SPLITNERF_HD Neighbours<T> find_neighbours(const VertexGrids<T>& grids, Vec3<T> position, Vec3<T> normal) {
  T reach = grids.radius;
  for (int level = 0; level < grids.n_levels; ++level, reach = reach * T(2)) {
    Neighbours<T> found;
    const GridLevel<T> around(grids, level, reach, position, normal);
    for (int corner = 0; corner < 8; ++corner) {
      const GridCell cell = around.cell(corner);
      const int64_t bucket = cell.bucket(grids.n_buckets);
      for (int32_t j = around.starts[bucket]; j < around.starts[bucket + 1]; ++j) {
        const T weight = around.weight(around.order[j], cell);
        if (weight > T(0)) found.add(around.order[j], weight);
      }
    }
    if (found.n == 0) continue;
    T total = T(0);
    for (int k = 0; k < found.n; ++k) total += found.weight[k];
    for (int k = 0; k < found.n; ++k) found.weight[k] = found.weight[k] / total;
    return found;
  }
  return {};
}

// What the vertices of a mesh know of the directions around them.
template <class T> struct VisibilityCache {
  VertexGrids<T> grids;
  const uint32_t* bits;  // [n_vertices, 2, n_directions / 32], see visibility_bits
  const int32_t* hits;   // [n_vertices, n_directions] rows of radiance, below 0: none; or null: no indirect light
  const T* radiance;     // [n_radiance, 3] that the mesh sends out, with hits
  int64_t n_radiance, n_directions;
  const T *directions, *light;  // [n_directions, 3]; the light's mean over each direction's cell
};

}  // namespace splitnerf
