// Marching through an occupancy grid against plain stepping, and its edge cases.
#include "splitnerf/march.h"

#include "check.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf {
namespace {

using Ray = std::pair<Vec3<double>, Vec3<double>>;

struct Grid {
  MarchOptions options;
  int resolution;
  std::vector<uint8_t> cells;

  Grid(int resolution, double step, uint8_t state)
      : options{1.5f, float(step), 1 << 20}, resolution(resolution),
        cells(size_t(resolution) * resolution * resolution, state) {}
  uint8_t& at(int x, int y, int z) { return cells[(size_t(x) * resolution + y) * resolution + z]; }
};

std::vector<double> march(const Grid& grid, Vec3<double> o, Vec3<double> d, double jitter = 0) {
  std::vector<double> starts;
  const OccupancyCells cells(grid.cells.data(), grid.resolution);
  const int64_t n =
      march_ray(OneThread{}, o, d, jitter, cells.view(), grid.options, [&](int64_t i, double t_start, double t_end) {
        EXPECT_EQ(i, int64_t(starts.size()));
        EXPECT_NEAR(t_end - t_start, grid.options.step, 1e-12);
        starts.push_back(t_start);
      });
  EXPECT_EQ(n, int64_t(starts.size()));
  return starts;
}

// Every lattice point whose midpoint is inside the box, cell by cell, without any skipping.
std::vector<double> step_by_step(Grid& grid, Vec3<double> o, Vec3<double> d, double jitter) {
  const double box = grid.options.box, step = grid.options.step;
  double t_near = 0, t_far = 1e30;
  for (int axis = 0; axis < 3; ++axis) {
    if (d[axis] == 0) {
      if (std::abs(o[axis]) > box) return {};
      continue;
    }
    const double a = (-box - o[axis]) / d[axis], b = (box - o[axis]) / d[axis];
    t_near = std::max(t_near, std::min(a, b));
    t_far = std::min(t_far, std::max(a, b));
  }
  std::vector<double> starts;
  for (int64_t k = 0;; ++k) {
    const double t_start = t_near + (double(k) + jitter - 1) * step, t_mid = t_start + 0.5 * step;
    if (t_mid <= t_near) continue;
    if (!(t_mid < t_far)) return starts;
    int cell[3];
    for (int axis = 0; axis < 3; ++axis)
      cell[axis] = std::min(grid.resolution - 1,
                            std::max(0, int((o[axis] + t_mid * d[axis] + box) / (2 * box) * grid.resolution)));
    const uint8_t state = grid.at(cell[0], cell[1], cell[2]);
    if (state == uint8_t(Cell::kOpaque)) return starts;
    if (state == uint8_t(Cell::kOccupied)) starts.push_back(t_start);
  }
}

void expect_same(const std::vector<double>& got, const std::vector<double>& expected, const std::string& what) {
  ASSERT_EQ(got.size(), expected.size()) << what;
  for (size_t i = 0; i < got.size(); ++i) ASSERT_NEAR(got[i], expected[i], 1e-9) << what;
}

TEST(March, SamplesExactlyTheOccupiedCells) {
  Random random(1);
  size_t total = 0;
  for (int trial = 0; trial < 400; ++trial) {
    Grid grid(1 + random.below(30), random.uniform(0.005, 0.4), 0);
    const double filled = std::pow(random.uniform(), 6);  // now and then whole blocks are empty
    for (uint8_t& cell : grid.cells) {
      const double u = random.uniform();
      cell = u < 0.6 * filled ? 1 : u < 0.63 * filled ? 2 : 0;
    }
    // Cameras inside and outside the box.
    const Vec3<double> o = random.direction() * random.uniform(0.1, 5),
                       target = random.direction() * random.uniform(0, 2);
    const Vec3<double> d = normalize(target - o);
    const double jitter = random.uniform();
    const std::vector<double> starts = march(grid, o, d, jitter);
    expect_same(starts, step_by_step(grid, o, d, jitter), "trial " + std::to_string(trial));
    total += starts.size();
  }
  EXPECT_GT(total, 500u);  // 878 where the compiler evaluates random numbers in another order
}

TEST(March, AxisParallelRaysCrossTheWholeBox) {
  const Grid grid(8, 0.01, uint8_t(Cell::kOccupied));
  for (const Ray& ray : {Ray{{-3, 0.1, 0.2}, {1, 0, 0}}, Ray{{0.1, 4, -0.3}, {0, -1, 0}},
                         Ray{{0.1, 0.3, -9}, {0, 0, 1}}, Ray{{3, 0.1, 0.2}, {-1, -0.0, 0.0}}}) {
    const std::vector<double> starts = march(grid, ray.first, ray.second);
    EXPECT_NEAR(double(starts.size()), 300, 1);
    for (double t : starts) {
      const Vec3<double> mid = ray.first + ray.second * (t + 0.005);
      for (int axis = 0; axis < 3; ++axis) EXPECT_LE(std::abs(mid[axis]), 1.5 + 1e-9);
    }
  }
  // One occupied layer, seen along each direction of the axis.
  Grid layer(10, 0.01, 0);
  for (int y = 0; y < 10; ++y)
    for (int z = 0; z < 10; ++z) layer.at(7, y, z) = 1;
  for (const double sign : {-1., 1.}) {
    const std::vector<double> starts = march(layer, {-4 * sign, 0.1, 0.1}, {sign, 0, 0});
    EXPECT_NEAR(double(starts.size()), 30, 1);  // a cell is 0.3 wide
    EXPECT_NEAR(-4 * sign + sign * starts.front(), sign > 0 ? 0.6 : 0.9, 0.02);
  }
}

TEST(March, RaysThatMissGiveNothing) {
  const Grid grid(4, 0.01, uint8_t(Cell::kOccupied));
  EXPECT_TRUE(march(grid, {3, 0, 0}, {1, 0, 0}).empty());                          // behind the ray
  EXPECT_TRUE(march(grid, {3, 2, 0}, {-1, 0, 0}).empty());                         // parallel, beside
  EXPECT_TRUE(march(grid, {3, 0, 0}, normalize(Vec3<double>{-1, 2, 0})).empty());  // past the corner
  EXPECT_TRUE(march(grid, {0, 0, 0}, {0, 0, 0}).empty());                          // no direction
  EXPECT_TRUE(march(grid, {NAN, 0, 0}, {1, 0, 0}).empty());
  EXPECT_TRUE(march(grid, {0, 0, 0}, {1, NAN, 0}).empty());
}

TEST(March, KeepsTheFirstMaxSamples) {
  Grid grid(10, 0.01, uint8_t(Cell::kOccupied));
  const std::vector<double> all = march(grid, {-3, 0.1, 0.1}, {1, 0, 0});
  for (const int64_t limit : {0, 1, 17}) {
    grid.options.max_samples = limit;
    const std::vector<double> starts = march(grid, {-3, 0.1, 0.1}, {1, 0, 0});
    EXPECT_EQ(starts, std::vector<double>(all.begin(), all.begin() + limit));
  }
}

}  // namespace
}  // namespace splitnerf
