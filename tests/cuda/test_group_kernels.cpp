// Kernels of a warp an item, against what the CPU makes of them.
#include <tuple>

#include "check.h"
#include "gpu.h"
#include "splitnerf/bodies/light_pyramid.h"
#include "splitnerf/bodies/losses.h"
#include "splitnerf/bodies/monte_carlo.h"
#include "splitnerf/bodies/rays.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/ops_cuda.h"

namespace splitnerf {
namespace {

// Rays of many lengths, among them none, one and just a group's; distances that fall from 0.1 to below 0, with rises between.
// Behind them are samples of no ray.
struct Rays {
  std::vector<int64_t> offsets{0};
  std::vector<double> sdf, gradient, directions;
  double s = 40, step = 0.02, anneal = 0.7;

  Rays() {
    Random random(3);
    for (const int length : {0, 1, 31, 32, 33, 70, 0, 64, 101, 9, 2}) {
      const Vec3<double> d = random.direction();
      directions.insert(directions.end(), {d.x, d.y, d.z});
      for (int i = 0; i < length; ++i) {
        const double f = 0.1 - 0.15 * i / length + 0.01 * random.uniform(-1);
        sdf.push_back(f);
        const Vec3<double> g = random.direction() * random.uniform(0.3, 1.5) - d;
        gradient.insert(gradient.end(), {g.x, g.y, g.z});
      }
      offsets.push_back(n());
    }
    for (int i = 0; i < 11; ++i) {
      sdf.push_back(0);
      gradient.insert(gradient.end(), {0., 0., 1.});
    }
  }
  int64_t n() const { return int64_t(sdf.size()); }
  PackedRays packed() const { return {int64_t(offsets.size()) - 1, n(), offsets.data()}; }
  SurfaceSamples<double> surface() const {
    return {packed(), sdf.data(), gradient.data(), directions.data(), &s, &step, &anneal, 0.01};
  }
};

// The distance is the first of some columns, and behind the samples there are other points.
TEST(GroupKernels, SurfaceWeightsAndTheirGradients) {
  const Rays r;
  const size_t n = size_t(r.n()), n_rays = size_t(r.packed().n_rays);
  for (const auto& [stride, more] : std::initializer_list<std::pair<size_t, size_t>>{{1, 0}, {3, 500}}) {
    SurfaceSamples<double> in = r.surface();
    const size_t rows = n + more;
    std::vector<double> sdf(stride * rows, 7);
    for (size_t i = 0; i < n; ++i) sdf[stride * i] = r.sdf[i];
    in.sdf = sdf.data(), in.stride = int64_t(stride), in.n_rows = int64_t(rows);
    Random random(2);
    const auto gn = random.uniforms(3 * n, -1), gw = random.uniforms(n, -1), go = random.uniforms(n_rays, -1);
    std::vector<double> normals(3 * n, 9), w(n, 9), o(n_rays), to_sdf(stride * rows, 9), to_gradient(3 * rows, 9),
        to_s(n_rays), depths(n);
    cpu::run(in.rays.n_rays, SurfaceWeightsBody<double>{in, normals.data(), w.data(), o.data()});
    cpu::run(in.rays.n_rays,
             SurfaceWeightsBackwardBody<double>{in, w.data(), gn.data(), gw.data(), go.data(), to_sdf.data(),
                                                to_gradient.data(), to_s.data(), depths.data()});
    std::vector<double> normals8(3 * n, 7), w8(n, 7), o8(n_rays), to_sdf8(stride * rows, 7), to_gradient8(3 * rows, 7),
        to_s8(n_rays), depths8 = unwritten<double>(int64_t(n));
    on_gpu(in.rays.n_rays, SurfaceWeightsBody<double>{in, normals8.data(), w8.data(), o8.data()});
    on_gpu(in.rays.n_rays,
           SurfaceWeightsBackwardBody<double>{in, w.data(), gn.data(), gw.data(), go.data(), to_sdf8.data(),
                                              to_gradient8.data(), to_s8.data(), depths8.data()});
    expect_near(normals8, normals, 0), expect_near(w8, w, 1e-14), expect_near(o8, o, 1e-14);
    for (const double last : {w8.back(), normals8.back(), to_gradient8.back(), to_sdf8.back()}) EXPECT_EQ(last, 0);
    expect_near(to_sdf8, to_sdf, 1e-13), expect_near(to_gradient8, to_gradient, 1e-13);
    expect_near(to_s8, to_s, 1e-13);
  }
}

// A NaN, which every sample behind it must see.
TEST(GroupKernels, SurfaceWeightsPassANanOn) {
  Rays r;
  r.sdf[size_t(r.offsets[5]) + 5] = std::nan("");
  const size_t n = size_t(r.n()), n_rays = size_t(r.packed().n_rays);
  std::vector<double> normals(3 * n), w(n, 9), o(n_rays), w32(n, 7), o32(n_rays);
  cpu::run(int64_t(n_rays), SurfaceWeightsBody<double>{r.surface(), normals.data(), w.data(), o.data()});
  on_gpu(int64_t(n_rays), SurfaceWeightsBody<double>{r.surface(), normals.data(), w32.data(), o32.data()});
  for (size_t i = 0; i < n; ++i) {
    EXPECT_EQ(std::isnan(w32[i]), std::isnan(w[i])) << i;
    if (!std::isnan(w[i])) { EXPECT_NEAR(w32[i], w[i], 1e-14) << i; }
  }
  EXPECT_TRUE(std::isnan(o32[5]));
}

TEST(GroupKernels, CompositeAndItsGradients) {
  const Rays r;
  const size_t n = size_t(r.n()), n_rays = size_t(r.packed().n_rays), channels = 5;
  Random random(4);
  const auto w = random.uniforms(n), v = random.uniforms(n * channels, -1), g = random.uniforms(n_rays * channels, -1),
             opacity = random.uniforms(n_rays);
  for (const double* divisor : {static_cast<const double*>(nullptr), opacity.data()}) {
    const CompositeArrays<double> in{r.packed(), int64_t(channels), w.data(), v.data(), divisor, 0.3};
    const auto run = [&](const auto& launch) {
      std::vector<std::vector<double>> out{std::vector<double>(n_rays * channels, 9), std::vector<double>(n, 9),
                                           std::vector<double>(n * channels, 9), std::vector<double>(n_rays, 9)};
      launch(CompositeBody<double>{in, out[0].data()});
      launch(CompositeBackwardBody<double>{in, g.data(), out[1].data(), out[2].data(), out[3].data()});
      return out;
    };
    const auto a = run([&](const auto& body) { cpu::run(in.rays.n_rays, body); }),
               b = run([&](const auto& body) { on_gpu(in.rays.n_rays, body); });
    expect_near(b[0], a[0], 1e-14), expect_near(b[1], a[1], 0), expect_near(b[2], a[2], 0);
    expect_near(b[3], a[3], 1e-14);
  }
}

// With as much capacity as is needed, with more, and with too little.
TEST(GroupKernels, SpreadSamples) {
  const Rays r;
  const int64_t n = r.n(), n_rays = r.packed().n_rays;
  Random random(12);
  const auto w = random.uniforms(size_t(n)), phase = random.uniforms(size_t(n_rays));
  std::vector<double> t(n);
  for (int64_t i = 0; i < n; ++i) t[i] = (i ? t[i - 1] : 0) + random.uniform(0.01, 0.2);
  const SpreadSizes capacity{500, n_rays, 400}, narrow{20, n_rays, 10};
  const double unit = 0.5;
  for (const auto& [per_ray, gap, fixed] :
       std::initializer_list<std::tuple<int, double, const SpreadSizes*>>{{0, 0.15, nullptr},
                                                                          {1, 0.15, nullptr},
                                                                          {4, INFINITY, nullptr},
                                                                          {4, 0.15, &capacity},
                                                                          {1, INFINITY, &capacity},
                                                                          {4, 0.15, &narrow}}) {
    using Indices = std::vector<int64_t>;
    struct Result {
      Indices first, second, shaded, heaviest, leaders, stretch;
      std::vector<double> share;
      Spread allocate(const SpreadSizes& sizes) {
        shaded.resize(sizes.shaded), heaviest.resize(sizes.heaviest), leaders.resize(sizes.leaders);
        stretch.resize(sizes.shaded);
        return {shaded.data(), heaviest.data(), leaders.data(), stretch.data(), sizes};
      }
    };
    Result one{Indices(n, -1), Indices(n, -1), {}, {}, {}, {}, std::vector<double>(n, -1)}, two = one;
    int64_t sizes[3];
    const SpreadArrays<double> in{r.packed(), w.data(), t.data(), phase.data(), gap / unit, &unit, per_ray};
    cpu::spread_samples(in, sizes, one.first.data(), one.second.data(), one.share.data(),
                        {[&](const SpreadSizes& s) { return one.allocate(s); }, fixed});
    int64_t counted[3];
    Gpu gpu;
    cuda::spread_samples(gpu.queue(), in, counted, two.first.data(), two.second.data(), two.share.data(),
                         {[&](const SpreadSizes& s) { return two.allocate(s); }, fixed});
    EXPECT_TRUE(std::equal(counted, counted + 3, sizes));
    EXPECT_EQ(two.shaded, one.shaded);
    EXPECT_EQ(two.first, one.first);
    EXPECT_EQ(two.second, one.second);
    EXPECT_EQ(two.heaviest, one.heaviest);
    EXPECT_EQ(two.leaders, one.leaders);
    EXPECT_EQ(two.stretch, one.stretch);
    EXPECT_EQ(two.share, one.share);
    EXPECT_EQ(two.first.back(), 0);
  }
}

// A ray of which more samples are drawn than were counted: what the next ray has stays its own.
TEST(GroupKernels, SpreadSamplesKeepsToWhatWasCounted) {
  const std::vector<int64_t> offsets{0, 8, 16}, sums{0, 7, 15, 0, 1, 2, 0, 1, 2};
  const std::vector<double> weights(16, 0.1), phase(2, 0.5);
  std::vector<double> t(16), share(16);
  for (size_t i = 0; i < 16; ++i) t[i] = 0.1 * double(i);
  std::vector<int64_t> shaded(15, -1), heaviest(2), leaders(2), stretch(15), first(16), second(16);
  const Spread to{shaded.data(), heaviest.data(), leaders.data(), stretch.data(), {15, 2, 2}};
  const SpreadFillBody<double> fill{
      {{2, 16, offsets.data()}, weights.data(), t.data(), phase.data(), INFINITY, nullptr, 0},
      sums.data(),
      to,
      first.data(),
      second.data(),
      share.data()};
  fill(1), fill(0);
  for (int64_t k = 0; k < 15; ++k) EXPECT_EQ(shaded[size_t(k)], k < 7 ? k : k + 1);
}

// Offsets that nobody has checked: nothing outside the arrays is touched.
TEST(GroupKernels, OffsetsOutOfRangeAreKeptInside) {
  const std::vector<int64_t> offsets{-5, 3, 1, 99};
  const PackedRays rays{3, 4, offsets.data()};
  const int64_t first[3] = {0, 3, 1}, count[3] = {3, 0, 3};
  for (int64_t r = 0; r < 3; ++r) {
    EXPECT_EQ(rays.samples_of(r).first, first[r]);
    EXPECT_EQ(rays.samples_of(r).n, count[r]);
  }
}

// ---- marching ----

struct March {
  int resolution = 20;  // no multiple of a block's cells
  std::vector<uint8_t> cells;
  MarchOptions options{1.5f, 0.013f, 1024};
  std::vector<float> o, d, jitter;

  explicit March(double filled) : cells(size_t(resolution) * resolution * resolution) {
    Random random(7);
    for (uint8_t& cell : cells) cell = random.uniform() < filled ? (random.uniform() < 0.02 ? 2 : 1) : 0;
    d = random.directions<float>(40), jitter = random.uniforms<float>(40);
    for (int i = 0; i < 40; ++i)
      for (int axis = 0; axis < 3; ++axis) o.push_back(-3.f * d[3 * i + axis] + float(random.uniform(-1, 1)));
    d[0] = 0, d[1] = 1, d[2] = 0;
    std::fill_n(&o[3], 3, 0.1f), std::fill_n(&o[6], 3, 50.f), o[9] = INFINITY;
  }
  int64_t n() const { return int64_t(jitter.size()); }
};

struct Marched {
  std::vector<int64_t> offsets, ray_indices;
  std::vector<float> t_starts, t_ends;

  explicit Marched(int64_t n_rays) : offsets(n_rays + 1) {}
  void allocate() {
    ray_indices.resize(offsets.back()), t_starts.resize(offsets.back()), t_ends.resize(offsets.back());
  }
};

TEST(GroupKernels, MarchingTakesTheSamplesOfTheCpuInItsOrder) {
  for (const double filled : {0.0, 0.02, 0.4}) {
    for (const int64_t most : {1024, 5}) {
      March m(filled);
      m.options.max_samples = most;
      const OccupancyCells grid(m.cells.data(), m.resolution);
      Marched one(m.n()), lanes(m.n());
      cpu::run(m.n(), MarchCountBody<float>{m.options, grid.view(), m.o.data(), m.d.data(), m.jitter.data(),
                                            one.offsets.data() + 1});
      on_gpu(m.n(), MarchCountBody<float>{m.options, grid.view(), m.o.data(), m.d.data(), m.jitter.data(),
                                          lanes.offsets.data() + 1});
      for (Marched* marched : {&one, &lanes})
        for (int64_t r = 0; r < m.n(); ++r) marched->offsets[r + 1] += marched->offsets[r];
      ASSERT_EQ(lanes.offsets, one.offsets);
      EXPECT_EQ(one.offsets.back() > 0, filled > 0);
      one.allocate(), lanes.allocate();
      cpu::run(m.n(),
               MarchFillBody<float>{m.options, grid.view(), m.o.data(), m.d.data(), m.jitter.data(), one.offsets.data(),
                                    one.ray_indices.data(), one.t_starts.data(), one.t_ends.data()});
      on_gpu(m.n(),
             MarchFillBody<float>{m.options, grid.view(), m.o.data(), m.d.data(), m.jitter.data(), lanes.offsets.data(),
                                  lanes.ray_indices.data(), lanes.t_starts.data(), lanes.t_ends.data()});
      EXPECT_EQ(lanes.ray_indices, one.ray_indices);
      EXPECT_EQ(lanes.t_starts, one.t_starts);
      EXPECT_EQ(lanes.t_ends, one.t_ends);
    }
  }
}

TEST(GroupKernels, OccupiedBlocks) {
  const March m(0.001);
  const int n = blocks_along(m.resolution);
  std::vector<uint8_t> one(size_t(n) * n * n), lanes(one.size(), 9);
  cpu::run(int64_t(one.size()), OccupiedBlocksBody{m.cells.data(), m.resolution, n, one.data()});
  on_gpu(int64_t(one.size()), OccupiedBlocksBody{m.cells.data(), m.resolution, n, lanes.data()});
  for (size_t i = 0; i < one.size(); ++i) EXPECT_EQ(lanes[i] != 0, one[i] != 0) << i;
  EXPECT_TRUE(std::count(one.begin(), one.end(), 0) > 0 && std::count(one.begin(), one.end(), 0) < int64_t(one.size()));
}

// ---- light ----

TEST(GroupKernels, MonteCarloSumsAndTheirGradients) {
  const int64_t n = 5;
  const int k = 21;
  Random random(9);
  const auto normals = random.directions(n), views = random.directions(n), rho = random.uniforms(n, 0.05, 1);
  auto pdf = random.uniforms(n * k, 0.1, 2);
  pdf[3] = 0;  // counts for nothing
  std::vector<double> dirs(3 * n * k), dirs8(dirs.size());
  cpu::run(n, SampleLobeBody<double>{normals.data(), rho.data(), k, 5u, dirs.data()});
  on_gpu(n, SampleLobeBody<double>{normals.data(), rho.data(), k, 5u, dirs8.data()});
  expect_near(dirs8, dirs, 0);

  const auto radiance = random.uniforms(3 * n * k), g = random.uniforms(3 * kLightSums * n, -1);
  std::vector<double> sums(3 * kLightSums * n), to_n(3 * n), to_rho(n), to_light(3 * n * k), sums8(3 * kLightSums * n),
      to_n8(3 * n), to_rho8(n), to_light8(3 * n * k);
  const DrawnLight<double> light{k, dirs.data(), pdf.data(), radiance.data()};
  const ToDrawnLight<double> receive{k, to_light.data()};
  cpu::run(n, DrawnLightBody<double>{k, normals.data(), views.data(), rho.data(), light, sums.data()});
  cpu::run(n, DrawnLightBackwardBody<double>{k, normals.data(), views.data(), rho.data(), light, g.data(), to_n.data(),
                                             to_rho.data(), receive});
  on_gpu(n, SumLightBody<double, DrawnLight<double>>{k, normals.data(), views.data(), rho.data(), light, sums8.data()});
  on_gpu(n, SumLightBackwardBody<double, DrawnLight<double>, ToDrawnLight<double>>{k,
                                                                                   normals.data(),
                                                                                   views.data(),
                                                                                   rho.data(),
                                                                                   light,
                                                                                   g.data(),
                                                                                   to_n8.data(),
                                                                                   to_rho8.data(),
                                                                                   {k, to_light8.data()}});
  expect_near(sums8, sums, 1e-13), expect_near(to_n8, to_n, 1e-13), expect_near(to_rho8, to_rho, 1e-13);
  expect_near(to_light8, to_light, 0);
}

void check_summed_light(int64_t n, int k, bool with_sent) {
  Random random(11);
  const auto normals = random.directions(n), views = random.directions(n), rho = random.uniforms(n, 0.05, 1);
  const auto dirs = random.directions(k), angles = random.uniforms(k), radiance = random.uniforms(3 * k);
  const auto visible = random.uniforms(n * k), sent = random.uniforms(3 * n * k),
             g = random.uniforms(3 * kLightSums * n, -1);
  const SharedLight<double> light{
      k, dirs.data(), angles.data(), radiance.data(), visible.data(), with_sent ? sent.data() : nullptr};
  auto sums = unwritten<double>(3 * kLightSums * n), to_n = unwritten<double>(3 * n), to_rho = unwritten<double>(n),
       to_light = unwritten<double>(3 * k), sums8 = sums, to_n8 = to_n, to_rho8 = to_rho, to_light8 = to_light;
  cpu::run(n, SharedLightBody<double>{k, normals.data(), views.data(), rho.data(), {light}, sums.data()});
  on_gpu(n, SharedLightBody<double>{k, normals.data(), views.data(), rho.data(), {light}, sums8.data()});
  const auto backward = [&](std::vector<double>& n, std::vector<double>& rho_grad, std::vector<double>& light_grad) {
    return SharedLightBackwardBody<double>{k,          normals.data(),  views.data(),
                                           rho.data(), {light},         g.data(),
                                           n.data(),   rho_grad.data(), {k, visible.data(), light_grad.data()}};
  };
  Gpu gpu;
  cpu::shared_light_backward(n, backward(to_n, to_rho, to_light));
  cuda::shared_light_backward(gpu.queue(), n, backward(to_n8, to_rho8, to_light8));
  expect_near(sums8, sums, 1e-13), expect_near(to_n8, to_n, 1e-13), expect_near(to_rho8, to_rho, 1e-13);
  expect_near(to_light8, to_light, 1e-13 * double(1 + n));
}
TEST(GroupKernels, SummedLightAndItsGradients) {
  for (const int64_t n : {0, 1, 40})
    for (const bool with_sent : {false, true}) check_summed_light(n, 35, with_sent);
}
TEST(GroupKernels, SummedLightOfMorePointsThanWarps) { check_summed_light(2133, 3, false); }
// Only four warps have space for their copies; then none has.
TEST(GroupKernels, SummedLightOfManyDirections) {
  check_summed_light(9, 1300, true);
  std::vector<double> to_light(3 * 10000);
  SharedLightBackwardBody<double> body{};
  body.n = body.receive.n = 10000, body.receive.grad_light = to_light.data();
  Gpu gpu;
  EXPECT_THROW(cuda::shared_light_backward(gpu.queue(), 1, body), std::invalid_argument);
}

TEST(GroupKernels, QuadraticEntropy) {
  Random random(17);
  const int64_t n = 21;
  for (const int64_t channels : {1, 8, 11}) {
    const auto x = random.uniforms(n * channels, -1);
    std::vector<double> one(n * (channels + 1)), lanes(one.size());
    cpu::run(n, PairLikenessBody<double>{n, channels, x.data(), one.data()});
    on_gpu(n, PairLikenessBody<double>{n, channels, x.data(), lanes.data()});
    expect_near(lanes, one, 1e-13);
  }
}

TEST(GroupKernels, SparseProduct) {
  Random random(13);
  const int64_t n_rows = 6, n_columns = 30;
  std::vector<int64_t> offsets{0};
  std::vector<int32_t> columns;
  for (const int length : {0, 1, 8, 9, 25, 3}) {
    for (int i = 0; i < length; ++i) columns.push_back(random.below(n_columns));
    offsets.push_back(int64_t(columns.size()));
  }
  const auto weights = random.uniforms(columns.size(), -1), values = random.uniforms(3 * n_columns);
  for (const int n_images : {1, kMirrorImages}) {
    std::vector<int32_t> places(n_rows * n_images), images(n_columns * n_images);
    for (size_t i = 0; i < places.size(); ++i) places[i] = int32_t(places.size() - 1 - i);
    for (int32_t& column : images) column = random.below(n_columns);
    const SparseRows<double> matrix{offsets.data(), columns.data(), weights.data(), places.data(),
                                    images.data(),  n_columns,      n_images};
    std::vector<double> one(3 * places.size()), lanes(3 * places.size());
    cpu::run(places.size(), SparseProductBody<double>{matrix, values.data(), one.data()});
    on_gpu(places.size(), SparseProductBody<double>{matrix, values.data(), lanes.data()});
    expect_near(lanes, one, 1e-14);
  }
}

}  // namespace
}  // namespace splitnerf
