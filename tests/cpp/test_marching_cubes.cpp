// Marching cubes: every case closed and in the cube, and closed oriented meshes of random fields.
#include "splitnerf/marching_cubes.h"

#include <map>
#include <set>

#include "check.h"

namespace splitnerf {
namespace {

using Edge = std::pair<int, int>;

bool inside(int mask, int corner) { return (mask >> corner & 1) != 0; }

// How often each directed edge of a case's triangles occurs.
std::map<Edge, int> directed_edges(const CubeCase& cell) {
  std::map<Edge, int> count;
  for (int t = 0; t < cell.n_triangles; ++t)
    for (int k = 0; k < 3; ++k) ++count[{cell.edges[3 * t + k], cell.edges[3 * t + (k + 1) % 3]}];
  return count;
}

// The faces (2 axis + side) that an edge of the cube lies in, as bits.
int faces_of(int e) {
  const CubeEdge& edge = cube_edges()[e];
  int bits = 0;
  for (int axis = 0; axis < 3; ++axis)
    if (axis != edge.axis) bits |= 1 << (2 * axis + (edge.from >> axis & 1));
  return bits;
}

TEST(MarchingCubesTable, UsesExactlyTheEdgesThatChangeSign) {
  for (int mask = 0; mask < 256; ++mask) {
    std::set<int> changing, used;
    for (int e = 0; e < 12; ++e)
      if (inside(mask, cube_edges()[e].from) != inside(mask, cube_edges()[e].to)) changing.insert(e);
    const CubeCase& cell = cube_cases()[mask];
    used.insert(cell.edges.begin(), cell.edges.begin() + 3 * cell.n_triangles);
    EXPECT_EQ(used, changing) << "case " << mask;
  }
}

TEST(MarchingCubesTable, OpenEdgesLieInFacesAndInnerEdgesDoNot) {
  for (int mask = 0; mask < 256; ++mask) {
    for (const auto& [edge, n] : directed_edges(cube_cases()[mask])) {
      EXPECT_EQ(n, 1) << "case " << mask;
      const bool open = directed_edges(cube_cases()[mask]).count({edge.second, edge.first}) == 0;
      EXPECT_EQ(open, (faces_of(edge.first) & faces_of(edge.second)) != 0) << "case " << mask;
    }
  }
}

// The open edges of a case on one face, in the corners' coordinates on that face.
std::set<std::pair<std::set<int>, std::set<int>>> segments(int mask, int axis, int side, bool reversed) {
  std::set<std::pair<std::set<int>, std::set<int>>> out;
  const auto on_face = [&](int e) {
    const int clear = ~(1 << axis);
    return std::set<int>{cube_edges()[e].from & clear, cube_edges()[e].to & clear};
  };
  for (const auto& [edge, n] : directed_edges(cube_cases()[mask])) {
    if ((faces_of(edge.first) & faces_of(edge.second) & 1 << (2 * axis + side)) == 0) continue;
    if (reversed)
      out.insert({on_face(edge.second), on_face(edge.first)});
    else
      out.insert({on_face(edge.first), on_face(edge.second)});
  }
  return out;
}

TEST(MarchingCubesTable, NeighboursAgreeOnTheirCommonFace) {
  for (int axis = 0; axis < 3; ++axis) {
    for (int a = 0; a < 256; ++a) {
      for (int b = 0; b < 256; ++b) {
        bool same = true;  // the high side of a is the low side of b
        for (int corner = 0; corner < 8; ++corner)
          if (!(corner >> axis & 1)) same = same && inside(a, corner | 1 << axis) == inside(b, corner);
        if (same) { ASSERT_EQ(segments(a, axis, 1, false), segments(b, axis, 0, true)) << a << " " << b; }
      }
    }
  }
}

// Blocks with random or given values inside a shell of outside blocks.
struct Field {
  int n_blocks;
  std::vector<int32_t> index;
  std::vector<float> values;

  explicit Field(int inner) : n_blocks(inner + 2), index(size_t(n_blocks) * n_blocks * n_blocks, kOutsideBlock) {}
  int32_t& at(int x, int y, int z) { return index[(size_t(x) * n_blocks + y) * n_blocks + z]; }
  template <class F> void open(int x, int y, int z, F&& value) {
    at(x, y, z) = int32_t(values.size() / kMeshBlockNodes);
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j)
        for (int k = 0; k < 4; ++k) values.push_back(float(value(4 * x + i, 4 * y + j, 4 * z + k)));
  }
  BlockGrid grid() const { return {n_blocks, index.data(), values.data()}; }
};

double expect_closed(const TriangleMesh& mesh) {
  std::map<Edge, int> count;
  std::set<int> used(mesh.triangles.begin(), mesh.triangles.end());
  EXPECT_EQ(used.size(), mesh.vertices.size() / 3);
  double volume = 0;
  for (size_t t = 0; t < mesh.triangles.size(); t += 3) {
    Vec3<double> p[3];
    for (int k = 0; k < 3; ++k) {
      ++count[{mesh.triangles[t + k], mesh.triangles[t + (k + 1) % 3]}];
      for (int c = 0; c < 3; ++c) p[k][c] = mesh.vertices[3 * mesh.triangles[t + k] + c];
    }
    volume += dot(p[0], cross(p[1], p[2])) / 6;
  }
  for (const auto& [edge, n] : count) {
    EXPECT_EQ(n, 1);
    EXPECT_EQ(count.count({edge.second, edge.first}), 1u);
  }
  return volume;
}

TEST(MarchingCubes, RandomFieldsAreClosedAndOriented) {
  Random random(3);
  for (int trial = 0; trial < 20; ++trial) {
    Field field(3);
    for (int x = 0; x < 5; ++x)
      for (int y = 0; y < 5; ++y)
        for (int z = 0; z < 5; ++z)
          field.open(x, y, z, [&](int i, int j, int k) {
            const bool shell = std::min({i, j, k}) == 0 || std::max({i, j, k}) == 19;
            return shell ? 1.0 : trial % 2 ? random.normal() : double(random.below(3) - 1);  // zeros too
          });
    const TriangleMesh mesh = marching_cubes(field.grid(), 0, 1);
    ASSERT_GT(mesh.triangles.size(), 1000u);
    EXPECT_GT(expect_closed(mesh), 0);
  }
}

TEST(MarchingCubes, TwoSkippedBlocksOfOtherSignAreOpened) {
  Field field(2);
  field.at(1, 1, 1) = kInsideBlock;
  EXPECT_EQ(blocks_to_open(field.grid()).size(), 27u);
}

}  // namespace
}  // namespace splitnerf
