// Terms of the training loss that look at the light alone, each with its gradient.
#pragma once

#include <cmath>

#include "splitnerf/vec.h"

namespace splitnerf {

// ---- colour ----------------------------------------------------------------------------------

inline constexpr double kDarkest = 1e-6;  // what is added to a radiance, so that it has a logarithm

// ln(x / y) of positive numbers, also where they are nearly equal.
template <class T> SPLITNERF_HD T log_ratio(T x, T y) {
  return x > T(0.5) * y && x < T(2) * y ? std::log1p((x - y) / y) : std::log(x / y);
}

// Mean square of the log channels' distances from their mean, d_c = l_c - mean l, l = ln(L + 1e-6), and its gradient
// (2 / 3) d_c / (L_c + 1e-6), as the d_c sum to 0.
template <class T> struct LogChroma {
  T value;
  Vec3<T> by_radiance;
};
template <class T> SPLITNERF_HD LogChroma<T> log_chroma(Vec3<T> radiance) {
  Vec3<T> l;  // beside that of the first channel
  for (int c = 0; c < 3; ++c) l[c] = log_ratio(radiance[c] + T(kDarkest), radiance.x + T(kDarkest));
  const T mean = sum(l) * T(1. / 3);
  LogChroma<T> out{};
  for (int c = 0; c < 3; ++c) {
    const T apart = l[c] - mean;
    out.value += square(apart) * T(1. / 3);
    out.by_radiance[c] = T(2. / 3) * apart / (radiance[c] + T(kDarkest));
  }
  return out;
}

// ---- texels ----------------------------------------------------------------------------------

inline constexpr double kBrightnessDeviation = 0.5;  // of a texel's log radiance from the coarser levels
inline constexpr double kColourDeviation = 0.2;      // of its channels from their mean
inline constexpr double kTails = 3.0;                // degrees of freedom

// What a texel costs whose log radiance is d away from the coarser levels, and its gradient: that of Student's t distribution,
//   ln(1 + b^2 / (k s_b^2)) + ln(1 + c / (k s_c^2)),  b = mean d,  c = mean (d - b)^2,  k degrees of freedom.
template <class T> struct TexelCost {
  T value;
  Vec3<T> by_apart;
};
template <class T> SPLITNERF_HD TexelCost<T> texel_cost(Vec3<T> apart) {
  constexpr T of_brightness = T(kTails * kBrightnessDeviation * kBrightnessDeviation),
              of_colour = T(kTails * kColourDeviation * kColourDeviation);
  const T brightness = sum(apart) * T(1. / 3);
  const Vec3<T> rest{apart.x - brightness, apart.y - brightness, apart.z - brightness};
  const T colour = dot(rest, rest) * T(1. / 3);
  const T by_brightness = T(2. / 3) * brightness / (of_brightness + square(brightness));
  const T value = std::log1p(square(brightness) / of_brightness) + std::log1p(colour / of_colour);
  return {value, rest * (T(2. / 3) / (of_colour + colour)) + Vec3<T>{by_brightness, by_brightness, by_brightness}};
}

}  // namespace splitnerf
