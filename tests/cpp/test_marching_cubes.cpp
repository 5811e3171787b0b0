// Marching cubes: closed oriented meshes of random fields, whose 100,000 cubes have every case beside every other.
#include "splitnerf/marching_cubes.h"

#include <map>
#include <set>

#include "check.h"

namespace splitnerf {
namespace {

using Edge = std::pair<int, int>;

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
