// Numbers of 16 bits as they are stored: read as float32, which is what is computed with.
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
struct Bfloat16 {  // the upper half of a float32
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

// A stored number as the one to compute with: exact. Without branches, so that loops become vector code.
SPLITNERF_HD float widen(float x) { return x; }
SPLITNERF_HD double widen(double x) { return x; }
SPLITNERF_HD float widen(Bfloat16 x) { return float_of_bits(static_cast<uint32_t>(x.bits) << 16); }
SPLITNERF_HD float widen(Half x) {
#ifdef __CUDA_ARCH__
  return __half2float(__ushort_as_half(x.bits));
#else
  constexpr uint32_t kRebias = (127u - 15u) << 23, kHalfOne = 0x3f000000u;  // the latter: 0.5f, whose last bit is 2^-24
  const uint32_t sign = (x.bits & 0x8000u) << 16, magnitude = x.bits & 0x7fffu;
  const uint32_t shifted = magnitude << 13;
  const uint32_t subnormal = bits_of_float(float_of_bits(kHalfOne | magnitude) - 0.5f);
  const uint32_t finite = magnitude < 0x400u ? subnormal : shifted + kRebias;
  return float_of_bits(sign | (magnitude < 0x7c00u ? finite : shifted | 0x7f800000u));
#endif
}

}  // namespace splitnerf
