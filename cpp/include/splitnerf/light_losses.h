// The term of the training loss that looks at the texels of the light, with its gradient.
#pragma once

#include <cmath>

#include "splitnerf/vec.h"

namespace splitnerf {

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
