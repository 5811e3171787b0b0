// Kernels of a thread an item, against the CPU.
#include <numeric>

#include "check.h"
#include "gpu.h"
#include "splitnerf/bodies/elementwise.h"
#include "splitnerf/bodies/pixels.h"
#include "splitnerf/light_tables.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf {
namespace {

// ---- shading ----

TEST(PointKernels, SplitSumShading) {
  for (const int64_t n : {0, 1, 300})
    for (const int channels : {1, 3})
      for (const FresnelMode mode : {FresnelMode::kExact, FresnelMode::kPaper, FresnelMode::kCode})
        for (const bool compensate : {false, true}) {
          Random random(5);
          const auto normals = random.directions(n), views = random.directions(n), albedo = random.uniforms(3 * n);
          const auto rho = random.uniforms(n), metallic = random.uniforms(n), specular = random.uniforms(3 * n);
          const auto diffuse = random.uniforms(3 * n), o_s = random.uniforms(n * channels),
                     o_d = random.uniforms(n * channels), g = random.uniforms(3 * n, -1);
          const auto i_s = random.uniforms(3 * n), i_d = random.uniforms(3 * n);
          const ShadeArrays<const double> in{normals.data(),  views.data(),    albedo.data(),  rho.data(),
                                             metallic.data(), specular.data(), diffuse.data(), o_s.data(),
                                             o_d.data(),      i_s.data(),      i_d.data()};
          auto radiance = unwritten<double>(3 * n), grad = unwritten<double>(17 * n + 2 * n * channels);
          auto radiance1 = radiance, grad1 = grad;
          const auto parts = [&](double* p) {
            return ShadeArrays<double>{p,          p + 3 * n,  p + 6 * n,
                                       p + 9 * n,  p + 10 * n, p + 11 * n,
                                       p + 14 * n, p + 17 * n, p + 17 * n + n * channels,
                                       nullptr,    nullptr};
          };
          const ShadeOptions options{mode, compensate};
          cpu::run(n, ShadeBody<double>{brdf_lut(), options, channels, in, radiance.data()});
          cpu::run(n, ShadeBackwardBody<double>{brdf_lut(), options, channels, in, g.data(), parts(grad.data())});
          on_gpu(n, ShadeBody<double>{brdf_lut(), options, channels, in, radiance1.data()});
          on_gpu(n, ShadeBackwardBody<double>{brdf_lut(), options, channels, in, g.data(), parts(grad1.data())});
          expect_near(radiance1, radiance, 1e-14), expect_near(grad1, grad, 1e-13);
        }
}

TEST(PointKernels, SummedShading) {
  for (const int64_t n : {0, 1, 300})
    for (const bool compensate : {false, true}) {
      Random random(15);
      const auto normals = random.directions(n), views = random.directions(n), albedo = random.uniforms(3 * n);
      const auto rho = random.uniforms(n), metallic = random.uniforms(n), sums = random.uniforms(12 * n),
                 g = random.uniforms(3 * n, -1);
      const auto other = random.uniforms(3 * n), share = random.uniforms(n);
      const SummedArrays<const double> in{normals.data(), views.data(),    albedo.data(),
                                          rho.data(),     metallic.data(), sums.data()};
      for (const bool mixed : {false, true}) {
        auto radiance = unwritten<double>(3 * n), grad = unwritten<double>(26 * n), radiance1 = radiance, grad1 = grad;
        const auto forward = [&](double* to) {
          return ShadeSumsBody<double>{
              brdf_lut(), compensate, in, mixed ? other.data() : nullptr, mixed ? share.data() : nullptr, to};
        };
        const auto backward = [&](double* p) {
          const SummedArrays<double> to{p, p + 3 * n, p + 6 * n, p + 9 * n, p + 10 * n, p + 11 * n};
          return ShadeSumsBackwardBody<double>{
              brdf_lut(), compensate, in, mixed ? share.data() : nullptr, g.data(), to, mixed ? p + 23 * n : nullptr};
        };
        cpu::run(n, forward(radiance.data())), cpu::run(n, backward(grad.data()));
        on_gpu(n, forward(radiance1.data())), on_gpu(n, backward(grad1.data()));
        if (!mixed) grad.resize(23 * n), grad1.resize(23 * n);
        expect_near(radiance1, radiance, 1e-14), expect_near(grad1, grad, 1e-13);
      }
    }
}

TEST(PointKernels, SrgbCurve) {
  for (const int64_t n : {0, 1, 256, 700}) {
    Random random(35);
    const auto x = random.uniforms(n, -0.1, 1.5), g = random.uniforms(n, -1);
    auto a = unwritten<double>(n), b = a, c = a, a1 = a, b1 = a, c1 = a;
    cpu::run(n, LinearToSrgbBody<double>{x.data(), a.data()});
    cpu::run(n, LinearToSrgbBackwardBody<double>{x.data(), g.data(), b.data()});
    cpu::run(n, SrgbToLinearBody<double>{x.data(), c.data()});
    on_gpu(n, LinearToSrgbBody<double>{x.data(), a1.data()});
    on_gpu(n, LinearToSrgbBackwardBody<double>{x.data(), g.data(), b1.data()});
    on_gpu(n, SrgbToLinearBody<double>{x.data(), c1.data()});
    expect_near(a1, a, 1e-14), expect_near(b1, b, 1e-14), expect_near(c1, c, 1e-14);
  }
}

TEST(PointKernels, Interpolation) {
  for (const int64_t n : {0, 1, 300}) {
    Random random(45);
    const int64_t m = 40, channels = 3;
    std::vector<int64_t> first(n), second(n);
    for (int64_t i = 0; i < n; ++i) first[i] = random.below(m + 4) - 2, second[i] = random.below(m);
    const auto share = random.uniforms(n), values = random.uniforms(m * channels),
               g = random.uniforms(n * channels, -1);
    auto out = unwritten<double>(n * channels), out1 = out;
    std::vector<double> grad(m * channels), grad1(grad);
    cpu::run(n * channels, InterpolateBody<double>{m, channels, first.data(), second.data(), share.data(),
                                                   values.data(), out.data()});
    on_gpu(n * channels,
           InterpolateBody<double>{m, channels, first.data(), second.data(), share.data(), values.data(), out1.data()});
    cpu::run(n * channels, InterpolateBackwardBody<double>{m, channels, first.data(), second.data(), share.data(),
                                                           g.data(), grad.data()});
    on_gpu(n * channels, InterpolateBackwardBody<double>{m, channels, first.data(), second.data(), share.data(),
                                                         g.data(), grad1.data()});
    expect_near(out1, out, 1e-15), expect_near(grad1, grad, 1e-13);
  }
}

// ---- where a step looks ----

TEST(PointKernels, DrawnRays) {
  const int64_t last[] = {4, 5, 40}, shift[] = {10, 30, 200};
  for (const int64_t n : {0, 1, 256, 700}) {
    Random random(85);
    const auto u = random.uniforms(n), matrices = random.uniforms(3 * 9, -1), origins = random.uniforms(3 * 3);
    const auto run = [&](const auto& launch) {
      std::pair out{unwritten<double>(6 * n), unwritten<int64_t>(2 * n)};
      double* rays = out.first.data();
      int64_t* numbers = out.second.data();
      launch(DrawRaysBody<double>{n,
                                  n / 3,
                                  {last, shift, 3, 40},
                                  {nullptr, nullptr, 0, 264},
                                  3,
                                  8,
                                  11,
                                  u.data(),
                                  matrices.data(),
                                  origins.data(),
                                  rays,
                                  rays + 3 * n,
                                  numbers,
                                  numbers + n});
      return out;
    };
    const auto a = run([&](const auto& body) { cpu::run(n, body); }),
               b = run([&](const auto& body) { on_gpu(n, body); });
    expect_near(b.first, a.first, 1e-14);
    EXPECT_EQ(b.second, a.second);
  }
}

template <class Code> void compare_read_pixels(int64_t n) {
  Random random(125);
  const int64_t n_pixels = 90, starts[] = {3, 40}, ends[] = {9, 80}, shift[] = {-3, -34};
  std::vector<Code> codes(4 * n_pixels);
  for (Code& code : codes) code = Code(random.below(60000));
  std::vector<uint8_t> behind(3 * 46);
  for (uint8_t& code : behind) code = uint8_t(random.below(256));
  std::vector<int64_t> index(n), view(n);
  for (int64_t i = 0; i < n; ++i) index[i] = random.below(n_pixels + 4) - 2, view[i] = random.below(5) - 1;
  const auto exposures = random.uniforms(9), backgrounds = random.uniforms(3 * n);
  const auto run = [&](const auto& launch) {
    std::pair out{unwritten<double>(10 * n), std::vector<int64_t>(n)};
    const std::unique_ptr<bool[]> whole(new bool[n]);
    double* p = out.first.data();
    launch(ReadPixelsBody<double, Code>{codes.data(),
                                        n_pixels,
                                        3,
                                        {starts, ends, shift, behind.data(), 2, 46},
                                        index.data(),
                                        view.data(),
                                        exposures.data(),
                                        backgrounds.data(),
                                        p,
                                        p + 4 * n,
                                        p + 7 * n,
                                        whole.get()});
    std::copy(whole.get(), whole.get() + n, out.second.begin());
    return out;
  };
  const auto a = run([&](const auto& body) { cpu::run(n, body); }), b = run([&](const auto& body) { on_gpu(n, body); });
  expect_near(b.first, a.first, 0);
  EXPECT_EQ(b.second, a.second);
}

TEST(PointKernels, ReadPixels) {
  for (const int64_t n : {0, 1, 700}) {
    compare_read_pixels<uint8_t>(n);
    compare_read_pixels<int16_t>(n);
    compare_read_pixels<float>(n);
  }
}

TEST(PointKernels, LightQueries) {
  for (const int64_t n : {0, 1, 300})
    for (const bool mean : {false, true}) {
      Random random(115);
      const auto normals = random.directions(n), views = random.directions(n), rho = random.uniforms(n),
                 g = random.uniforms(6 * n, -1), g_rho = random.uniforms(2 * n, -1);
      const auto run = [&](const auto& launch) {
        auto out = unwritten<double>(12 * n);
        double* p = out.data();
        launch(LightQueriesBody<double>{brdf_lut(), mean, n, normals.data(), views.data(), rho.data(), p, p + 6 * n});
        launch(LightQueriesBackwardBody<double>{brdf_lut(), mean, n, normals.data(), views.data(), rho.data(), g.data(),
                                                g_rho.data(), p + 8 * n, p + 11 * n});
        return out;
      };
      const auto a = run([&](const auto& body) { cpu::run(n, body); }),
                 b = run([&](const auto& body) { on_gpu(n, body); });
      expect_near(b, a, 1e-13);
    }
}

}  // namespace
}  // namespace splitnerf
