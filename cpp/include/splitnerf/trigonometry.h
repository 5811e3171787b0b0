// cos, sin and atan2 in float without branches or calls: several times as fast as the library's.
#pragma once

#include "splitnerf/vec.h"

namespace splitnerf {

// cos and sin of u turns, 2 pi u, for |u| <= 1e6: the rest after quarter turns by its Taylor series.
template <class T> SPLITNERF_HD Vec2<T> cos_sin_of_turns(T u) {
  if constexpr (sizeof(T) > sizeof(float)) {
    return {std::cos(T(2 * kPi) * u), std::sin(T(2 * kPi) * u)};
  } else {
    constexpr T kRounder = T(12582912);  // 1.5 2^23: adding it rounds to an integer
    const T shifted = T(4) * u + kRounder, quarters = shifted - kRounder;
    const T r = (u - T(0.25) * quarters) * T(2 * kPi), q = r * r;
    const T s = r * (T(1) - q * (T(1. / 6) - q * (T(1. / 120) - q * (T(1. / 5040) - q * T(1. / 362880)))));
    const T c = T(1) - q * (T(1. / 2) - q * (T(1. / 24) - q * (T(1. / 720) - q * T(1. / 40320))));
    const int k = static_cast<int>(quarters);
    const T x = k & 1 ? s : c, y = k & 1 ? c : s;
    return {(k + 1) & 2 ? -x : x, k & 2 ? -y : y};
  }
}

// atan2(y, x) of finite numbers, 2e-7 of the result in float; 0 where both are 0, NaN where one is. The polynomial is the best of its degree for atan(t) / t
// in t^2 on [0, 1], by relative error (1.6e-8), found by iterated reweighting.
template <class T> SPLITNERF_HD T arc_tangent(T y, T x) {
  if constexpr (sizeof(T) > sizeof(float)) {
    return std::atan2(y, x);
  } else {
    const T ax = std::fabs(x), ay = std::fabs(y);
    const T largest = max_of(ax, ay), t = min_of(ax, ay) / max_of(largest, T(1e-37)) + (x - x) + (y - y), q = t * t;
    const T low = T(0.999999985) + q * (T(-0.333330733) + q * (T(0.199926194) + q * T(-0.142036443)));
    const T high =
        T(0.106409332) + q * (T(-0.0750429272) + q * (T(0.0426914977) + q * (T(-0.0160686157) + q * T(0.00284988629))));
    const T flat = t * (low + q * q * q * q * high);
    const T steep = ay > ax ? T(kPi / 2) - flat : flat;
    return std::copysign(x < T(0) ? T(kPi) - steep : steep, y);
  }
}

}  // namespace splitnerf
