// Marching cubes on sparse blocks of nodes. The table of cases is derived when the program starts.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "splitnerf/config.h"

namespace splitnerf {

// A cube's corner c has its coordinates in the bits of c (x = 1, y = 2, z = 4). Edge 4 a + k runs along axis a from
// the k-th corner whose bit a is 0, in rising order.
struct CubeEdge {
  int axis, from, to;  // corners, to = from + (1 << axis)
};
SPLITNERF_API const std::array<CubeEdge, 12>& cube_edges();

// The triangles of one case, three edges each, counter-clockwise seen from outside.
struct CubeCase {
  int n_triangles = 0;
  std::array<uint8_t, 30> edges{};
};

// All cases, by the mask of the corners that are inside. On each face of the cube every run of inside corners is cut
// off by a segment of its own, so that two cubes see their common face alike; the segments link to loops, and a
// loop's triangulation has no diagonal in a face, so that meshes of any field are closed and manifold.
SPLITNERF_API const std::array<CubeCase, 256>& cube_cases();

constexpr int kMeshBlock = 4;  // nodes along a block's edge
constexpr int kMeshBlockNodes = kMeshBlock * kMeshBlock * kMeshBlock;

// A cube of n_blocks^3 blocks of nodes. index [n_blocks]^3, x slowest: the row of the block's nodes in `values`
// [n, 4, 4, 4], or kOutsideBlock or kInsideBlock where all of its nodes have that sign and no value.
constexpr int32_t kOutsideBlock = -1, kInsideBlock = -2;
struct BlockGrid {
  int n_blocks;
  const int32_t* index;
  const float* values;
};

// The blocks without values (flat indices, rising) that a surface enters: one of their nodes shares a cell with a node
// of the other sign. Where there are none, the surface lies in cells whose nodes all have values.
SPLITNERF_API std::vector<int64_t> blocks_to_open(const BlockGrid& grid);

struct TriangleMesh {
  std::vector<float> vertices;     // [n, 3]
  std::vector<int32_t> triangles;  // [m, 3], counter-clockwise seen from outside (values >= 0)
};

// The zero level set, vertices unique, node (i, j, k) at origin + spacing (i, j, k). Cells with a node that has no
// value hold no triangle: see blocks_to_open. Vertices keep 1/1000 of an edge's length from its ends, so that
// no triangle is without area where a node's value is 0. Throws std::length_error above 2^31 - 1 vertices.
SPLITNERF_API TriangleMesh marching_cubes(const BlockGrid& grid, double origin, double spacing);

}  // namespace splitnerf
