// Index arithmetic beyond 2^31, on the index functions alone: none of these arrays exists.
#include <set>

#include "check.h"
#include "splitnerf/environment.h"
#include "splitnerf/hash_grid.h"
#include "splitnerf/march.h"
#include "splitnerf/octahedral.h"
#include "splitnerf/sampling.h"
#include "splitnerf/visibility_cache.h"

namespace splitnerf {
namespace {

constexpr int64_t kTwo31 = int64_t{1} << 31;

std::vector<HashLevel> levels_of(const HashGridShape& shape) {
  std::vector<HashLevel> levels(shape.n_levels);
  hash_levels(shape, levels.data());
  return levels;
}

TEST(Index, HashedCornersStayInLevelsBeyondTwoToThe31) {
  const HashGridShape shape{32, 8, 1 << 20, 1.1, 30};
  ASSERT_EQ(hash_shape_error(32, 8, 1 << 20, 1.1, 30), "");
  Random random(1);
  for (const HashLevel& level : levels_of(shape)) {
    for (int i = 0; i < 200; ++i) {
      Vec3<double> x{random.uniform(), random.uniform(), random.uniform()};
      if (i < 8) x = {double(i & 1), double(i >> 1 & 1), double(i >> 2)};
      const HashCell<double> cell = hash_cell(level, x);
      for (int64_t index : cell.index) {
        EXPECT_GE(index, level.offset);
        EXPECT_LT(index, level.offset + level.n_entries);
      }
    }
  }
  const HashLevel last = levels_of(shape).back();
  EXPECT_EQ(last.offset, int64_t{31} << 30);
  EXPECT_GE((last.offset + last.n_entries) * 8 * int64_t(sizeof(float)), int64_t{1} << 40);  // bytes: no 32-bit offset
}

// 1023^3 nodes just fit into 2^30 entries: the last one's number is exact, and no two corners of a cell share one.
TEST(Index, DenseLevelsNearTwoToThe30) {
  const HashGridShape shape{4, 2, 1022, 1.0, 30};
  const std::vector<HashLevel> levels = levels_of(shape);
  const int64_t nodes = 1023;
  for (int l = 0; l < 4; ++l) {
    ASSERT_TRUE(levels[l].dense);
    EXPECT_EQ(levels[l].offset, l * nodes * nodes * nodes);
    const HashCell<double> last = hash_cell(levels[l], Vec3<double>{1., 1., 1.});
    EXPECT_EQ(last.index[7], levels[l].offset + nodes * nodes * nodes - 1);
    EXPECT_EQ(last.index[0], levels[l].offset + ((nodes - 2) * nodes + nodes - 2) * nodes + nodes - 2);
    EXPECT_EQ(std::set<int64_t>(last.index, last.index + 8).size(), 8u);
  }
  EXPECT_GT(levels[3].offset, kTwo31);
}

// The finest grid that a shape may have: cells of each axis are found, and the corners' arithmetic does not wrap.
TEST(Index, TheFinestResolution) {
  const int finest = (1 << 30) - 1;
  EXPECT_EQ(hash_shape_error(1, 2, finest, 1.0, 30), "");
  EXPECT_NE(hash_shape_error(1, 2, int64_t{1} << 30, 1.0, 30), "");
  for (const double x : {0.0, 0.25, 0.999999999, 1.0, 2.0, -1.0}) {
    const CellAxis<double> axis = cell_axis(finest, x);
    const double place = clamp(x, 0.0, 1.0) * finest;
    EXPECT_EQ(axis.node, std::min<int64_t>(int64_t(place), finest - 1)) << x;
    EXPECT_NEAR(double(axis.node) + axis.f, place, 1e-6) << x;
  }
  EXPECT_LT(spatial_hash(finest, finest, finest, 1u << 30), 1u << 30);
  EXPECT_LT(spatial_hash(0xffffffffu, 0xffffffffu, 0xffffffffu, 1u << 30), 1u << 30);
}

// A denormal, an infinite and a NaN coordinate have a cell that exists.
TEST(Index, CoordinatesThatAreNotOrdinary) {
  for (const int resolution : {1, 16, (1 << 24) - 1}) {
    for (const float x : {1e-45f, -1e-45f, INFINITY, -INFINITY, NAN, 3e38f, -3e38f, -0.f}) {
      const CellAxis<float> axis = cell_axis(resolution, x);
      EXPECT_LT(axis.node, uint32_t(resolution)) << x;
      EXPECT_TRUE(x == x ? axis.f >= 0 && axis.f <= 1 : axis.f != axis.f) << x;
    }
  }
}

TEST(Index, OccupancyCellsBeyondTwoToThe31) {
  const int n = 2048;
  EXPECT_EQ(OccupancyView::at(n - 1, n - 1, n - 1, n), int64_t(n) * n * n - 1);
  EXPECT_EQ(OccupancyView::at(n - 1, 0, 0, n), int64_t(n - 1) * n * n);
}

TEST(Index, EnvironmentTexelsBeyondTwoToThe31) {
  const int height = 1 << 16, width = 1 << 17;
  const auto f = equirect_footprint(Vec2<double>{0.999, 0.999}, height, width);
  for (int64_t texel : f.texel) {
    EXPECT_GE(texel, 0);
    EXPECT_LT(texel, int64_t(height) * width);
  }
  EXPECT_GT(f.texel[0], kTwo31);
}

// 2^14 is the largest map: three numbers a texel still have 32-bit offsets.
TEST(Index, OctahedralTexelsOfTheLargestMap) {
  const int n = 1 << 14;
  for (const Vec2<double> uv : {Vec2<double>{1., 1.}, {-1., -1.}, {1., -1.}, {0., 1.}, {0.99999, 0.5}}) {
    for (int texel : octahedral_footprint(n, uv).texel) {
      EXPECT_GE(texel, 0);
      EXPECT_LT(texel, n * n);
      EXPECT_LT(3 * int64_t(texel) + 2, kTwo31);
    }
  }
}

// Lattices of up to 2^32 points stay in [0, 1), in float too, where i + 1/2 over n may round to 1.
TEST(Index, LatticesOfManyPoints) {
  for (const uint32_t n : {1u, 1u << 24, (1u << 31) - 1, 1u << 31, 0xffffffffu}) {
    for (const uint32_t i : {0u, n / 2, n - 1}) {
      const Vec2<float> u = fibonacci_lattice<float>(i, n);
      EXPECT_TRUE(u.x >= 0 && u.x < 1 && u.y >= 0 && u.y < 1) << i << " of " << n;
      EXPECT_LT(random_unit<float>(i, n), 1.f);
    }
  }
}

}  // namespace
}  // namespace splitnerf
