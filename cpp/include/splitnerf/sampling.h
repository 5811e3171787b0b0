// Random numbers, point lattices and direction samplers with their densities.
//
// Directions are local, with the normal (or the lobe's axis) along +z. Uniform inputs u1, u2 lie
// in [0, 1). Densities are per steradian.
#pragma once

#include "splitnerf/ggx.h"
#include "splitnerf/trigonometry.h"
#include "splitnerf/vec.h"
#include "splitnerf/vector_math.h"

namespace splitnerf {

// ---- random numbers and lattices -------------------------------------------------------------

// One step of a 32-bit linear congruential generator followed by PCG's RXS-M-XS output
// permutation: a bijection of 32-bit words with good avalanche.
// Source: O'Neill 2014; Jarzynski and Olano, "Hash Functions for GPU Rendering", JCGT 2020.
SPLITNERF_HD uint32_t hash_u32(uint32_t a) {
  const uint32_t state = a * 747796405u + 2891336453u;
  const uint32_t word = ((state >> ((state >> 28) + 4u)) ^ state) * 277803737u;
  return (word >> 22) ^ word;
}
SPLITNERF_HD uint32_t hash_u32(uint32_t a, uint32_t b) { return hash_u32(a + hash_u32(b)); }
SPLITNERF_HD uint32_t hash_u32(uint32_t a, uint32_t b, uint32_t c) { return hash_u32(a + hash_u32(b, c)); }

// The upper 24 bits of a word as a number in [0, 1): exact in float, so never rounded up to 1.
template <class T> SPLITNERF_HD T unit_from_bits(uint32_t bits) { return T(bits >> 8) * T(1.0 / 16777216.0); }

// Counter-based uniform number in [0, 1): the same three counters always give the same number.
template <class T> SPLITNERF_HD T random_unit(uint32_t a, uint32_t b = 0, uint32_t c = 0) {
  return unit_from_bits<T>(hash_u32(a, b, c));
}

// (a + b) mod 1 of two numbers in [0, 1]; the result stays below 1 after rounding.
template <class T> SPLITNERF_HD T wrap_unit(T a, T b) {
  const T s = a + b;
  return s < T(1) ? s : s - T(1) < T(1) ? s - T(1) : T(0);
}

// frac(i / golden ratio) in 32-bit fixed point (the factor is 2^32 / 1.618...): wrapping integer
// multiplication takes the fractional part without rounding, for every i.
template <class T> SPLITNERF_HD T golden_fraction(uint32_t i) { return unit_from_bits<T>(i * 2654435769u); }

// Point i of the n-point Fibonacci lattice on [0, 1)^2, shifted modulo 1. A uniformly random
// shift makes every point uniform, so that lattice averages are unbiased.
// Source: Cranley and Patterson 1976.
template <class T> SPLITNERF_HD Vec2<T> fibonacci_lattice(uint32_t i, uint32_t n, Vec2<T> shift = {T(0), T(0)}) {
  return {wrap_unit((T(i) + T(0.5)) / T(n), shift.x), wrap_unit(golden_fraction<T>(i), shift.y)};
}

// Point i of the R2 sequence, for an unknown number of points: steps 1/g and 1/g^2 in fixed point,
// g = 1.32471795... the real root of g^3 = g + 1. Source: Roberts 2018.
template <class T> SPLITNERF_HD Vec2<T> r2_lattice(uint32_t i, Vec2<T> shift = {T(0), T(0)}) {
  return {wrap_unit(unit_from_bits<T>(i * 3242174889u), shift.x),
          wrap_unit(unit_from_bits<T>(i * 2447445414u), shift.y)};
}

// ---- the sphere ------------------------------------------------------------------------------

// Unit vector with cosine c = 1 - one_minus_c to +z at azimuth 2 pi u. sin^2 = (1 - c)(1 + c)
// keeps all digits near the pole.
template <class T> SPLITNERF_HD Vec3<T> direction_from_cosine(T one_minus_c, T u) {
  const Vec2<T> azimuth = cos_sin_of_turns(u);
  const T s = std::sqrt(max_of(one_minus_c * (T(2) - one_minus_c), T(0)));
  return {s * azimuth.x, s * azimuth.y, T(1) - one_minus_c};
}

// Uniform on the sphere: z is uniform in [-1, 1] (Archimedes). Density 1 / (4 pi).
template <class T> SPLITNERF_HD Vec3<T> sample_uniform_sphere(T u1, T u2) {
  return direction_from_cosine(T(2) * u1, u2);
}

// Point i of an n-point uniform spherical lattice: the Fibonacci lattice by the area-preserving
// map above. Its points keep about sqrt(4 pi / n) of distance.
template <class T> SPLITNERF_HD Vec3<T> fibonacci_sphere(uint32_t i, uint32_t n) {
  const Vec2<T> u = fibonacci_lattice<T>(i, n);
  return sample_uniform_sphere(u.x, u.y);
}

// ---- cosine lobe -----------------------------------------------------------------------------

// Density c / pi: the CDF of c is c^2, so c = sqrt(1 - u1), 1 - c = u1 / (1 + c).
template <class T> SPLITNERF_HD Vec3<T> sample_cosine_hemisphere(T u1, T u2) {
  return direction_from_cosine(u1 / (T(1) + std::sqrt(T(1) - u1)), u2);
}
template <class T> SPLITNERF_HD T pdf_cosine_hemisphere(T cosine) { return max_of(cosine, T(0)) * T(1 / kPi); }

// ---- the pre-integration lobe D (w.z)+ -------------------------------------------------------
//
// With n = v = w_r = z the microfacet normal halves the angle: sin^2(theta_h) = (1 - c)/2, so
//   D = a^2 / (pi q^2),  q = a^2 + B (1 - c),  B = (1 - a^2)/2,  c = w.z in [0, 1].
// Let y = B c / q, which grows with c from 0 to y1 = B / a^2. Integrating c / q^2 by q gives
//   int_0^c c' / q^2 dc' = (y - log1p y) / B^2,
// so the CDF is h(y) / h(y1), h(y) = y - log1p y, and int D c dw = 2 a^2 h(y1) / B^2 over the
// hemisphere. Sampling solves h(y) = u h(y1). From y: 1 - c = (y1 - y) / (y1 (1 + y)).
// For B -> 0 (a -> 1) the lobe is the cosine lobe; below B = 1e-3 it is taken as such.

inline constexpr double kCosineLobeLimit = 1e-3;

// y - log(1 + y) for y >= 0; the difference cancels for small y, where the series
// y^2/2 - y^3/3 + y^4/4 - ... serves instead (twelve terms leave 1e-13 at y = 0.1).
template <int K, class T> SPLITNERF_HD T log1p_tail(T y) {
  if constexpr (K == 13) {
    return T(1) / T(K);
  } else {
    return T(1) / T(K) - y * log1p_tail<K + 1>(y);
  }
}
template <class T> SPLITNERF_HD T y_minus_log1p(T y) {
  return y < T(0.1) ? y * y * log1p_tail<2>(y) : y - log1p_of_positive(y);
}

// Solves y - log(1 + y) = t for y >= 0. sqrt(2 t) + t is an upper bound of the solution
// (Chatzigeorgiou 2013, Eq. (1), with y = -W_{-1}(-e^{-1-t}) - 1); the function is convex and
// increasing, so Newton's steps (y - h(y) ...) (1 + y)/y fall monotonically onto it.
template <class T> SPLITNERF_HD T invert_y_minus_log1p(T t) {
  const T bound = std::sqrt(T(2) * t) + t;
  T y = max_of(bound, T(1e-12));
  SPLITNERF_UNROLL
  for (int step = 0; step < 4; ++step) y = max_of(y - (y_minus_log1p(y) - t) * (T(1) + y) / y, T(1e-12));
  if constexpr (sizeof(T) > sizeof(float)) {
    for (int step = 0; step < 2; ++step) y = max_of(y - (y_minus_log1p(y) - t) * (T(1) + y) / y, T(1e-12));
  }
  return bound < T(1e-12) ? bound : y;
}

// y1 of a lobe, or 0 where it is taken as the cosine lobe.
template <class T> SPLITNERF_HD T ggx_lobe_edge(T ggx_alpha) {
  const T a2 = ggx_alpha * ggx_alpha, b = T(0.5) * (T(1) - a2);
  return b < T(kCosineLobeLimit) ? T(0) : b / a2;
}
template <class T> SPLITNERF_HD Vec3<T> sample_ggx_lobe_of_edge(T u1, T u2, T y1) {
  const T y = min_of(invert_y_minus_log1p((T(1) - u1) * y_minus_log1p(y1)), y1);
  return direction_from_cosine((y1 - y) / (y1 * (T(1) + y)), u2);
}
template <class T> SPLITNERF_HD Vec3<T> sample_ggx_lobe(T u1, T u2, T ggx_alpha) {
  const T y1 = ggx_lobe_edge(ggx_alpha);
  return y1 > T(0) ? sample_ggx_lobe_of_edge(u1, u2, y1) : sample_cosine_hemisphere(u1, u2);
}

// ---- visible normals -------------------------------------------------------------------------
//
// Microfacet normals seen from v, density G1(v) (v.h)+ D(h) / v.z. Stretching by the roughness
// turns GGX into a hemisphere, whose reflections of a fixed view fill a spherical cap uniformly.
// Source: Heitz 2018 (the distribution); Dupuy and Benyoub 2023 (the cap).

// A visible microfacet normal h for the unit view direction v, v.z > 0.
template <class T> SPLITNERF_HD Vec3<T> sample_ggx_vndf(Vec3<T> v, T u1, T u2, T ggx_alpha) {
  const Vec3<T> stretched = normalize(Vec3<T>{ggx_alpha * v.x, ggx_alpha * v.y, v.z});
  // z uniform in (-stretched.z, 1], written as 1 - z = u1 (1 + stretched.z).
  const Vec3<T> h = direction_from_cosine(u1 * (T(1) + stretched.z), u2) + stretched;
  return normalize(Vec3<T>{ggx_alpha * h.x, ggx_alpha * h.y, max_of(h.z, T(0))});
}

// Density of l = reflect(v, h), h from sample_ggx_vndf: the Jacobian dh/dl = 1 / (4 v.h) leaves
// G1(v) D(h) / (4 v.z), with Smith's G1(v) = 2 v.z / (v.z + sqrt(a^2 + (1 - a^2) v.z^2)).
template <class T> SPLITNERF_HD T pdf_ggx_vndf(Vec3<T> v, Vec3<T> h, T ggx_alpha) {
  const T a2 = ggx_alpha * ggx_alpha;
  const T d = ggx_d(ggx_alpha, h.x * h.x + h.y * h.y);
  return d / (T(2) * (v.z + std::sqrt(a2 + (T(1) - a2) * v.z * v.z)));
}

}  // namespace splitnerf
