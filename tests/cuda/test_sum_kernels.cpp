// Kernels that add up over items, the losses, against the CPU.
#include <numeric>

#include "check.h"
#include "gpu.h"
#include "splitnerf/bodies/light_losses.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf {
namespace {

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
        const auto a = run([&](const auto& body) { cpu::run(n, body); }),
                   b = run([&](const auto& body) { on_gpu(n, body); });
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

TEST(SumKernels, LossesOfTheLight) {
  for (const int64_t n : {0, 1, 336, 700}) {
    Random random(145);
    const auto texels = random.uniforms(3 * n, -1);
    const double grad = 1.5;
    const int64_t first = n / 4 + 1;
    const TexelLevels<double> levels{2, {first, max_of<int64_t>(n - first, 1)}, texels.data()};
    const auto run = [&](const auto& launch) {
      std::vector<std::vector<double>> out{unwritten<double>(1), unwritten<double>(3 * n)};
      launch(LightPriorBody<double>{levels, out[0].data()});
      launch(LightPriorBackwardBody<double>{levels, &grad, out[1].data()});
      return out;
    };
    const auto a = run([&](const auto& body) { cpu::run(n, body); }),
               b = run([&](const auto& body) { on_gpu(n, body); });
    for (size_t k = 0; k < a.size(); ++k) expect_near(b[k], a[k], 1e-13);
  }
}

// Also of more items than threads that add up.
TEST(SumKernels, EntropyOfRows) {
  for (const auto& [n, channels] : std::initializer_list<std::pair<int64_t, int64_t>>{{1, 3}, {700, 3}, {135000, 1}}) {
    Random random(85);
    const auto rows = random.uniforms(n * (channels + 1), 0.1, 1);
    const auto run = [&, n = n, channels = channels](const auto& launch) {
      std::vector<std::vector<double>> out{unwritten<double>(1), unwritten<double>(1), unwritten<double>(n * channels)};
      launch(n, EntropyBody<double>{n, channels, rows.data(), out[0].data(), out[1].data()});
      launch(n * channels, EntropyGradientBody<double>{channels, rows.data(), out[1].data(), out[2].data()});
      return out;
    };
    const auto a = run([](int64_t n, const auto& body) { cpu::run(n, body); });
    const auto b = run([](int64_t n, const auto& body) { on_gpu(n, body); });
    for (size_t k = 0; k < a.size(); ++k) expect_near(b[k], a[k], 1e-13 * double(n));
  }
}

}  // namespace
}  // namespace splitnerf
