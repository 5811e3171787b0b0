// The walk along a ray through fields that are known at each sample.
#include "splitnerf/ray_walk.h"

#include "check.h"

namespace splitnerf {
namespace {

constexpr double kStep = 1. / 256;  // 512 samples along the x axis of the box [-1, 1]^3, the first at -1

struct Walked {
  std::vector<int64_t> looked_at;
  std::vector<double> kept;  // x of the middles
  int n_returns;
};

// A ray along the x axis through cells that are all occupied; f(k, x): the distance at sample k.
template <class F> Walked walk(F f, SampleRules<double> rules) {
  const std::vector<uint8_t> cells(8, uint8_t(Cell::kOccupied));
  const OccupancyCells grid(cells.data(), 2);
  const MarchOptions march{1.f, float(kStep), 1024};
  const RayLattice<double> lattice({-2, 0.1, 0.1}, {1, 0, 0}, 1., march);
  Walk<double> on(lattice, 0, march, grid.view());
  Walked out;
  while (on.next >= 0) {
    out.looked_at.push_back(on.next);
    advance(on, f(on.next, lattice.middle(on.next).x), grid.view(), march, rules,
            [&](double start) { out.kept.push_back(start + kStep / 2 - 2); });
  }
  out.n_returns = on.n_returns;
  return out;
}
SampleRules<double> rules_for(double s, double reach, double least = 1e-3) {
  return {s, 1, 1e-3, -std::log(1e-3), least, reach, 1.25};
}
double nearest(const std::vector<double>& kept, double x) {
  double d = 9;
  for (const double at : kept) d = std::min(d, std::abs(at - x));
  return d;
}

TEST(RayWalk, AFieldWithinTheBoundIsNeverGoneBackIn) {
  for (const double slope : {0.7, 1., 1.25}) {
    const Walked w = walk([&](int64_t, double x) { return slope * (0.3 - x); }, rules_for(1000, 0.007));
    EXPECT_EQ(w.n_returns, 0);
    EXPECT_TRUE(std::is_sorted(w.looked_at.begin(), w.looked_at.end()));
    EXPECT_LE(nearest(w.kept, 0.3), kStep);
    EXPECT_LT(w.looked_at.size(), 40u);
  }
}

// The sign changes from sample to sample, and the bound allows leaps of 41 samples, which all end at the other sign. 32 times the
// walk comes back to the sample behind its last one: samples 0 to 32 and 32 leaps in vain. Then it makes leaps of 10 samples,
// 47 of them fit into the 479 samples that are left.
TEST(RayWalk, ANoisyFieldCostsASetNumberOfDistances) {
  const double height = 41.5 * 1.25 * kStep;
  const Walked w = walk([&](int64_t k, double) { return k % 2 == 0 ? height : -height; }, rules_for(1000, 0, 0));
  EXPECT_EQ(w.n_returns, 32);
  EXPECT_EQ(w.looked_at.size(), 33u + 32u + 47u);
  const std::vector<int64_t> first(w.looked_at.begin(), w.looked_at.begin() + 4);
  EXPECT_EQ(first, (std::vector<int64_t>{0, 41, 1, 42}));
  EXPECT_EQ(w.looked_at[64], 32);
  EXPECT_EQ(w.looked_at[65], 42);
  EXPECT_EQ(w.looked_at.back(), 502);
}

// A plane of twice the bound's slope: 205 samples lie in front of it, at each of which a leap ends behind it. After 32 of them the
// leaps take half of what is left, so the plane is found, by 8 leaps and the samples around it.
TEST(RayWalk, ASteepPlaneIsFoundAllTheSame) {
  const Walked w = walk([](int64_t, double x) { return 2.5 * (-0.2 - x); }, rules_for(1000, 0.007));
  EXPECT_EQ(w.n_returns, 32);
  EXPECT_LE(nearest(w.kept, -0.2), kStep);
  EXPECT_LE(w.looked_at.size(), 33u + 32u + 8u + 4u);
}

}  // namespace
}  // namespace splitnerf
