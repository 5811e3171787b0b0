// NeuS volume rendering of a signed distance function, in log space.
#pragma once

#include "splitnerf/group.h"
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
// so tau = log1p(X). For d > 20, where expm1 would overflow, X = exp(d) sigmoid(-x), which is told by f_next in front of the surface
// and by d behind it, where the distances may be so large that f_next has lost d.
// Source: NeuS Eq. (13); the published form adds 1e-5 to both sides of the fraction.
// apart = f_prev - f_next, which callers know more exactly than the rounded difference.
template <class T> SPLITNERF_HD T neus_optical_depth(T f_prev, T f_next, T apart, T s) {
  const T d = s * apart;
  if (!(d > T(0))) return d <= T(0) ? T(0) : d;  // a NaN goes on to the caller
  if (d > T(20))
    return f_prev > T(0) ? softplus(-s * f_next) - softplus(-s * f_prev) : softplus(d - softplus(s * f_prev));
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

// One sample of a ray: the distances at its two ends, and their difference.
template <class T> struct NeusInterval {
  T f_prev, f_next, apart;
};
template <class T> SPLITNERF_HD T neus_optical_depth(const NeusInterval<T>& interval, T s) {
  return neus_optical_depth(interval.f_prev, interval.f_next, interval.apart, s);
}

// The optical depth behind which samples get weight 0.
template <class T> SPLITNERF_HD T neus_depth_limit(T min_transmittance) {
  return min_transmittance > T(0) ? -std::log(min_transmittance) : T(INFINITY);
}

// Weights w_i = T_i alpha_i of the n samples of one ray and its opacity A = sum w = -expm1(-sum tau). at(i) is a NeusInterval.
// Samples behind transmittance < min_transmittance get weight 0. Depths add up in double: thousands of equal ones in float
// would be rounded the same way each time.
template <class T, class Group, class At>
SPLITNERF_HD T neus_ray_weights(const Group& group, const At& at, T s, int64_t n, T min_transmittance, T* weights) {
  const T depth_limit = neus_depth_limit(min_transmittance);
  double depth = 0;  // in front of the group's samples
  for (int64_t first = 0; first < n; first += Group::size) {
    const int64_t i = first + group.lane();
    if (depth > depth_limit) {
      if (i < n) weights[i] = T(0);
      continue;
    }
    const T tau = i < n ? neus_optical_depth(at(i), s) : T(0);
    const double before = depth + group.sum_before(double(tau));
    const bool live = !(before > depth_limit);
    if (i < n) weights[i] = live ? std::exp(-T(before)) * -std::expm1(-tau) : T(0);
    depth += group.sum(live ? double(tau) : 0.0);
  }
  return -std::expm1(-T(depth));
}

// d w_i / d tau_i = T_{i+1};  d w_j / d tau_i = -w_j for j > i;  d A / d tau_i = 1 - A.
// 1 - A is the transmittance of all samples, exp(-sum tau). The loop runs from the last sample to the first, so that
// sum_{j > i} grad_j w_j is a running sum. depths [n] stores the depth behind each sample: subtracting tau again would
// lose the small depths in front of a deep one. Calls keep(i, OpticalDepthGrad) for each sample, after the last use of
// depths[i]; returns the gradient of s.
template <class T, class Group, class At, class Keep>
SPLITNERF_HD T neus_ray_weights_backward(const Group& group, const At& at, T s, int64_t n, T min_transmittance,
                                         const T* weights, const T* grad_weights, T grad_opacity, T* depths,
                                         Keep keep) {
  const T depth_limit = neus_depth_limit(min_transmittance);
  double depth = 0;
  int64_t n_live = 0;  // samples that the forward pass looked at
  for (int64_t first = 0; first < n && !(depth > depth_limit); first += Group::size) {
    const int64_t i = first + group.lane();
    const double tau = i < n ? double(neus_optical_depth(at(i), s)) : 0.0;
    const double before = depth + group.sum_before(tau);
    const bool live = i < n && !(before > depth_limit);
    if (live) depths[i] = T(before + tau);
    depth += group.sum(live ? tau : 0.0);
    n_live += group.sum(live ? 1 : 0);
  }
  for (int64_t i = n_live + group.lane(); i < n; i += Group::size) keep(i, OpticalDepthGrad<T>{T(0), T(0), T(0), T(0)});
  group.sync();
  const T grad_passing = grad_opacity * std::exp(-T(depth));
  double behind = 0, grad_s = 0;
  for (int64_t last = n_live - 1; last >= 0; last -= Group::size) {
    const int64_t i = last - group.lane();
    const double pulled = i >= 0 ? double(grad_weights[i]) * double(weights[i]) : 0.0;
    const double pulled_behind = behind + group.sum_before(pulled);
    behind += group.sum(pulled);
    if (i < 0) continue;
    const T transmittance_after = std::exp(-depths[i]);
    const T grad_tau = grad_weights[i] * transmittance_after - T(pulled_behind) + grad_passing;
    const NeusInterval<T> interval = at(i);
    const OpticalDepthGrad<T> g =
        neus_optical_depth_backward(interval.f_prev, interval.f_next, interval.apart, s, grad_tau);
    keep(i, g);
    grad_s += double(g.s);
  }
  return T(group.sum(grad_s));
}

// ---- from the field at a sample to its normal and its interval --------------------------------

// The direction of the gradient. Below a length of 1e-3 the direction is not reliable, and no gradient flows back.
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

struct SampleRange {
  int64_t first, n;
};
// Samples of many rays in one array, ray after ray. On the GPU the offsets are not checked, since the host would have
// to wait: for any offsets, no access leaves the n_samples samples.
struct PackedRays {
  int64_t n_rays, n_samples;
  const int64_t* offsets;  // [n_rays + 1]

  SPLITNERF_HD SampleRange samples_of(int64_t ray) const {
    const int64_t first = clamp<int64_t>(offsets[ray], 0, n_samples);
    return {first, clamp<int64_t>(offsets[ray + 1], first, n_samples) - first};
  }
  // The samples of one ray.
  SPLITNERF_HD int64_t n_owned() const {
    if (n_rays == 0) return 0;
    const SampleRange last = samples_of(n_rays - 1);
    return last.first + last.n;
  }
  // Calls clear(i) for this ray's share of the padding: the samples behind those of the last ray, which belong to no
  // ray.
  template <class Group, class Clear>
  SPLITNERF_HD void for_each_unowned(const Group& group, int64_t ray, Clear clear) const {
    for (int64_t i = n_owned() + ray * Group::size + group.lane(); i < n_samples; i += n_rays * Group::size) clear(i);
  }
};

// Samples of a surface, given by distance and gradient at their midpoints. The distance is taken as linear over the
// sample's length `step`, with the annealed cosine as its slope.
template <class T> struct SurfaceSamples {
  PackedRays rays;
  const T *sdf, *gradient, *directions;  // [n, stride], of which the first column counts; [n, 3]; [n_rays, 3] unit
  const T *s, *step, *anneal;            // one number each
  T min_transmittance;
  int64_t stride = 1, n_rows = rays.n_samples;  // rows behind the samples are of other points
};

// The distances at both ends of a sample, and their difference; at grazing angles the difference is smaller than the
// rounding errors of the two distances.
template <class T> SPLITNERF_HD NeusInterval<T> surface_interval(T sdf, T cosine, T step, T anneal) {
  const T half = T(0.5) * step * annealed_cosine(cosine, anneal).value;
  return {sdf - half, sdf + half, T(-2) * half};
}
// Gradient to the cosine: f_prev, f_next = sdf -+ half,  half = step / 2 annealed(cosine).
template <class T>
SPLITNERF_HD T surface_interval_backward(const OpticalDepthGrad<T>& grad, T cosine, T step, T anneal) {
  return (grad.f_next - grad.f_prev) * T(0.5) * step * annealed_cosine(cosine, anneal).slope;
}

}  // namespace splitnerf
