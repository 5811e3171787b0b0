// Real spherical harmonics up to kShDegree, and their sums under a zonal kernel.
//
// Coefficient l^2 + l + m belongs to Y_lm; m > 0 goes with cos(m phi), m < 0 with sin(|m| phi):
//   Y_lm = P_lm(z) c_m,  c_m + i s_m = (x + i y)^m,
// P_lm fully normalised, its sin^m(theta) taken by c_m and s_m and sqrt(2) by P_mm for m > 0.
// Every function is a polynomial of (x, y, z). V is a number or a GCC vector of numbers T.
// Source: Sloan, "Efficient Spherical Harmonic Evaluation", JCGT 2013.
#pragma once

#include <cmath>

#include "splitnerf/vec.h"

namespace splitnerf {

inline constexpr int kShDegree = 12, kShBands = kShDegree + 1, kShCoefficients = kShBands * kShBands;
inline constexpr double kShConstant = 0.28209479177387814347;  // Y_00 = 1 / sqrt(4 pi)

// P_{l+1,m} = raise[l][m] z P_lm - lower[l][m] P_{l-1,m}; P_mm = diagonal[m].
template <class T> struct ShRecurrence {
  T diagonal[kShBands], raise[kShBands][kShBands], lower[kShBands][kShBands];
};

template <class T> SPLITNERF_API const ShRecurrence<T>& sh_recurrence();  // cpp/src/light_tables.cpp

SPLITNERF_HD int sh_index(int l, int m) { return l * l + l + m; }

// out[c] = sum_lm zonal[l] sh[l, m, c] Y_lm(x, y, z), overwritten.
template <class V, class T>
SPLITNERF_HD void sh_evaluate(const ShRecurrence<T>& r, const T* sh, const V* zonal, const V& x, const V& y, const V& z,
                              V* out) {
  V c = V{} + T(1), s = V{};
  for (int k = 0; k < 3; ++k) out[k] = V{};
  for (int m = 0; m <= kShDegree; ++m) {
    V before = V{}, p = V{} + r.diagonal[m], with_c[3] = {}, with_s[3] = {};
    for (int l = m; l <= kShDegree; ++l) {
      const V w = p * zonal[l];
      const T *pc = sh + 3 * sh_index(l, m), *ps = sh + 3 * sh_index(l, -m);
      for (int k = 0; k < 3; ++k) with_c[k] += w * pc[k], with_s[k] += w * ps[k];
      const V next = z * p * r.raise[l][m] - before * r.lower[l][m];
      before = p, p = next;
    }
    for (int k = 0; k < 3; ++k) out[k] += c * with_c[k] + s * with_s[k];
    const V turned = c * x - s * y;
    s = s * x + c * y, c = turned;
  }
}

// Receives the gradient to the coefficients: coefficient i gets basis grad[k] in channel k.
template <class V> struct ShGradSum {
  V* sums;  // [kShCoefficients, 3]

  SPLITNERF_HD void add(int i, const V& basis, const V* grad) const {
    for (int k = 0; k < 3; ++k) sums[3 * i + k] += basis * grad[k];
  }
};

// Adjoint of sh_evaluate for grad[3]: hands the gradient to sh to `to_sh`, overwrites the others.
template <class V, class T, class Receiver>
SPLITNERF_HD void sh_evaluate_backward(const ShRecurrence<T>& r, const T* sh, const V* zonal, const V& x, const V& y,
                                       const V& z, const V* grad, const Receiver& to_sh, V* grad_zonal, V* grad_xyz) {
  V c = V{} + T(1), s = V{}, c_before = V{}, s_before = V{};
  for (int l = 0; l <= kShDegree; ++l) grad_zonal[l] = V{};
  for (int k = 0; k < 3; ++k) grad_xyz[k] = V{};
  for (int m = 0; m <= kShDegree; ++m) {
    V before = V{}, p = V{} + r.diagonal[m], slope_before = V{}, slope = V{}, grad_c = V{}, grad_s = V{};
    for (int l = m; l <= kShDegree; ++l) {
      const T *pc = sh + 3 * sh_index(l, m), *ps = sh + 3 * sh_index(l, -m);
      const V w = p * zonal[l], wc = w * c, ws = w * s;
      to_sh.add(sh_index(l, m), wc, grad);
      if (m > 0) to_sh.add(sh_index(l, -m), ws, grad);
      V to_c = V{}, to_s = V{};
      for (int k = 0; k < 3; ++k) {
        to_c += grad[k] * pc[k];
        if (m > 0) to_s += grad[k] * ps[k];
      }
      grad_c += w * to_c, grad_s += w * to_s;
      const V both = c * to_c + s * to_s;
      grad_zonal[l] += p * both;
      grad_xyz[2] += slope * zonal[l] * both;
      const V next = z * p * r.raise[l][m] - before * r.lower[l][m];
      const V next_slope = (p + z * slope) * r.raise[l][m] - slope_before * r.lower[l][m];
      before = p, p = next, slope_before = slope, slope = next_slope;
    }
    // c_m + i s_m = (x + i y)^m
    grad_xyz[0] += (grad_c * c_before + grad_s * s_before) * T(m);
    grad_xyz[1] += (grad_s * c_before - grad_c * s_before) * T(m);
    c_before = c, s_before = s;
    c = c_before * x - s_before * y, s = s_before * x + c_before * y;
  }
}

}  // namespace splitnerf
