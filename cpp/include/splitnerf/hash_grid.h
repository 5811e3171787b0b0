// Multiresolution hash grid: geometry of the levels, index functions, and one point's encoding.
// Source: Mueller et al. 2022, section 3; progressive levels: Li et al. 2023 (Neuralangelo).
#pragma once

#include <cstddef>
#include <string>
#include <type_traits>

#include "splitnerf/half.h"
#include "splitnerf/vec.h"

namespace splitnerf {

inline constexpr int kMaxLevels = 32;

struct HashGridShape {
  int n_levels;
  int n_features;       // per level: 1, 2, 4 or 8
  int base_resolution;  // cells along an edge of the coarsest level
  double growth;        // factor between the resolutions of neighbouring levels
  int log2_table_size;  // entries of a level at most: 2^log2_table_size
};

struct HashLevel {
  int64_t offset;  // first entry of the level in the table
  int64_t n_entries;
  int resolution;  // cells along an edge; resolution + 1 nodes
  bool dense;      // every node has an entry of its own
};

// The table as it is stored: in the numbers that are computed with, or, for float, in 16 bits each.
class HashTable {
 public:
  HashTable(std::nullptr_t = nullptr) {}
  HashTable(const float* entries) : entries_(entries) {}
  HashTable(const double* entries) : entries_(entries) {}
  HashTable(const Half* entries) : entries_(entries), half_(true) {}

  // Calls body(entries) with the pointer that the table was made from; T is what is computed with.
  template <class T, class Body> void read_as(Body&& body) const {
    if constexpr (std::is_same_v<T, float>)
      if (half_) return body(static_cast<const Half*>(entries_));
    body(static_cast<const T*>(entries_));
  }

 private:
  const void* entries_ = nullptr;  // [n_entries, n_features]
  bool half_ = false;
};

// What is wrong with a shape, in words; empty for one that can be built.
inline std::string hash_shape_error(int64_t n_levels, int64_t n_features, int64_t base_resolution, double growth,
                                    int64_t log2_table_size) {
  const auto wrong = [](const char* rule, auto got) { return rule + (", got " + std::to_string(got)); };
  if (n_levels < 1 || n_levels > kMaxLevels) return wrong("n_levels must be in [1, 32]", n_levels);
  if (n_features != 1 && n_features != 2 && n_features != 4 && n_features != 8)
    return wrong("n_features must be 1, 2, 4 or 8", n_features);
  if (base_resolution < 1) return wrong("base_resolution must be at least 1", base_resolution);
  if (!(growth >= 1.0)) return wrong("growth must be at least 1", growth);
  if (log2_table_size < 1 || log2_table_size > 30) return wrong("log2_table_size must be in [1, 30]", log2_table_size);
  const double finest = static_cast<double>(base_resolution) * std::pow(growth, static_cast<double>(n_levels - 1));
  if (!(finest < double(1 << 30)))
    return wrong("the finest level must have less than 2^30 cells along an edge", finest);
  return "";
}

// Level l has floor(base growth^l + 1e-6) cells along an edge; the small term keeps exact powers.
SPLITNERF_HD int level_resolution(const HashGridShape& shape, int level) {
  return static_cast<int>(std::floor(shape.base_resolution * std::pow(shape.growth, level) + 1e-6));
}

// Fills levels[0 .. n_levels) and returns the number of entries of the whole table.
inline int64_t hash_levels(const HashGridShape& shape, HashLevel* levels) {
  int64_t offset = 0;
  for (int l = 0; l < shape.n_levels; ++l) {
    const int resolution = level_resolution(shape, l);
    const int64_t nodes = static_cast<int64_t>(resolution) + 1, capacity = int64_t{1} << shape.log2_table_size;
    // nodes^3 may exceed 2^63 only for resolutions past 2 million; compare without multiplying.
    const bool dense = nodes <= capacity && nodes * nodes <= capacity && nodes * nodes * nodes <= capacity;
    levels[l] = {offset, dense ? nodes * nodes * nodes : capacity, resolution, dense};
    offset += levels[l].n_entries;
  }
  return offset;
}

// Source: Teschner et al. 2003 (the primes as instant-ngp uses them). n_entries is a power of two.
SPLITNERF_HD uint32_t spatial_hash(uint32_t x, uint32_t y, uint32_t z, uint32_t n_entries) {
  return (x ^ y * 2654435761u ^ z * 805459861u) & (n_entries - 1u);
}

// One axis of the cell that holds a coordinate of the unit cube; one outside is clamped to it.
template <class T> struct CellAxis {
  uint32_t node;
  T f;      // position inside the cell, in [0, 1]; NaN for a NaN, with a node that exists
  T scale;  // d f / d coordinate: the resolution, or 0 where the coordinate was clamped
};
template <class T> SPLITNERF_HD CellAxis<T> cell_axis(int resolution, T coordinate) {
  const T raised = coordinate < T(0) ? T(0) : coordinate, x = (raised > T(1) ? T(1) : raised) * T(resolution);
  const auto floor = static_cast<int32_t>(x >= T(0) ? x : T(0));
  const int32_t node = floor < resolution ? floor : resolution - 1;
  return {static_cast<uint32_t>(node), x - T(node), coordinate >= T(0) && coordinate <= T(1) ? T(resolution) : T(0)};
}

// The entry of a node, counted within its level. A dense level has at most 2^30 of them.
template <bool Dense>
SPLITNERF_HD uint32_t node_entry(uint32_t x, uint32_t y, uint32_t z, uint32_t resolution, uint32_t n_entries) {
  if constexpr (Dense) {
    return (x * (resolution + 1) + y) * (resolution + 1) + z;
  } else {
    return spatial_hash(x, y, z, n_entries);
  }
}

// The cell of a level that holds a point of the unit cube, and the eight corners' entries.
template <class T> struct HashCell {
  int64_t index[8];  // entry of corner (i & 1, i >> 1 & 1, i >> 2), counted in the whole table
  Vec3<T> f;         // position inside the cell, in [0, 1]
  Vec3<T> scale;     // d f / d position: the resolution, or 0 where the position was clamped
};

template <class T> SPLITNERF_HD HashCell<T> hash_cell(const HashLevel& level, Vec3<T> position) {
  HashCell<T> cell;
  uint32_t node[3];
  for (int axis = 0; axis < 3; ++axis) {
    const CellAxis<T> along = cell_axis(level.resolution, position[axis]);
    node[axis] = along.node, cell.f[axis] = along.f, cell.scale[axis] = along.scale;
  }
  const auto resolution = static_cast<uint32_t>(level.resolution), n_entries = static_cast<uint32_t>(level.n_entries);
  for (int i = 0; i < 8; ++i) {
    const uint32_t x = node[0] + (i & 1), y = node[1] + (i >> 1 & 1), z = node[2] + (i >> 2);
    cell.index[i] = level.offset + (level.dense ? node_entry<true>(x, y, z, resolution, n_entries)
                                                : node_entry<false>(x, y, z, resolution, n_entries));
  }
  return cell;
}

// A value between the eight corners of a cell, c[i] at corner (i & 1, i >> 1 & 1, i >> 2), and its derivatives in the
// position (x, y, z) inside the cell. Written out, so that loops over points become vector code.
template <class T> struct Trilinear {
  T value, dx, dy, dz;
};
template <class T> SPLITNERF_HD T blend(T a, T b, T t) { return a * (T(1) - t) + b * t; }
template <class T> SPLITNERF_HD Trilinear<T> trilinear(T c0, T c1, T c2, T c3, T c4, T c5, T c6, T c7, T x, T y, T z) {
  const T a0 = blend(c0, c4, z), a1 = blend(c1, c5, z), a2 = blend(c2, c6, z), a3 = blend(c3, c7, z);
  const T b0 = blend(a0, a2, y), b1 = blend(a1, a3, y);
  const T z0 = blend(c4 - c0, c6 - c2, y), z1 = blend(c5 - c1, c7 - c3, y);
  return {blend(b0, b1, x), b1 - b0, blend(a2 - a0, a3 - a1, x), blend(z0, z1, x)};
}

// Gradient to corner (I & 1, I >> 1 & 1, I >> 2).
template <int I, class T> SPLITNERF_HD T trilinear_backward(const Trilinear<T>& grad, T x, T y, T z) {
  const T wx = I & 1 ? x : T(1) - x, wy = I & 2 ? y : T(1) - y, wz = I & 4 ? z : T(1) - z;
  const T along_x = I & 1 ? grad.dx : -grad.dx, along_y = I & 2 ? grad.dy : -grad.dy,
          along_z = I & 4 ? grad.dz : -grad.dz;
  return wz * (wy * (wx * grad.value + along_x) + wx * along_y) + wy * (wx * along_z);
}

}  // namespace splitnerf
