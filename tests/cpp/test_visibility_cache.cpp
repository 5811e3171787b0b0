// Visibility bits: vertices that are far, and the sums against plain loops. The search for vertices: tests/reference.py.
#include "splitnerf/visibility_cache.h"

#include <algorithm>

#include "check.h"
#include "meshes.h"
#include "splitnerf/kernels.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/prefilter.h"

namespace splitnerf {
namespace {

constexpr int kVertices = 600, kLevels = 3, kBuckets = 256;
constexpr double kRadius = 0.2;

// Vertices spread over [-1, 1]^3 with random normals, in grids with many collisions.
struct Cloud {
  std::vector<double> vertices, normals;
  std::vector<int32_t> starts, order;
  VertexGrids<double> grids;

  explicit Cloud(uint32_t seed) : starts(kLevels * (kBuckets + 1)), order(kLevels * kVertices) {
    Random random(seed);
    vertices = random.uniforms(3 * kVertices, -1, 1);
    normals = random.directions(kVertices);
    cpu::build_vertex_grids(kVertices, vertices.data(), kRadius, kLevels, kBuckets, starts.data(), order.data());
    grids = {vertices.data(), normals.data(), starts.data(), order.data(), kVertices, kBuckets, kLevels, kRadius};
  }
};

TEST(VertexGrids, AFarPointHasNoNeighbours) {
  const Cloud cloud(4);
  for (const double far : {1e3, 1e12, 1e30})
    EXPECT_EQ(find_neighbours(cloud.grids, {far, -far, 0.0}, {0.0, 0.0, 1.0}).n, 0);
}

// Every instruction set against plain loops over the same formulas.
template <class T> void check_sums(double tolerance) {
  constexpr int n = 96, words = n / kBitsPerWord, neighbours = 5;
  Random random(7);
  const std::vector<T> x = random.uniforms<T>(n, -1, 1), y = random.uniforms<T>(n, -1, 1),
                       z = random.uniforms<T>(n, -1, 1);
  const std::vector<T> light = random.uniforms<T>(3 * n, 0, 2);
  const std::vector<T> lobe_dir{T(0.6), T(0), T(0.8)}, normal{T(0), T(0), T(1)};
  std::vector<uint32_t> bits(neighbours * 2 * words);
  for (size_t i = 0; i < bits.size(); ++i) bits[i] = hash_u32(uint32_t(i));
  for (int k = 0; k < neighbours; ++k) {  // open or blocked or neither; nobody knows the first direction
    for (int w = 0; w < words; ++w) bits[(2 * k + 1) * words + w] &= ~bits[2 * k * words + w];
    bits[2 * k * words] &= ~1u, bits[(2 * k + 1) * words] &= ~1u;
  }
  const std::vector<T> weights{T(0.4), T(0.3), T(0.15), T(0.1), T(0.05)};
  const uint32_t* rows[neighbours];
  for (int k = 0; k < neighbours; ++k) rows[k] = &bits[2 * k * words];
  const LobeSide<T> directions{x.data(), y.data(), z.data(), nullptr, &light[0], &light[n], &light[2 * n], n};

  double expected[14] = {};
  for (int i = 0; i < n; ++i) {
    double all = 0, open = 0;
    for (int k = 0; k < neighbours; ++k) {
      const bool is_open = rows[k][i / 32] >> i % 32 & 1, is_blocked = rows[k][words + i / 32] >> i % 32 & 1;
      all += (is_open || is_blocked) * double(weights[k]), open += is_open * double(weights[k]);
    }
    const double v = all > 0 ? open / all : 1, c = std::max(double(z[i]), 0.0);
    const double s =
        c > 0 ? double(prefilter_weight(lobe_dir[0] - x[i], lobe_dir[1] - y[i], lobe_dir[2] - z[i], T(0.04))) : 0;
    for (int ch = 0; ch < 3; ++ch) {
      const double l = light[ch * n + i];
      expected[ch] += v * c * l, expected[3 + ch] += c * l, expected[7 + ch] += v * s * l, expected[10 + ch] += s * l;
    }
    expected[6] += c, expected[13] += s;
  }
  for (const Kernels<T>& set : usable_kernels<T>()) {
    std::vector<T> cosine(n), known(n), visible(n), lobe(n), sums(14);
    std::vector<uint32_t> above(words);
    set.visibility_horizon(directions, normal.data(), cosine.data(), above.data());
    for (int i = 0; i < n; ++i) ASSERT_EQ(above[i / 32] >> i % 32 & 1, z[i] > 0) << set.name;
    set.visibility_shares(directions.n, {rows, weights.data(), neighbours}, known.data(), visible.data());
    set.visibility_sums(directions, {cosine.data(), lobe_dir.data(), T(0.04)}, visible.data(), lobe.data(),
                        sums.data());
    EXPECT_EQ(visible[0], 1) << set.name;
    for (int i = 0; i < 14; ++i)
      EXPECT_NEAR(sums[i], expected[i], tolerance * (1 + expected[i])) << set.name << " " << i;
  }
}
TEST(CachedLobe, SumsFloat) { check_sums<float>(1e-5); }
TEST(CachedLobe, SumsDouble) { check_sums<double>(1e-12); }

}  // namespace
}  // namespace splitnerf
