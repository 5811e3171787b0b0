// exp and logarithms on half lines, without branches or calls: loops over them become vector code.
#pragma once

#include <cstdint>
#include <cstring>

#include "splitnerf/vec.h"

namespace splitnerf {

template <class T> struct FloatFormat;
template <> struct FloatFormat<float> {
  using Bits = uint32_t;
  static constexpr int kMantissaBits = 23, kExpTerms = 7, kLogTerms = 8;
  static constexpr Bits kBias = 127;
  static constexpr float kRounder = 12582912.0f;  // 1.5 2^23: adding it rounds to an integer, which the low bits hold
  static constexpr float kLargestExponent = 87.0f, kLn2High = 0.693359375f, kLn2Low = -2.12194440e-4f;
};
template <> struct FloatFormat<double> {
  using Bits = uint64_t;
  static constexpr int kMantissaBits = 52, kExpTerms = 13, kLogTerms = 17;
  static constexpr Bits kBias = 1023;
  static constexpr double kRounder = 6755399441055744.0;
  static constexpr double kLargestExponent = 708.0, kLn2High = 6.93145751953125e-1, kLn2Low = 1.42860682030941723212e-6;
};

// 1 + r/1 (1 + r/2 (1 + r/3 ...)) and 1 + q (1/3 + q (1/5 + ...)), from term I on; a loop would not be unrolled in time.
template <int I, class T> SPLITNERF_HD T exp_series(T r) {
  if constexpr (I > FloatFormat<T>::kExpTerms) {
    return T(1);
  } else {
    return T(1) + r * (T(1) / T(I)) * exp_series<I + 1>(r);
  }
}
template <int I, class T> SPLITNERF_HD T artanh_series(T q) {
  if constexpr (I == FloatFormat<T>::kLogTerms) {
    return T(1) / T(2 * I - 1);
  } else {
    return T(1) / T(2 * I - 1) + q * artanh_series<I + 1>(q);
  }
}

// exp(-x) for x >= 0, two units in the last place; below the smallest normal number it stays there. NaN stays NaN.
//   exp(-x) = 2^-k exp(k ln 2 - x), k = round(x / ln 2), the rest by its Taylor series.
template <class T> SPLITNERF_HD T exp_of_minus(T x) {
  using Format = FloatFormat<T>;
  using Bits = typename Format::Bits;
  const T bounded = x > Format::kLargestExponent ? Format::kLargestExponent : x, rounder = Format::kRounder;
  const T shifted = bounded * T(1.4426950408889634) + rounder, k = shifted - rounder;
  const T series = exp_series<1>((k * Format::kLn2High - bounded) + k * Format::kLn2Low);
  Bits high, low;
  std::memcpy(&high, &shifted, sizeof high);
  std::memcpy(&low, &rounder, sizeof low);
  const Bits power = (Format::kBias - (high - low)) << Format::kMantissaBits;
  T scale;
  std::memcpy(&scale, &power, sizeof scale);
  return series * scale;
}

// log(1 + u) for u in [0, 1] = 2 artanh(u / (2 + u)), by its series.
template <class T> SPLITNERF_HD T log1p_of_unit(T u) {
  const T s = u / (T(2) + u), q = s * s;
  return T(2) * s * artanh_series<1>(q);
}

// log(1 + y) for y >= 0 and finite. With u = 1 + y rounded, log1p(y) = log(u) + (y - (u - 1)) / u gives back what the rounding
// took; u = m 2^k, m in [sqrt(1/2), sqrt(2)), and log(m) = 2 artanh((m - 1) / (m + 1)).
template <class T> SPLITNERF_HD T log1p_of_positive(T y) {
  using Format = FloatFormat<T>;
  using Bits = typename Format::Bits;
  constexpr Bits kMantissa = (Bits(1) << Format::kMantissaBits) - 1, kOne = Format::kBias << Format::kMantissaBits;
  const T u = T(1) + y;
  Bits bits;
  std::memcpy(&bits, &u, sizeof bits);
  const Bits unit = (bits & kMantissa) | kOne;
  T m;
  std::memcpy(&m, &unit, sizeof m);
  const T upper = m > T(1.4142135623730951) ? T(1) : T(0), reduced = m - T(0.5) * upper * m;
  const T k = T(static_cast<int32_t>((bits >> Format::kMantissaBits) - Format::kBias)) + upper;
  const T s = (reduced - T(1)) / (reduced + T(1));
  return k * Format::kLn2High + (T(2) * s * artanh_series<1>(s * s) + k * Format::kLn2Low + (y - (u - T(1))) / u);
}

// log(1 + exp(beta x)) / beta, beta > 0, and its derivative.
template <class T> struct Softplus {
  T value, slope;
};
template <class T> SPLITNERF_HD Softplus<T> softplus_and_slope(T x, T beta) {
  const T y = beta * x, e = exp_of_minus(y < T(0) ? -y : y), inverse = T(1) / (T(1) + e);
  return {(x > T(0) ? x : T(0)) + log1p_of_unit(e) * (T(1) / beta), x > T(0) ? inverse : e * inverse};
}

}  // namespace splitnerf
