// The curve between linear values and those of an image.                                    Source: IEC 61966-2-1.
#pragma once

#include <cmath>

#include "splitnerf/vec.h"

namespace splitnerf {

template <class T> struct ValueAndSlope {
  T value, slope;
};

// Not clipped above 1; values below 0 count as 0, with the slope of 0.
template <class T> SPLITNERF_HD ValueAndSlope<T> srgb_from_linear(T linear) {
  if (linear <= T(0.0031308)) return {T(12.92) * max_of(linear, T(0)), linear < T(0) ? T(0) : T(12.92)};
  const T power = T(1.055) * std::pow(linear, T(1) / T(2.4));
  return {power - T(0.055), power / linear * (T(1) / T(2.4))};
}

// Of values >= 0, not clipped above 1.
template <class T> SPLITNERF_HD T linear_from_srgb(T srgb) {
  return srgb <= T(0.04045) ? srgb / T(12.92) : std::pow((srgb + T(0.055)) / T(1.055), T(2.4));
}

}  // namespace splitnerf
