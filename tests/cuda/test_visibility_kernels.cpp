// Kernels that look visibility up on a mesh, against the CPU.
#include "check.h"
#include "gpu.h"
#include "splitnerf/bodies/visibility_cache.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf {
namespace {

// n vertices of a ball that see some directions open, some blocked, and know nothing of the others.
struct Ball {
  static constexpr int64_t k = 64, levels = 2, buckets = 64;
  int64_t n;
  double radius = 0.6;
  std::vector<double> vertices, directions, light, radiance;
  std::vector<uint32_t> bits = std::vector<uint32_t>(2 * n * k / kBitsPerWord);
  std::vector<int32_t> hits = std::vector<int32_t>(n * k, -1), starts = std::vector<int32_t>(levels * (buckets + 1)),
                       order = std::vector<int32_t>(levels * n);

  Ball(Random& random, int64_t n) : n(n) {
    vertices = random.directions(n), light = random.uniforms(3 * k), radiance = random.uniforms(3 * n);
    for (uint32_t i = 0; i < k; ++i) {
      const Vec3<double> w = fibonacci_sphere<double>(i, k);
      directions.insert(directions.end(), {w.x, w.y, w.z});
    }
    for (int64_t v = 0; v < n; ++v)
      for (int64_t i = 0; i < k; ++i) {
        const int what = random.below(v % 5 == 0 ? 1 : 4);  // each fifth vertex sees all
        if (what > 1) continue;
        const bool blocked = what == 1;
        bits[(2 * v + blocked) * (k / kBitsPerWord) + i / kBitsPerWord] |= 1u << i % kBitsPerWord;
        if (blocked) hits[v * k + i] = random.below(int(n) + 3) - 1;  // some name no vertex
      }
    cpu::build_vertex_grids(n, vertices.data(), radius, int(levels), buckets, starts.data(), order.data());
  }
  VisibilityCache<double> cache(bool with_hits) const {
    return {{vertices.data(), vertices.data(), starts.data(), order.data(), n, buckets, int(levels), radius},
            bits.data(),
            with_hits ? hits.data() : nullptr,
            radiance.data(),
            n,
            k,
            directions.data(),
            light.data()};
  }
};

template <class T> void expect_same_nan_and_near(const std::vector<T>& got, const std::vector<T>& expected) {
  ASSERT_EQ(got.size(), expected.size());
  for (size_t i = 0; i < got.size(); ++i) {
    EXPECT_EQ(std::isnan(got[i]), std::isnan(expected[i])) << i;
    if (!std::isnan(expected[i])) { EXPECT_NEAR(got[i], expected[i], 1e-12) << i; }
  }
}

void check_caches(int64_t n_vertices) {
  Random random(3);
  const Ball ball(random, n_vertices);
  const int64_t n = 28, k = Ball::k;
  auto x = random.directions(n);
  const auto normals = x, lobes = random.directions(n), rho = random.uniforms(n, 0.1, 1);
  std::fill_n(&x[3], 3, 50.), x[6] = NAN;         // far from every vertex; nowhere
  for (int64_t i = 15; i < 30; ++i) x[i] *= 1.7;  // beyond the first level's radius
  for (const bool with_hits : {false, true}) {
    const VisibilityCache<double> cache = ball.cache(with_hits);
    const size_t few = with_hits ? 3 * n : 0, many = with_hits ? 3 * n * k : 0;
    std::vector<double> o_d(3 * n), o_s(3 * n), i_d(few), i_s(few), o_d8(3 * n), o_s8(3 * n), i_d8(few), i_s8(few);
    cpu::run(n, CachedOcclusionBody<double>{cache, x.data(), normals.data(), lobes.data(), rho.data(), o_d.data(),
                                            o_s.data(), i_d.data(), i_s.data()});
    on_gpu(n, CachedOcclusionBody<double>{cache, x.data(), normals.data(), lobes.data(), rho.data(), o_d8.data(),
                                          o_s8.data(), i_d8.data(), i_s8.data()});
    expect_same_nan_and_near(o_d8, o_d), expect_same_nan_and_near(o_s8, o_s);
    expect_same_nan_and_near(i_d8, i_d), expect_same_nan_and_near(i_s8, i_s);
    EXPECT_TRUE(o_d[0] > 0 && o_d[0] < 1 && o_d[3] == 1 && std::isnan(o_d[6]));
    if (with_hits) { EXPECT_GT(i_d[0], 0); }

    std::vector<double> v(n * k), a(many), v8(n * k), a8(many);
    cpu::run(n, CachedVisibilityBody<double>{cache, x.data(), normals.data(), v.data(), a.data()});
    on_gpu(n, CachedVisibilityBody<double>{cache, x.data(), normals.data(), v8.data(), a8.data()});
    expect_same_nan_and_near(v8, v), expect_same_nan_and_near(a8, a);
  }
}

// The larger ball has more vertices around a point than a group has threads, and more neighbours than are kept.
TEST(GroupKernels, CachedOcclusionAndVisibility) { check_caches(60); }
TEST(GroupKernels, CachedOcclusionAndVisibilityAmongManyVertices) { check_caches(500); }

}  // namespace
}  // namespace splitnerf
