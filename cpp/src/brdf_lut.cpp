#include <algorithm>
#include <array>

#include "splitnerf/parallel.h"
#include "splitnerf/sampling.h"
#include "splitnerf/split_sum.h"

namespace splitnerf {

// The lobe integral  E = int f(l) (n.l) dl  by sampling the microfacet normal h ~ D(h)(n.h):
//   pdf(l) = D (n.h) / (4 v.h),  f = D V F   =>   E = mean of  4 V F (n.l)(v.h) / (n.h).
// h: cos^2(theta_h) = (1 - u) / (1 + (a^2 - 1) u), over a Fibonacci lattice in (u, phi), phi in [0, pi] by
// symmetry. u = x^2 (3 - 2 x) crowds the points at both ends, where grazing lobes change fastest; each
// point counts at phi and at pi - phi, so that m_t vanishes without noise where it must, at n.v = 1.
// The mean direction m = int l f (n.l) dl / E has a tangential part m_t along that of the
// reflection r = (s, c) and a normal part m_n. (1 - chi) n + chi r is parallel to m for
//   chi = m_t / (s m_n + m_t (1 - c)).
LobeIntegrals integrate_brdf(double n_dot_v, double roughness, int n_points) {
  const double a = ggx_alpha_from_roughness(roughness), a2 = a * a;
  const double nv = std::clamp(n_dot_v, kMinNdotV, 1.0 - 1e-6);  // chi is 0/0 at n.v = 1; its limit is not
  const double sin_v = std::sqrt(1 - nv * nv);
  const Vec3<double> v{sin_v, 0, nv};
  double f1 = 0, f2 = 0, dielectric = 0, m_t = 0, m_n = 0;
  for (int i = 0; i < n_points; ++i) {
    const Vec2<double> point = fibonacci_lattice<double>(i, n_points);
    const double x = point.x, u = x * x * (3 - 2 * x), weight_u = 6 * x * (1 - x);
    const double cos_h = std::sqrt((1 - u) / (1 + (a2 - 1) * u)), sin_h = std::sqrt(std::max(0.0, 1 - cos_h * cos_h));
    const double cos_phi = std::cos(kPi * point.y), sin_phi = std::sin(kPi * point.y);
    for (double mirrored : {cos_phi, -cos_phi}) {
      const Vec3<double> h{sin_h * mirrored, sin_h * sin_phi, cos_h};
      const double vh = dot(v, h);
      if (vh <= 0) continue;
      const Vec3<double> l = h * (2 * vh) - v;
      if (l.z <= 0) continue;
      const double w = weight_u * 4 * smith_v(a, nv, l.z) * l.z * vh / cos_h, fc = pow5(1 - vh);
      f1 += w * (1 - fc);
      f2 += w * fc;
      dielectric += w * fresnel_dielectric(vh);
      m_t -= w * l.x;  // the reflection leans to -x
      m_n += w * l.z;
    }
  }
  const double scale = 0.5 / n_points;
  const double chi = roughness == 0 ? 1.0 : m_t / (sin_v * m_n + m_t * (1 - nv));
  return {f1 * scale, f2 * scale, std::clamp(chi, 0.0, 1.0), dielectric * scale};
}

namespace {

constexpr int kTablePoints = 4096;  // of each entry; error below 1e-3, see test_split_sum.cpp

using Table = std::array<float, kLutSize * kLutSize * kLutChannels>;

const Table& table() {
  static const Table computed = [] {
    Table t;
    parallel_for(kLutSize, 1, [&](int64_t begin, int64_t end) {
      for (int64_t row = begin; row < end; ++row)
        for (int col = 0; col < kLutSize; ++col) {
          const double root = double(col) / (kLutSize - 1), roughness = double(row) / (kLutSize - 1);
          const LobeIntegrals entry = integrate_brdf(root * root, roughness, kTablePoints);
          float* texel = &t[(row * kLutSize + col) * kLutChannels];
          texel[0] = static_cast<float>(entry.f1);
          texel[1] = static_cast<float>(entry.f2);
          texel[2] = static_cast<float>(entry.chi);
          texel[3] = static_cast<float>(entry.dielectric);
        }
    });
    return t;
  }();
  return computed;
}

}  // namespace

const float* brdf_lut() { return table().data(); }

}  // namespace splitnerf
