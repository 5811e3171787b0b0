// GGX against long double, and its normalisation.
#include "splitnerf/ggx.h"

#include "check.h"
#include "splitnerf/sampling.h"

namespace splitnerf {
namespace {

using Wide = long double;

Vec3<Wide> widen(Vec3<float> v) {
  const Wide x = v.x, y = v.y, z = v.z, inv = 1 / std::sqrt(x * x + y * y + z * z);
  return {x * inv, y * inv, z * inv};
}

Wide reference_d(Wide ggx_alpha, Wide sin2) {
  const Wide a2 = ggx_alpha * ggx_alpha, q = a2 + (1 - a2) * sin2;
  return a2 / (Wide(kPi) * q * q);
}

TEST(Ggx, DFollowsLongDoubleDownToNarrowLobes) {
  double worst = 0;
  for (uint32_t i = 0; i < 64; ++i) {
    const Vec3<float> n = fibonacci_sphere<float>(i, 64);
    for (int k = 0; k < 200; ++k) {
      const float angle = k == 0 ? 0.f : 1e-5f * std::pow(10.f, 5.19f * k / 199), phi = 2.399963f * k;
      const Vec3<float> local{std::sin(angle) * std::cos(phi), std::sin(angle) * std::sin(phi), std::cos(angle)};
      const Vec3<float> h = Frame<float>(n).to_world(local);
      const Vec3<Wide> a = widen(h), b = widen(n), c = cross(a, b), d = a - b;
      for (const float ggx_alpha : {1e-3f, 3e-3f, 0.01f, 0.1f, 0.5f, 0.9f, 1.f}) {
        // of the very vectors: the angle itself, and half of it as the lobe of the pre-integration has it
        const Wide errors[] = {ggx_d(ggx_alpha, float(dot(c, c))) / reference_d(ggx_alpha, dot(c, c)) - 1,
                               ggx_d(ggx_alpha, sin2_half_angle(h, n)) / reference_d(ggx_alpha, dot(d, d) / 4) - 1};
        const double error = double(std::max(std::abs(errors[0]), std::abs(errors[1])));
        worst = std::max(worst, error);
        ASSERT_LT(error, 1e-6) << "ggx_alpha " << ggx_alpha << ", angle " << angle << ", normal " << i;
      }
    }
  }
  RecordProperty("worst_relative_error", std::to_string(worst));
}

// int D (n.h) dh = pi int_0^1 D(s) ds with s = sin^2; s = x^4 resolves the narrow lobes.
TEST(Ggx, DIntegratesToOne) {
  for (const double ggx_alpha : {kMinGgxAlpha, 1e-3, 0.01, 0.1, 0.5, 1.0}) {
    const int n = 200000;
    double total = 0;
    for (int i = 0; i < n; ++i) {
      const double x = (i + 0.5) / n;
      total += kPi * ggx_d(ggx_alpha, x * x * x * x) * 4 * x * x * x / n;
    }
    EXPECT_NEAR(total, 1, 1e-6) << ggx_alpha;
  }
}

}  // namespace
}  // namespace splitnerf
