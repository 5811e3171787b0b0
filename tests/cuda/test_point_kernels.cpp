// The kernel of a thread an item, and additions of many threads to one number, against the CPU. What else a body of one thread does,
// the same lines do on either device.
#include "check.h"
#include "gpu.h"
#include "splitnerf/bodies/elementwise.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf {
namespace {

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

}  // namespace
}  // namespace splitnerf
