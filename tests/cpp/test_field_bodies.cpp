// The bodies of the distance field's network and of the visibility cache against the operators of the CPU.
#include "check.h"
#include "lanes.h"
#include "splitnerf/bodies/sdf_layer.h"
#include "splitnerf/march.h"
#include "splitnerf/bodies/visibility_cache.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf {
namespace {

// ---- the distance field: a tile of points, phase by phase as a block of threads runs it ----

constexpr HashGridShape kShape{3, 2, 4, 1.7, 8};

struct Network {
  int n_features = kShape.n_levels * kShape.n_features, n_inputs = 3 + n_features, width = 21, n_outputs = 5;
  std::vector<double> hidden, hidden_bias, out, out_bias;
  SdfWeights<double> weights;

  explicit Network(Random& random) {
    hidden = random.uniforms(width * n_inputs, -0.5, 0.5), hidden_bias = random.uniforms(width, -0.1, 0.1);
    out = random.uniforms(n_outputs * width, -1), out_bias = random.uniforms(n_outputs, -1);
    weights = {n_inputs, width, n_outputs, hidden.data(), hidden_bias.data(), out.data(), out_bias.data(), 20., 1.5};
  }
};

TEST(FieldBodies, SdfLayerAndItsGradients) {
  Random random(1);
  const Network net(random);
  const PreparedSdfLayer<double> prepared(net.weights);
  const SdfLayer<double>& layer = prepared.layer();
  const int n = 7, points = 8, c = net.n_features;  // the tile has a point more than there are
  const auto x = random.uniforms(3 * n, -1), f = random.uniforms(n * c, -1), j = random.uniforms(3 * n * c, -1);
  const auto go = random.uniforms(n * net.n_outputs, -1), gg = random.uniforms(3 * n, -1);

  std::vector<double> numbers(SdfTile<double>::backward_rows(net.n_inputs, net.n_outputs) * (points + 1));
  const SdfTile<double> tile{numbers.data(), points + 1, net.n_inputs, net.n_outputs};
  for (int p = 0; p < n; ++p) {
    for (int k = 0; k < net.n_inputs; ++k) tile.input(k, p) = k < 3 ? x[3 * p + k] : f[p * c + k - 3];
  }
  std::vector<double> outputs(n * net.n_outputs), gradient(3 * n), outputs1(outputs.size()), gradient1(3 * n);
  cpu::sdf_layer(net.weights, n, x.data(), f.data(), j.data(), outputs.data(), gradient.data());
  for (int p = 0; p < points; ++p) sdf_forward<true>(layer, tile, p);
  for (int p = 0; p < n; ++p) {
    for (int m = 0; m < net.n_outputs; ++m) outputs1[p * net.n_outputs + m] = tile.output(m, p);
    store3(&gradient1[3 * p], sdf_gradient(layer, tile, p, &j[3 * p * c]));
    EXPECT_NEAR(sdf_value(layer, tile, p), outputs[p * net.n_outputs], 1e-13);
  }
  expect_near(outputs1, outputs, 1e-13), expect_near(gradient1, gradient, 1e-13);

  std::vector<double> to_f(n * c), to_j(3 * n * c), to_hidden(net.hidden.size()), to_bias(net.width),
      to_out(net.out.size()), to_out_bias(net.n_outputs), to_f1(to_f), to_j1(to_j), to_hidden1(to_hidden),
      to_bias1(to_bias), to_out1(to_out), to_out_bias1(to_out_bias);
  cpu::sdf_layer_backward(net.weights, n, x.data(), f.data(), j.data(), go.data(), gg.data(), to_f.data(), to_j.data(),
                          to_hidden.data(), to_bias.data(), to_out.data(), to_out_bias.data());
  for (int p = 0; p < points; ++p) {
    sdf_forward<false>(layer, tile, p);
    for (int m = 0; m < net.n_outputs; ++m) tile.output(m, p) = p < n ? go[p * net.n_outputs + m] : 0;
    if (p < n) sdf_gradient_backward(layer, tile, p, &j[3 * p * c], load3(&gg[3 * p]), &to_j1[3 * p * c]);
    for (int k = 0; k < net.n_inputs; ++k) {
      if (p >= n) tile.grad_steepness(k, p) = 0;
      tile.steepness(k, p) = 0;
    }
  }
  for (int first = 0; first < layer.width_columns; first += kSdfUnits) {
    for (int p = 0; p < points; ++p) sdf_units_backward(layer, tile, first, p);
    for (int u = 0; u < kSdfUnits && first + u < net.width; ++u) {
      for (int row = 0; row < sdf_weight_rows(layer); ++row) {
        const double sum = sdf_weight_sum(tile, n, row, u);
        const int m = row - net.n_inputs - 1, h = first + u;
        (row < net.n_inputs ? to_hidden1[h * net.n_inputs + row]
         : m < 0            ? to_bias1[h]
                            : to_out1[m * net.width + h]) = sum;
      }
    }
  }
  for (int m = 0; m < net.n_outputs; ++m) to_out_bias1[m] = sdf_bias_sum(tile, n, m);
  for (int p = 0; p < n; ++p)
    for (int k = 0; k < c; ++k) to_f1[p * c + k] = tile.steepness(3 + k, p);
  expect_near(to_f1, to_f, 1e-12), expect_near(to_j1, to_j, 1e-13), expect_near(to_hidden1, to_hidden, 1e-12);
  expect_near(to_bias1, to_bias, 1e-12), expect_near(to_out1, to_out, 1e-12),
      expect_near(to_out_bias1, to_out_bias, 1e-13);
}

TEST(FieldBodies, SdfValues) {
  Random random(2);
  const Network net(random);
  const PreparedSdfLayer<double> prepared(net.weights);
  HashGridView<double> grid{};
  const auto table = random.uniforms(hash_levels(kShape, grid.levels) * kShape.n_features, -1);
  grid.n_levels = kShape.n_levels, grid.n_active = 2, grid.table = table.data();
  const int n = 20;
  const auto x = random.uniforms(3 * n, -1.7, 1.7);
  std::vector<double> values(n), numbers(net.n_inputs * n);
  cpu::sdf_values(SdfField<double>{kShape, 2, table.data(), net.weights}, n, x.data(), values.data());
  const SdfTile<double> tile{numbers.data(), n, net.n_inputs, net.n_outputs};
  for (int p = 0; p < n; ++p) {
    load_field_inputs<2>(grid, prepared.layer().scale, load3(&x[3 * p]), tile, p);
    EXPECT_NEAR(sdf_value(prepared.layer(), tile, p), values[p], 1e-12) << p;
  }
}

TEST(FieldBodies, SampledRays) {
  Random random(4);
  const Network net(random);
  const PreparedSdfLayer<double> prepared(net.weights);
  HashGridView<double> grid{};
  const auto table = random.uniforms(hash_levels(kShape, grid.levels) * kShape.n_features, -1);
  grid.n_levels = kShape.n_levels, grid.n_active = 2, grid.table = table.data();
  const int64_t n = 30;
  const auto d = random.directions(n), jitter = random.uniforms(n);
  std::vector<double> o(3 * n);
  for (int64_t i = 0; i < 3 * n; ++i) o[i] = -2 * d[i] + random.uniform(-0.5, 0.5);
  const std::vector<uint8_t> cells(6 * 6 * 6, uint8_t(Cell::kOccupied));
  const OccupancyCells occupancy(cells.data(), 6);
  const MarchOptions march{1.5f, 0.04f, 1024};
  const SampleRules<double> rules{20, 1, 0.001, -std::log(0.001), 1e-3, 0.2, 3};

  std::vector<int64_t> offsets(n + 1), evaluated(n), indices;
  std::vector<double> starts, ends;
  cpu::sample_rays<double>(SdfField<double>{kShape, 2, table.data(), net.weights}, march, occupancy.view(), rules, n,
                           o.data(), d.data(), jitter.data(), offsets.data(), evaluated.data(), [&](int64_t kept) {
                             indices.resize(kept), starts.resize(kept), ends.resize(kept);
                             return PackedSamples<double>{indices.data(), starts.data(), ends.data()};
                           });
  EXPECT_GT(starts.size(), 30u);
  std::vector<double> numbers(net.n_inputs);
  const SdfTile<double> tile{numbers.data(), 1, net.n_inputs, net.n_outputs};
  for (int64_t r = 0; r < n; ++r) {
    const RayLattice<double> lattice(load3(&o[3 * r]), load3(&d[3 * r]), jitter[r], march);
    std::vector<double> kept;
    const int64_t asked = walk_ray<2>(grid, prepared.layer(), tile, 0, lattice, occupancy.view(), march, rules,
                                      [&](double start) { kept.push_back(start); });
    EXPECT_EQ(asked, evaluated[r]) << r;
    EXPECT_EQ(kept, std::vector<double>(starts.begin() + offsets[r], starts.begin() + offsets[r + 1])) << r;
    EXPECT_LE(int64_t(kept.size()), most_samples<double>(march));
  }
}

// ---- the visibility cache ----

// Vertices of a ball that see some directions open, some blocked, and know nothing of the others.
struct Ball {
  static constexpr int64_t n = 60, k = 64, levels = 2, buckets = 64;
  double radius = 0.6;
  std::vector<double> vertices, directions, light, radiance;
  std::vector<uint32_t> bits = std::vector<uint32_t>(2 * n * k / kBitsPerWord);
  std::vector<int32_t> hits = std::vector<int32_t>(n * k, -1), starts = std::vector<int32_t>(levels * (buckets + 1)),
                       order = std::vector<int32_t>(levels * n);

  explicit Ball(Random& random) {
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
        if (blocked) hits[v * k + i] = random.below(n + 3) - 1;  // some name no vertex
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

TEST(FieldBodies, CachedOcclusionAndVisibility) {
  Random random(3);
  const Ball ball(random);
  const int64_t n = 12, k = Ball::k;
  auto x = random.directions(n);
  const auto normals = x, lobes = random.directions(n), rho = random.uniforms(n, 0.1, 1);
  std::fill_n(&x[3], 3, 50.), x[6] = NAN;  // far from every vertex; nowhere
  for (const bool with_hits : {false, true}) {
    const VisibilityCache<double> cache = ball.cache(with_hits);
    const size_t few = with_hits ? 3 * n : 0, many = with_hits ? 3 * n * k : 0;
    std::vector<double> o_d(3 * n), o_s(3 * n), i_d(few), i_s(few), o_d8(3 * n), o_s8(3 * n), i_d8(few), i_s8(few);
    cpu::run(n, CachedOcclusionBody<double>{cache, x.data(), normals.data(), lobes.data(), rho.data(), o_d.data(),
                                            o_s.data(), i_d.data(), i_s.data()});
    for_each_by_lanes<8>(n, CachedOcclusionBody<double>{cache, x.data(), normals.data(), lobes.data(), rho.data(),
                                                        o_d8.data(), o_s8.data(), i_d8.data(), i_s8.data()});
    expect_same_nan_and_near(o_d8, o_d), expect_same_nan_and_near(o_s8, o_s);
    expect_same_nan_and_near(i_d8, i_d), expect_same_nan_and_near(i_s8, i_s);
    EXPECT_TRUE(o_d[0] > 0 && o_d[0] < 1 && o_d[3] == 1 && std::isnan(o_d[6]));
    if (with_hits) { EXPECT_GT(i_d[0], 0); }

    std::vector<double> v(n * k), a(many), v8(n * k), a8(many);
    cpu::run(n, CachedVisibilityBody<double>{cache, x.data(), normals.data(), v.data(), a.data()});
    for_each_by_lanes<8>(n, CachedVisibilityBody<double>{cache, x.data(), normals.data(), v8.data(), a8.data()});
    expect_same_nan_and_near(v8, v), expect_same_nan_and_near(a8, a);
  }
}

}  // namespace
}  // namespace splitnerf
