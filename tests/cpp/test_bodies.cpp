// The bodies that single threads run on the GPU, where the CPU has code of its own: one against the other.
#include "check.h"
#include "splitnerf/bodies/adamw.h"
#include "splitnerf/bodies/hash_encode.h"
#include "splitnerf/bodies/light_pyramid.h"
#include "splitnerf/bodies/prefilter.h"
#include "splitnerf/bodies/shading.h"
#include "splitnerf/light_tables.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf {
namespace {

// ---- hash grid ----

// Numbers in [-1, 1] as a table stores them; of 16 bits any that are finite and not above 1.
template <class S> std::vector<S> drawn_entries(Random& random, size_t n) {
  if constexpr (std::is_floating_point_v<S>) {
    return random.uniforms<S>(n, -1);
  } else {
    const int one = std::is_same_v<S, Half> ? 0x3c00 : 0x3f80;
    std::vector<S> out(n);
    for (S& x : out) x.bits = static_cast<uint16_t>(random.below(one + 1) | random.below(2) << 15);
    return out;
  }
}

// S: what the table stores.
template <class T, int F, class S = T> void check_hash_grid(double tolerance) {
  const HashGridShape shape{4, F, 4, 1.7, 8};  // two dense levels, two hashed ones
  const int n_active = 3, n_levels = shape.n_levels;
  HashGridView<T, S> grid{};
  const int64_t n_entries = hash_levels(shape, grid.levels), n = 67, columns = n_levels * F;
  Random random(F);
  const auto positions = random.uniforms<T>(3 * n, -0.1, 1.1);
  const auto table = drawn_entries<S>(random, n_entries * F);
  const auto g = random.uniforms<T>(n * columns, -1), gj = random.uniforms<T>(3 * n * columns, -1);
  grid.n_levels = n_levels, grid.n_active = n_active, grid.positions = positions.data(), grid.table = table.data();
  using Values = std::vector<T>;

  Values features(n * columns), jacobian(3 * n * columns), features1(n * columns, 7), jacobian1(3 * n * columns, 7);
  cpu::hash_encode(shape, n_active, n, positions.data(), table.data(), features.data(), jacobian.data());
  const HashEncodeBody<T, F, true, S> encode{grid, features1.data(), jacobian1.data()};
  for (int l = 0; l < n_levels; ++l)
    for (int64_t p = 0; p < n; ++p) encode(p, l);
  expect_near(features1, features, tolerance), expect_near(jacobian1, jacobian, tolerance);

  for (const bool with_jacobian : {false, true}) {
    const T* to_jacobian = with_jacobian ? gj.data() : nullptr;
    Values to_table(n_entries * F), to_table1(n_entries * F);
    cpu::hash_encode_backward(shape, n_active, n, positions.data(), g.data(), to_jacobian, to_table.data());
    HashGridView<T> points{};
    std::copy_n(grid.levels, n_levels, points.levels);
    points.n_levels = n_levels, points.n_active = n_active, points.positions = positions.data();
    const HashScatterBody<T, F> scatter{points, g.data(), to_jacobian, to_table1.data()};
    for (int l = 0; l < n_active; ++l)
      for (int64_t p = 0; p < n; ++p) scatter(p, l);
    expect_near(to_table1, to_table, tolerance);
  }

  Values to_positions(3 * n), to_positions1(3 * n);
  cpu::hash_encode_backward_positions(shape, n_active, n, positions.data(), table.data(), g.data(), gj.data(),
                                      to_positions.data());
  const HashPositionsBody<T, F, S> positions_body{grid, g.data(), gj.data(), to_positions1.data()};
  for (int64_t p = 0; p < n; ++p) positions_body(p);
  expect_near(to_positions1, to_positions, tolerance);
}

TEST(Bodies, HashGrid) {
  check_hash_grid<double, 1>(1e-14), check_hash_grid<double, 2>(1e-14);
  check_hash_grid<double, 4>(1e-14), check_hash_grid<double, 8>(1e-14);
  check_hash_grid<float, 2>(1e-5), check_hash_grid<float, 8>(1e-5);
}
TEST(Bodies, HashGridOf16Bits) {
  check_hash_grid<float, 1, Half>(1e-5), check_hash_grid<float, 2, Half>(1e-5), check_hash_grid<float, 8, Half>(1e-5);
  check_hash_grid<float, 2, Bfloat16>(1e-5), check_hash_grid<float, 4, Bfloat16>(1e-5);
}

// ---- the optimiser ----

// Rows of which each second one has no gradient.
template <class T> void check_adamw(double tolerance, int64_t columns, bool sparse) {
  const int64_t n = 61 * columns;
  Random random(static_cast<uint32_t>(columns));
  const AdamwRule<T> rule(0.1, 0.9, 0.99, 1e-8, 0.2, 3);
  auto grad = random.uniforms<T>(n, -1);
  for (int64_t i = 0; i < n; ++i)
    if (i / columns % 2 == 0 || random.below(3) == 0) grad[i] = T(0);
  const auto param = random.uniforms<T>(n, -1), m = random.uniforms<T>(n, -1), v = random.uniforms<T>(n);
  auto param1 = param, m1 = m, v1 = v, param2 = param, m2 = m, v2 = v;
  std::vector<Half> half1(n), half2(n);
  std::vector<Bfloat16> bfloat1(n), bfloat2(n);
  for (int64_t i = 0; i < n; ++i) {
    half1[i] = half2[i] = narrow<Half>(float(param[i]));
    bfloat1[i] = bfloat2[i] = narrow<Bfloat16>(float(param[i]));
  }
  const AdamwArrays<T> x{n,         columns,   sparse,       param1.data(), grad.data(),
                         m1.data(), v1.data(), half1.data(), bfloat1.data()};
  cpu::run(n, AdamwBody<T>{rule, x});
  const AdamwBody<T> body{
      rule, {n, columns, sparse, param2.data(), grad.data(), m2.data(), v2.data(), half2.data(), bfloat2.data()}};
  for (int64_t i = 0; i < n; ++i) body(i);
  expect_near(param2, param1, tolerance), expect_near(m2, m1, tolerance), expect_near(v2, v1, tolerance);
  for (int64_t i = 0; i < n; ++i) {
    for (const Half x : {half1[i], half2[i]}) EXPECT_NEAR(widen(x), param1[i], 1e-3 * (1 + std::abs(param1[i]))) << i;
    for (const Bfloat16 x : {bfloat1[i], bfloat2[i]})
      EXPECT_NEAR(widen(x), param1[i], 8e-3 * (1 + std::abs(param1[i]))) << i;
    if (sparse && i / columns % 2 == 0) { EXPECT_TRUE(param1[i] == param[i] && m1[i] == m[i] && v1[i] == v[i]) << i; }
  }
}

TEST(Bodies, Adamw) {
  for (const int64_t columns : {1, 2, 3, 8, 700}) {
    for (const bool sparse : {false, true}) {
      check_adamw<double>(1e-14, columns, sparse);
      check_adamw<float>(1e-6, columns, sparse);
    }
  }
}

// What a thread reads and writes at once is never wider than 16 bytes, nor than the values' own alignment in their rows.
TEST(Bodies, PacksAreAlignedToWhatTheirRowsAre) {
  const size_t alignments[] = {alignof(Pack<float, 1>), alignof(Pack<float, 2>),  alignof(Pack<float, 4>),
                               alignof(Pack<float, 8>), alignof(Pack<double, 1>), alignof(Pack<double, 8>),
                               alignof(Pack<Half, 1>),  alignof(Pack<Half, 2>),   alignof(Pack<Bfloat16, 8>)};
  const size_t expected[] = {4, 8, 16, 16, 8, 16, 2, 4, 16};
  for (int i = 0; i < 9; ++i) EXPECT_EQ(alignments[i], expected[i]) << i;
  EXPECT_EQ(sizeof(Pack<float, 8>), 32u);
  EXPECT_EQ(sizeof(Pack<double, 1>), 8u);
}

// ---- shading ----

TEST(Bodies, SplitSumShading) {
  const int64_t n = 37;
  for (const int channels : {1, 3})
    for (const FresnelMode mode : {FresnelMode::kExact, FresnelMode::kPaper, FresnelMode::kCode})
      for (const bool compensate : {false, true}) {
        Random random(5);
        const auto normals = random.directions(n), views = random.directions(n), albedo = random.uniforms(3 * n);
        const auto rho = random.uniforms(n), metallic = random.uniforms(n), specular = random.uniforms(3 * n);
        const auto diffuse = random.uniforms(3 * n), o_s = random.uniforms(n * channels),
                   o_d = random.uniforms(n * channels), g = random.uniforms(3 * n, -1);
        const ShadeArrays<const double> in{normals.data(),  views.data(),   albedo.data(), rho.data(), metallic.data(),
                                           specular.data(), diffuse.data(), o_s.data(),    o_d.data()};
        std::vector<double> radiance(3 * n), radiance1(3 * n), grad(19 * n + 2 * n * channels), grad1(grad.size());
        const auto parts = [&](double* p) {
          return ShadeArrays<double>{p,          p + 3 * n,  p + 6 * n,
                                     p + 9 * n,  p + 10 * n, p + 11 * n,
                                     p + 14 * n, p + 17 * n, p + 17 * n + n * channels};
        };
        const ShadeOptions options{mode, compensate};
        cpu::run(n, ShadeBody<double>{brdf_lut(), options, channels, in, radiance.data()});
        cpu::run(n, ShadeBackwardBody<double>{brdf_lut(), options, channels, in, g.data(), parts(grad.data())});
        const ShadeBody<double> shade{brdf_lut(), options, channels, in, radiance1.data()};
        const ShadeBackwardBody<double> backward{brdf_lut(), options, channels, in, g.data(), parts(grad1.data())};
        for (int64_t i = 0; i < n; ++i) shade(i), backward(i);
        expect_near(radiance1, radiance, 1e-14), expect_near(grad1, grad, 1e-13);
      }
}

// ---- pre-integrated light ----

// Each item against all sources, part by part, as the tiles of a kernel hold them against each other.
template <class Item, class Sources, class Make, class Keep>
void meet_sources(int64_t n_items, int n_parts, const Sources& sources, const Make& make, const Keep& keep) {
  for (int64_t i = 0; i < n_items; ++i)
    for (int part = 0; part < n_parts; ++part) {
      Item item = make(i);
      for (int64_t j = part_begin(sources.n, part, n_parts); j < part_begin(sources.n, part + 1, n_parts); ++j)
        item.add(sources(j));
      keep(part, i, item);
    }
}

TEST(Bodies, PrefilteredLight) {
  const int64_t n_queries = 23, n_lights = 700;
  const int n_parts = lobe_parts(n_queries, n_lights);
  ASSERT_GT(n_parts, 1);
  Random random(6);
  const auto dirs = random.directions(n_queries), lights = random.directions(n_lights),
             rho = random.uniforms(n_queries), radiance = random.uniforms(3 * n_lights),
             g = random.uniforms(3 * n_queries, -1);
  std::vector<double> gbar(3 * n_queries), total(n_queries), to_light(3 * n_lights), gbar1(3 * n_queries),
      total1(n_queries), to_light1(3 * n_lights);
  cpu::prefilter_light(n_queries, dirs.data(), rho.data(), n_lights, lights.data(), radiance.data(), gbar.data(),
                       total.data());
  cpu::prefilter_light_backward(n_queries, dirs.data(), rho.data(), total.data(), g.data(), n_lights, lights.data(),
                                to_light.data());

  const QueryList<double> queries{n_queries, dirs.data(), rho.data(), total.data(), g.data()};
  const LightList<double> light_list{n_lights, lights.data(), radiance.data()};
  std::vector<double> parts(4 * n_parts * n_queries);
  meet_sources<LobeGather<double>>(
      n_queries, n_parts, light_list,
      [&](int64_t i) { return LobeGather<double>{load3(&dirs[3 * i]), queries.alpha_squared(i)}; },
      [&](int part, int64_t i, const LobeGather<double>& item) {
        store3(&parts[4 * (part * n_queries + i)], item.value);
        parts[4 * (part * n_queries + i) + 3] = item.total;
      });
  const GatherFinishBody<double> gather{n_queries, n_parts, parts.data(), gbar1.data(), total1.data()};
  for (int64_t i = 0; i < n_queries; ++i) gather(i);
  expect_near(gbar1, gbar, 1e-13), expect_near(total1, total, 1e-13);

  const int n_back = lobe_parts(n_lights, n_queries);
  std::vector<double> back(3 * n_back * n_lights);
  meet_sources<LobeScatter<double>>(
      n_lights, n_back, queries, [&](int64_t i) { return LobeScatter<double>{load3(&lights[3 * i])}; },
      [&](int part, int64_t i, const LobeScatter<double>& item) {
        store3(&back[3 * (part * n_lights + i)], item.value);
      });
  const ScatterFinishBody<double> scatter{n_lights, n_back, back.data(), to_light1.data()};
  for (int64_t i = 0; i < n_lights; ++i) scatter(i);
  expect_near(to_light1, to_light, 1e-13);
}

TEST(Bodies, PartsCoverTheList) {
  for (const int64_t items : {int64_t{0}, int64_t{1}, int64_t{16384}, int64_t{1} << 30})
    for (const int64_t sources : {0, 1, 255, 8192, 1 << 20}) {
      const int n_parts = lobe_parts(items, sources);
      ASSERT_GE(n_parts, 1);
      ASSERT_LE(n_parts, 64);
      EXPECT_EQ(part_begin(sources, 0, n_parts), 0);
      EXPECT_EQ(part_begin(sources, n_parts, n_parts), sources);
    }
  EXPECT_EQ(lobe_parts(16384, 8192), 16);
  EXPECT_EQ(lobe_parts(1 << 20, 8192), 1);
}

// ---- the light's pyramid ----

// Adds up what a tile of points in shared memory would.
struct ToHarmonics {
  double *grad_sh, *grad_sums;

  void add(int i, double basis, const double*) const {
    for (int c = 0; c < 3; ++c) grad_sh[3 * i + c] += basis * grad_sums[c];
  }
  void add_constant(Vec3<double> grad) const {
    for (int c = 0; c < 3; ++c) grad_sh[c] += grad[c];
  }
};

TEST(Bodies, LightLookup) {
  Random random(8);
  const int64_t n = 203;
  const auto levels = random.uniforms(3 * (16 * 16 + 8 * 8), 0.1, 1.1);
  auto sh = random.uniforms(3 * kShCoefficients, -0.05, 0.05);
  sh[0] = sh[1] = sh[2] = 3;
  // So little of the constant that the sums lie about the floor, those of the second channel close to it.
  auto zonal = zonal_factors(0.5, 9);
  for (size_t row = 0; row < zonal.size(); row += kShBands) zonal[row] *= 1e-3;
  for (int i = 1; i < kShCoefficients; ++i) sh[3 * i + 1] *= 0.01;
  const auto dirs = random.directions(n), g = random.uniforms(3 * n, -1);
  auto rho = random.uniforms(n);
  rho[0] = 0.5, rho[1] = 0.3, rho[2] = 0.05, rho[3] = 1, rho[4] = 0;
  LightPyramid<double> p{};
  p.levels = levels.data(), p.sh = sh.data(), p.zonal = zonal.data(), p.n_levels = 2, p.n_zonal = 9;
  p.resolution[0] = 16, p.resolution[1] = 8, p.offset[1] = 16 * 16;
  p.node[0] = 0.05, p.node[1] = 0.3, p.node[2] = 0.5;
  p.recurrence = &sh_recurrence<double>();

  std::vector<double> radiance(3 * n), to_dirs(3 * n), to_rho(n), to_levels(levels.size()), to_sh(sh.size());
  cpu::run(n, LightLookupBody<double>{p, *p.recurrence, dirs.data(), rho.data(), radiance.data()});
  cpu::light_lookup_backward(p, n, dirs.data(), rho.data(), g.data(), to_dirs.data(), to_rho.data(), to_levels.data(),
                             to_sh.data());
  std::vector<double> radiance1(3 * n), to_dirs1(3 * n), to_rho1(n), to_levels1(levels.size()), to_sh1(sh.size());
  const LightLookupBody<double> lookup{p, *p.recurrence, dirs.data(), rho.data(), radiance1.data()};
  for (int64_t i = 0; i < n; ++i) {
    lookup(i);
    double grad_sums[3] = {};
    const LightArgumentsGrad<double> to =
        read_light_backward(p, *p.recurrence, load3(&dirs[3 * i]), rho[i], load3(&g[3 * i]), to_levels1.data(),
                            ToHarmonics{to_sh1.data(), grad_sums}, grad_sums);
    store3(&to_dirs1[3 * i], to.direction);
    to_rho1[i] = to.roughness;
  }
  expect_near(radiance1, radiance, 1e-13), expect_near(to_dirs1, to_dirs, 1e-12), expect_near(to_rho1, to_rho, 1e-12);
  expect_near(to_levels1, to_levels, 1e-13), expect_near(to_sh1, to_sh, 1e-13);
}

}  // namespace
}  // namespace splitnerf
