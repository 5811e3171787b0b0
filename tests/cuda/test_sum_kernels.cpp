// Kernels that add up over items: losses, and the numbers of a step, against the CPU.
#include <numeric>

#include "check.h"
#include "gpu.h"
#include "splitnerf/bodies/light_losses.h"
#include "splitnerf/bodies/step_numbers.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf {
namespace {

// Gradients of several sizes, in items of the GPU's size and of the CPU's; more items than threads that add up.
TEST(SumKernels, StepNumbers) {
  for (const auto& [most, n_rays] :
       std::initializer_list<std::pair<int64_t, int64_t>>{{0, 0}, {1, 1}, {700, 300}, {4097, 1}, {540000, 300}}) {
    Random random(107);
    const std::vector<double> gradients[] = {random.uniforms(most, -1), {}, random.uniforms(7), random.uniforms(1)};
    std::vector<int64_t> evaluated(n_rays);
    for (int64_t& x : evaluated) x = random.below(9);
    const std::vector<double> terms = random.uniforms(3);
    const std::vector<int64_t> counts{5, 70};
    const double s = 60;
    double squares = 0, sum = 0;
    for (const auto& x : gradients)
      for (const double v : x) squares += v * v;
    for (const int64_t x : evaluated) sum += double(x);
    const std::vector<double> expected{terms[0], terms[1], terms[2], std::sqrt(squares), 5, 70, sum, s};
    for (const double limit : {1e6, 70.0}) {
      const std::vector<double> limits(8, limit);
      const auto run = [&](int64_t per_item, const auto& launch) {
        auto numbers = unwritten<double>(8);
        bool allowed = limit < 100;
        StepNumbersBody<double> body;
        body.per_item = per_item;
        for (const auto& x : gradients) body.add_gradient(x.data(), int64_t(x.size()));
        for (const double& x : terms) body.terms[body.n_terms++] = &x;
        for (const int64_t& x : counts) body.counts[body.n_counts++] = &x;
        body.n_evaluated = n_rays, body.evaluated = evaluated.data(), body.s = &s, body.limits = limits.data();
        body.numbers = numbers.data(), body.allowed = &allowed;
        launch(body.count(), body);
        expect_near(numbers, expected, 1e-10);
        EXPECT_EQ(allowed, limit > 100);
      };
      run(4096, [](int64_t n, const auto& body) { cpu::run(n, body); });
      run(4, [](int64_t n, const auto& body) { on_gpu(n, body); });
    }
  }
}

TEST(SumKernels, PixelLosses) {
  for (const int64_t n : {0, 1, 256, 700})
    for (const bool linear : {false, true}) {
      Random random(55);
      const auto mean = random.uniforms(3 * n, 0, 1.5), opacity = random.uniforms(n), target = random.uniforms(4 * n),
                 background = random.uniforms(3 * n), exposure = random.uniforms(3 * n, 0.5, 2);
      const std::unique_ptr<bool[]> whole(new bool[n]);
      for (int64_t i = 0; i < n; ++i) whole[i] = random.below(2) == 1;
      const double grad[] = {1.5, -0.5};
      for (const bool given : {false, true}) {
        const PixelArrays<double> in{n,
                                     mean.data(),
                                     opacity.data(),
                                     target.data(),
                                     background.data(),
                                     given ? exposure.data() : nullptr,
                                     given ? whole.get() : nullptr,
                                     linear};
        const auto run = [&](const auto& launch) {
          std::vector<std::vector<double>> out{unwritten<double>(2), unwritten<double>(3 * n), unwritten<double>(n)};
          launch(PixelLossesBody<double>{in, out[0].data()});
          launch(PixelLossesBackwardBody<double>{in, grad, out[1].data(), out[2].data()});
          return out;
        };
        const auto a = run([&](const auto&body) { cpu::run(n, body); }),
                   b = run([&](const auto&body) { on_gpu(n, body); });
        for (size_t k = 0; k < a.size(); ++k) expect_near(b[k], a[k], 1e-13);
      }
    }
}

// There are at most 512 blocks of 256 threads, so that the last size gives some threads a second item.
TEST(SumKernels, GradientLosses) {
  for (const int64_t m : {0, 1, 256, 700, 512 * 256 + 300}) {
    Random random(65);
    const int64_t n_weights = m + 5, n = n_weights + m;
    const auto gradients = random.uniforms(3 * n, -1), weights = random.uniforms(n_weights);
    std::vector<int64_t> beside(m);
    for (int64_t& i : beside) i = random.below(int(n_weights));
    const GradientArrays<double> in{n, n_weights, m, gradients.data(), weights.data(), beside.data()};
    const double grad[] = {1.5, -0.5};
    const auto run = [&](const auto& launch) {
      std::vector<std::vector<double>> out{unwritten<double>(2), unwritten<double>(1), unwritten<double>(3 * n)};
      launch(n + m, GradientLossesBody<double>{in, out[0].data(), out[1].data()});
      const GradientLossesBackwardBody<double> backward{in, out[1].data(), grad, out[2].data()};
      launch(n, backward);
      launch(m, SamplesOfPairsBackwardBody<double>{backward});
      return out;
    };
    const auto a = run([](int64_t n, const auto& body) { cpu::run(n, body); });
    const auto b = run([](int64_t n, const auto& body) { on_gpu(n, body); });
    for (size_t k = 0; k < a.size(); ++k) expect_near(b[k], a[k], 1e-12);
  }
}

TEST(SumKernels, MaterialLosses) {
  for (const int64_t n : {0, 1, 256, 700})
    for (const bool smooth : {false, true}) {
      Random random(75);
      const auto albedo = random.uniforms(3 * n), metallic = random.uniforms(n), shares = random.uniforms(n);
      const MaterialLossArrays<double> in{albedo.data(), metallic.data(), shares.data(), smooth};
      const double grad[] = {1.5, -0.5, 0.25};
      const auto run = [&](const auto& launch) {
        std::vector<std::vector<double>> out{unwritten<double>(3), unwritten<double>(1), unwritten<double>(n)};
        launch(MaterialLossesBody<double>{in, out[0].data(), out[1].data()});
        launch(MaterialLossesBackwardBody<double>{in, out[1].data(), grad, out[2].data()});
        return out;
      };
      const auto a = run([&](const auto&body) { cpu::run(n, body); }),
                 b = run([&](const auto&body) { on_gpu(n, body); });
      for (size_t k = 0; k < a.size(); ++k) expect_near(b[k], a[k], 1e-13);
    }
}

TEST(SumKernels, LossesOfTheLight) {
  for (const int64_t n : {0, 1, 336, 700}) {
    Random random(145);
    const auto radiance = random.uniforms(3 * n), texels = random.uniforms(3 * n, -1);
    const double grad = 1.5;
    const int64_t first = n / 4 + 1;
    const TexelLevels<double> levels{2, {first, max_of<int64_t>(n - first, 1)}, texels.data()};
    const auto run = [&](const auto& launch) {
      std::vector<std::vector<double>> out{unwritten<double>(1), unwritten<double>(3 * n), unwritten<double>(1),
                                           unwritten<double>(3 * n)};
      launch(LogChromaBody<double>{n, radiance.data(), out[0].data()});
      launch(LogChromaBackwardBody<double>{n, radiance.data(), &grad, out[1].data()});
      launch(LightPriorBody<double>{levels, out[2].data()});
      launch(LightPriorBackwardBody<double>{levels, &grad, out[3].data()});
      return out;
    };
    const auto a = run([&](const auto&body) { cpu::run(n, body); }), b = run([&](const auto&body) { on_gpu(n, body); });
    for (size_t k = 0; k < a.size(); ++k) expect_near(b[k], a[k], 1e-13);
  }
}

TEST(SumKernels, EntropyOfRows) {
  const int64_t n = 700, channels = 3;
  Random random(85);
  const auto rows = random.uniforms(n * (channels + 1), 0.1, 1);
  const auto run = [&](const auto& launch) {
    std::vector<std::vector<double>> out{unwritten<double>(1), unwritten<double>(1), unwritten<double>(n * channels)};
    launch(n, EntropyBody<double>{n, channels, rows.data(), out[0].data(), out[1].data()});
    launch(n * channels, EntropyGradientBody<double>{channels, rows.data(), out[1].data(), out[2].data()});
    return out;
  };
  const auto a = run([](int64_t n, const auto& body) { cpu::run(n, body); });
  const auto b = run([](int64_t n, const auto& body) { on_gpu(n, body); });
  for (size_t k = 0; k < a.size(); ++k) expect_near(b[k], a[k], 1e-13);
}

}  // namespace
}  // namespace splitnerf
