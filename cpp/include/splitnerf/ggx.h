// GGX microfacet terms. ggx_alpha = roughness^2 everywhere (Blender's and glTF's meaning).
#pragma once

#include "splitnerf/vec.h"

namespace splitnerf {

// Below this width the lobe is narrower than one part in 10^8 of the sphere; the floor keeps
// (ggx_alpha / q)^2 finite in float at the centre of the lobe.
inline constexpr double kMinGgxAlpha = 1e-4;

template <class T> SPLITNERF_HD T ggx_alpha_from_roughness(T roughness) {
  return max_of(roughness * roughness, T(kMinGgxAlpha));
}

// sin^2 of the half angle: |a - b|^2 / 4. With n = v = w_r the microfacet normal h halves the
// angle between w_r and w, so this is sin^2(theta_h) of the pre-integration lobe.
template <class T> SPLITNERF_HD T sin2_half_angle(Vec3<T> a, Vec3<T> b) {
  const Vec3<T> d = a - b;
  return T(0.25) * dot(d, d);
}

// D = a^2 / (pi q^2), q = a^2 + (1 - a^2) sin^2(theta_h), in sr^-1.
// Source: Walter et al. 2007, Eq. (33), written in sin^2; SplitNeRF Eq. (11) with a = roughness^2.
template <class T> SPLITNERF_HD T ggx_d(T ggx_alpha, T sin2) {
  const T a2 = ggx_alpha * ggx_alpha;
  const T q = a2 + (T(1) - a2) * sin2;
  return square(ggx_alpha / q) * T(1 / kPi);
}

// Height-correlated Smith masking-shadowing over 4 (n.v)(n.l): f = D V F.
// Source: Heitz 2014, Eq. (99).
template <class T> SPLITNERF_HD T smith_v(T ggx_alpha, T n_dot_v, T n_dot_l) {
  const T a2 = ggx_alpha * ggx_alpha;
  const T shadow_v = n_dot_l * std::sqrt(n_dot_v * n_dot_v * (T(1) - a2) + a2);
  const T shadow_l = n_dot_v * std::sqrt(n_dot_l * n_dot_l * (T(1) - a2) + a2);
  return T(0.5) / max_of(shadow_v + shadow_l, T(1e-20));
}

template <class T> SPLITNERF_HD T pow5(T x) { return x * square(x * x); }

// F = F0 + (1 - F0)(1 - v.h)^5. Source: Schlick 1994.
template <class T> SPLITNERF_HD T schlick(T f0, T v_dot_h) {
  return f0 + (T(1) - f0) * pow5(clamp(T(1) - v_dot_h, T(0), T(1)));
}

// Unpolarised reflectance of a smooth dielectric of refractive index 1.5 (F0 = 0.04), seen from outside: the mean of
// ((g - c) / (g + c))^2 and ((n^2 c - g) / (n^2 c + g))^2 with c = v.h and g^2 = n^2 - 1 + c^2.
// Source: Walter et al. 2007, Eq. (22).
template <class T> SPLITNERF_HD T fresnel_dielectric(T v_dot_h) {
  constexpr double kSquaredIndex = 1.5 * 1.5;
  const T c = clamp(v_dot_h, T(0), T(1)), g = std::sqrt(T(kSquaredIndex - 1) + c * c), across = T(kSquaredIndex) * c;
  const T inverse = T(1) / ((g + c) * (across + g));
  return T(0.5) * (square((g - c) * (across + g) * inverse) + square((across - g) * (g + c) * inverse));
}

}  // namespace splitnerf
