#include <algorithm>
#include <array>

#include "splitnerf/parallel.h"
#include "splitnerf/split_sum.h"

namespace splitnerf {
namespace {

constexpr int kTableU = 192, kTablePhi = 48;  // F1 within 1e-3 of a 2000 x 1000 rule
constexpr double kGoldenRatio = 0.6180339887498949;

}  // namespace

// The lobe integral  E = int f(l) (n.l) dl  by sampling the microfacet normal h ~ D(h)(n.h):
//   pdf(l) = D (n.h) / (4 v.h),  f = D V F   =>   E = mean of  4 V F (n.l)(v.h) / (n.h).
// h: cos^2(theta_h) = (1 - u) / (1 + (a^2 - 1) u). Midpoints in u; phi in [0, pi] by symmetry, each
// row of it shifted by the golden ratio so that the edge n.l = 0 is not met at the same phases.
// The mean direction m = int l f (n.l) dl / E has a tangential part m_t along that of the
// reflection r = (s, c) and a normal part m_n. (1 - chi) n + chi r is parallel to m for
//   chi = m_t / (s m_n + m_t (1 - c)).
Vec3<double> integrate_brdf(double n_dot_v, double roughness, int n_u, int n_phi) {
  const double a = ggx_alpha_from_roughness(roughness), a2 = a * a;
  const double nv = std::clamp(n_dot_v, kMinNdotV, 1.0 - 1e-6);  // chi is 0/0 at n.v = 1; its limit is not
  const double sin_v = std::sqrt(1 - nv * nv);
  const Vec3<double> v{sin_v, 0, nv};
  double f1 = 0, f2 = 0, m_t = 0, m_n = 0;
  for (int i = 0; i < n_u; ++i) {
    // u = x^2 (3 - 2 x) crowds the midpoints at both ends, where grazing lobes change fastest.
    const double x = (i + 0.5) / n_u, u = x * x * (3 - 2 * x), weight_u = 6 * x * (1 - x);
    const double cos_h = std::sqrt((1 - u) / (1 + (a2 - 1) * u)), sin_h = std::sqrt(std::max(0.0, 1 - cos_h * cos_h));
    for (int j = 0; j < n_phi; ++j) {
      const double shifted = (j + 0.5) / n_phi + kGoldenRatio * i, phi = kPi * (shifted - std::floor(shifted));
      const Vec3<double> h{sin_h * std::cos(phi), sin_h * std::sin(phi), cos_h};
      const double vh = dot(v, h);
      if (vh <= 0) continue;
      const Vec3<double> l = h * (2 * vh) - v;
      if (l.z <= 0) continue;
      const double w = weight_u * 4 * smith_v(a, nv, l.z) * l.z * vh / cos_h, fc = pow5(1 - vh);
      f1 += w * (1 - fc);
      f2 += w * fc;
      m_t -= w * l.x;  // the reflection leans to -x
      m_n += w * l.z;
    }
  }
  const double scale = 1.0 / (double(n_u) * n_phi);
  const double chi = roughness == 0 ? 1.0 : m_t / (sin_v * m_n + m_t * (1 - nv));
  return {f1 * scale, f2 * scale, std::clamp(chi, 0.0, 1.0)};
}

const float* brdf_lut() {
  static const std::array<float, kLutSize * kLutSize * 3> table = [] {
    std::array<float, kLutSize * kLutSize * 3> values;
    parallel_for(kLutSize, 1, [&](int64_t begin, int64_t end) {
      for (int64_t row = begin; row < end; ++row)
        for (int col = 0; col < kLutSize; ++col) {
          const double root = double(col) / (kLutSize - 1), roughness = double(row) / (kLutSize - 1);
          const Vec3<double> entry = integrate_brdf(root * root, roughness, kTableU, kTablePhi);
          for (int c = 0; c < 3; ++c) values[(row * kLutSize + col) * 3 + c] = static_cast<float>(entry[c]);
        }
    });
    return values;
  }();
  return table.data();
}

}  // namespace splitnerf
