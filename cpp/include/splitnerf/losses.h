// Terms of the training loss, each with its gradient: of pixels and of the field's gradients.
#pragma once

#include "splitnerf/neus.h"
#include "splitnerf/srgb.h"
#include "splitnerf/vec.h"

namespace splitnerf {

// ---- pixels ----------------------------------------------------------------------------------

inline constexpr double kSaturated = 254.0 / 255.0;  // of a photo's channel: the truth is at least as bright
inline constexpr double kLeastOpacity = 1e-3;        // in the mask's logarithms
inline constexpr double kMaskOfWhole = 0.1;          // what the mask of a whole pixel counts

// Squared error of a pixel against the photo, both over one background, summed over the channels, and the cross entropy of
// its opacity against the mask, with their gradients. Where the photo is saturated the colour is clipped like it.
//   C = b + o (c - b),  c = sRGB(mean)                   Source: SplitNeRF Eq. (3); the mask: NeuS Eq. (17).
// A whole pixel's photo is what the camera saw, object and background together, whose light it added up; the background is
// what it would have seen without the object:
//   C = sRGB(B + o (mean - B)),  sRGB(B) = b
template <class T> struct PixelLosses {
  T colour, mask;
  Vec3<T> colour_by_mean;
  T colour_by_opacity, mask_by_opacity;
};
template <class T>
SPLITNERF_HD PixelLosses<T> pixel_losses(Vec3<T> mean, T opacity, const T* target, Vec3<T> background, bool whole,
                                         bool linear) {
  PixelLosses<T> out{};
  for (int k = 0; k < 3; ++k) {
    const bool mixed = whole && linear;  // object and background before the curve, else behind it
    const T b = mixed ? linear_from_srgb(background[k]) : background[k],
            x = mixed ? lerp(b, mean[k], opacity) : mean[k];
    ValueAndSlope<T> c = linear ? srgb_from_linear(x) : ValueAndSlope<T>{x, T(1)};
    if (target[k] >= T(kSaturated) && c.value > T(1)) c = {T(1), T(0)};
    const T error = (mixed ? c.value : lerp(b, c.value, opacity)) - (whole ? target[k] : lerp(b, target[k], target[3]));
    out.colour += square(error);
    out.colour_by_mean[k] = T(2) * error * opacity * c.slope;
    out.colour_by_opacity += T(2) * error * (mixed ? c.slope * (mean[k] - b) : c.value - b);
  }
  const T o = clamp(opacity, T(kLeastOpacity), T(1) - T(kLeastOpacity)), a = target[3];
  const T weight = whole ? T(kMaskOfWhole) : T(1);
  out.mask = -weight * (a * std::log(o) + (T(1) - a) * std::log1p(-o));
  out.mask_by_opacity = o == opacity ? weight * (o - a) / (o * (T(1) - o)) : T(0);
  return out;
}

// ---- gradients of the field ------------------------------------------------------------------

// (|g| - 1)^2 and its gradient, 0 for g = 0.                                    Source: Gropp et al. 2020.
template <class T> struct EikonalLoss {
  T value;
  Vec3<T> by_gradient;
};
template <class T> SPLITNERF_HD EikonalLoss<T> eikonal_loss(Vec3<T> g) {
  const T size = length(g), excess = size - T(1);
  if (!(size > T(0))) return {square(excess), g};
  return {square(excess), Vec3<T>{g.x / size, g.y / size, g.z / size} * (T(2) * excess)};  // 1 / size may have no float
}

// Distance of the unit normals of two gradients, and its gradients. The pair does not count where one of them has no
// direction, nor where the normals are more than a right angle apart: those are of two sides of a thin part.
//   |m - n| = 2 sin(t / 2) = |n x m| / cos(t / 2);  by n: -cos(t / 2) along (n x m) x n, so that close normals, whose
// difference is rounding, keep the direction in which they differ.
template <class T> struct NormalDistance {
  bool counts;
  T value;
  Vec3<T> by_here, by_there;
};
template <class T> SPLITNERF_HD NormalDistance<T> normal_distance(Vec3<T> here, Vec3<T> there) {
  const T here2 = dot(here, here), there2 = dot(there, there);
  if (here2 < T(kMinGradientSquared) || there2 < T(kMinGradientSquared)) return {};
  const T per_here = T(1) / std::sqrt(here2), per_there = T(1) / std::sqrt(there2);
  const Vec3<T> n = here * per_here, m = there * per_there, axis = cross(n, m);
  const T cosine = dot(n, m), sine = length(axis);
  if (cosine < T(0)) return {};
  const T cos_half = std::sqrt(T(0.5) * (T(1) + cosine));  // a NaN goes on to the caller
  const T scale = sine > T(0) ? cos_half / sine : T(0);
  return {true, sine / cos_half, cross(n, axis) * (scale * per_here), cross(axis, m) * (scale * per_there)};
}

}  // namespace splitnerf
