// Numbers of 16 bits as they are stored: read as float32, which is what is computed with, and rounded from it.
#pragma once

#include <cstring>

#include "splitnerf/config.h"
#ifdef __CUDACC__
#include <cuda_fp16.h>
#endif

namespace splitnerf {

struct Half {  // IEEE 754 binary16
  uint16_t bits;
};

SPLITNERF_HD float float_of_bits(uint32_t bits) {
  float x;
  std::memcpy(&x, &bits, sizeof x);
  return x;
}
SPLITNERF_HD uint32_t bits_of_float(float x) {
  uint32_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  return bits;
}

// Between the exponents of float32 and binary16; and 0.5f, whose last bit is 2^-24, as that of binary16's subnormals is.
inline constexpr uint32_t kRebias = (127u - 15u) << 23, kHalfOne = 0x3f000000u;

// A stored number as the one to compute with: exact. Without branches, so that loops become vector code.
SPLITNERF_HD float widen(float x) { return x; }
SPLITNERF_HD double widen(double x) { return x; }
SPLITNERF_HD float widen(Half x) {
#ifdef __CUDA_ARCH__
  return __half2float(__ushort_as_half(x.bits));
#else
  const uint32_t sign = (x.bits & 0x8000u) << 16, magnitude = x.bits & 0x7fffu;
  const uint32_t shifted = magnitude << 13;
  const uint32_t subnormal = bits_of_float(float_of_bits(kHalfOne | magnitude) - 0.5f);
  const uint32_t finite = magnitude < 0x400u ? subnormal : shifted + kRebias;
  return float_of_bits(sign | (magnitude < 0x7c00u ? finite : shifted | 0x7f800000u));
#endif
}

// The stored number nearest to x, of two the even one; beyond the largest of them that one, never infinite. NaN stays NaN.
SPLITNERF_HD Half narrow(float x) {
  constexpr uint32_t kLargest = 0x477fe000u, kSmallestNormal = 0x38800000u;
  const uint32_t bits = bits_of_float(x), sign = bits >> 16 & 0x8000u, magnitude = bits & 0x7fffffffu;
  const uint32_t within = magnitude < kLargest ? magnitude : kLargest;
  const uint32_t normal = (within - kRebias + 0xfffu + (within >> 13 & 1u)) >> 13;
  const uint32_t subnormal = bits_of_float(float_of_bits(within) + 0.5f) - kHalfOne;
  const uint32_t rounded = within < kSmallestNormal ? subnormal : normal;
  return {static_cast<uint16_t>(sign | (magnitude > 0x7f800000u ? 0x7e00u : rounded))};
}

}  // namespace splitnerf
