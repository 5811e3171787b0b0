// NeuS volume rendering of a signed distance function, in log space.
#pragma once

#include "splitnerf/vec.h"

namespace splitnerf {

template <class T> SPLITNERF_HD T sigmoid(T x) {
  const T e = std::exp(-std::abs(x));
  return x >= T(0) ? T(1) / (T(1) + e) : e / (T(1) + e);
}
template <class T> SPLITNERF_HD T softplus(T x) { return max_of(x, T(0)) + std::log1p(std::exp(-std::abs(x))); }

// Optical depth of one interval, tau = -log(1 - alpha), alpha = (Phi(f_prev) - Phi(f_next))+ / Phi(f_prev),
// Phi(f) = sigmoid(s f). In terms of d = s (f_prev - f_next)+ and x = s f_prev,
//   1 - alpha = Phi(f_next) / Phi(f_prev) = 1 / (1 + X),   X = expm1(d) sigmoid(-x),
// so tau = log1p(X); for d > 20, where expm1 would overflow, tau = softplus(-s f_next) - softplus(-x).
// Source: NeuS Eq. (13); the published form adds 1e-5 to both sides of the fraction.
// apart = f_prev - f_next comes on its own: who knows it better than the rounded difference says so.
template <class T> SPLITNERF_HD T neus_optical_depth(T f_prev, T f_next, T apart, T s) {
  const T d = s * apart;
  if (!(d > T(0))) return d <= T(0) ? T(0) : d;  // a NaN goes on to the caller
  if (d > T(20)) return max_of(softplus(-s * f_next) - softplus(-s * f_prev), T(0));
  return std::log1p(std::expm1(d) * sigmoid(-s * f_prev));
}

template <class T> struct OpticalDepthGrad {
  T f_prev, f_next, s;
  T both;  // to f_prev and f_next moved together: the sum of their gradients, which nearly cancel
};
// tau = softplus(-s f_next) - softplus(-s f_prev) where f_prev > f_next, else 0. With p = sigmoid(-s f_prev) and
// n = sigmoid(-s f_next), n - p = (1 - p) n (1 - exp(-d)) keeps its digits where both are close to 1.
template <class T>
SPLITNERF_HD OpticalDepthGrad<T> neus_optical_depth_backward(T f_prev, T f_next, T apart, T s, T grad_tau) {
  if (apart <= T(0)) return {T(0), T(0), T(0), T(0)};
  const T p = sigmoid(-s * f_prev), n = sigmoid(-s * f_next);
  const T rise = sigmoid(s * f_prev) * n * -std::expm1(-s * apart);
  return {grad_tau * s * p, -grad_tau * s * n, grad_tau * (apart * p - f_next * rise), -grad_tau * s * rise};
}

// What an interval falls by: apart[i], or without it the difference of its ends.
template <class T> SPLITNERF_HD T fall(const T* f_prev, const T* f_next, const T* apart, int64_t i) {
  return apart ? apart[i] : f_prev[i] - f_next[i];
}

// Weights w_i = T_i alpha_i of the samples of one ray and its opacity A = sum w = -expm1(-sum tau).
// Samples behind transmittance < min_transmittance get weight 0. Depths add up in double: thousands of equal ones in float
// would be rounded the same way each time.
template <class T>
SPLITNERF_HD T neus_ray_weights(const T* f_prev, const T* f_next, const T* apart, T s, int64_t n, T min_transmittance,
                                T* weights) {
  double depth = 0;
  const T depth_limit = min_transmittance > T(0) ? -std::log(min_transmittance) : T(INFINITY);
  for (int64_t i = 0; i < n; ++i) {
    if (depth > depth_limit) {
      weights[i] = T(0);
      continue;
    }
    const T tau = neus_optical_depth(f_prev[i], f_next[i], fall(f_prev, f_next, apart, i), s);
    weights[i] = std::exp(-T(depth)) * -std::expm1(-tau);
    depth += double(tau);
  }
  return -std::expm1(-T(depth));
}

// d w_i / d tau_i = T_{i+1};  d w_j / d tau_i = -w_j for j > i;  d A / d tau_i = 1 - A.
// 1 - A is what passes all samples, exp(-sum tau). Walks from the last sample to the first, so that sum_{j > i} grad_j w_j is a running sum. The depth
// behind each sample waits in depths [n] until then: subtracting tau again would lose the small depths in
// front of a deep one. Calls keep(i, OpticalDepthGrad) for each sample, after the last use of depths[i]; returns the
// gradient to s.
template <class T, class Keep>
SPLITNERF_HD T neus_ray_weights_backward(const T* f_prev, const T* f_next, const T* apart, T s, int64_t n,
                                         T min_transmittance, const T* weights, const T* grad_weights, T grad_opacity,
                                         T* depths, Keep keep) {
  const T depth_limit = min_transmittance > T(0) ? -std::log(min_transmittance) : T(INFINITY);
  double depth = 0;
  int64_t n_live = 0;  // samples that the forward pass looked at
  for (; n_live < n && !(depth > depth_limit); ++n_live)
    depths[n_live] =
        T(depth += double(neus_optical_depth(f_prev[n_live], f_next[n_live], fall(f_prev, f_next, apart, n_live), s)));
  for (int64_t i = n_live; i < n; ++i) keep(i, OpticalDepthGrad<T>{T(0), T(0), T(0), T(0)});
  const T grad_passing = grad_opacity * std::exp(-T(depth));
  double behind = 0, grad_s = 0;
  for (int64_t i = n_live - 1; i >= 0; --i) {
    const T transmittance_after = std::exp(-depths[i]);
    const T grad_tau = grad_weights[i] * transmittance_after - T(behind) + grad_passing;
    behind += double(grad_weights[i]) * double(weights[i]);
    const OpticalDepthGrad<T> g =
        neus_optical_depth_backward(f_prev[i], f_next[i], fall(f_prev, f_next, apart, i), s, grad_tau);
    keep(i, g);
    grad_s += double(g.s);
  }
  return T(grad_s);
}

// ---- from the field at a sample to its normal and its interval --------------------------------

// The gradient's direction; below a length of 1e-3 it has none to speak of, and no gradient flows back.
inline constexpr double kMinGradientSquared = 1e-6;
template <class T> SPLITNERF_HD Vec3<T> unit_normal(Vec3<T> gradient) {
  return gradient * (T(1) / std::sqrt(dot(gradient, gradient) + T(1e-12)));
}
template <class T> SPLITNERF_HD Vec3<T> unit_normal_backward(Vec3<T> gradient, Vec3<T> grad) {
  const T squared = dot(gradient, gradient), inverse = T(1) / std::sqrt(squared + T(1e-12));
  if (squared < T(kMinGradientSquared)) return {T(0), T(0), T(0)};
  return (grad - gradient * (dot(gradient, grad) * inverse * inverse)) * inverse;
}

// Slope of the distance along the ray, never positive: relu(-c), or, while t < 1, in part relu(1/2 - c/2), so that
// samples that face away keep a gradient early on.        Source: NeuS, the released code's cos_anneal_ratio.
template <class T> struct AnnealedCosine {
  T value, slope;
};
template <class T> SPLITNERF_HD AnnealedCosine<T> annealed_cosine(T cosine, T t) {
  const T soft = T(0.5) - T(0.5) * cosine;  // a NaN goes on to the caller
  return {-((soft < T(0) ? T(0) : soft) * (T(1) - t) + (cosine > T(0) ? T(0) : -cosine) * t),
          (soft > T(0) ? T(0.5) : T(0)) * (T(1) - t) + (cosine < T(0) ? t : T(0))};
}

}  // namespace splitnerf
