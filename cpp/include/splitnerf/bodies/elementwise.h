// The sRGB curve, one value a call.
#pragma once

#include "splitnerf/srgb.h"

namespace splitnerf {

template <class T> struct LinearToSrgbBody {
  const T* linear;
  T* srgb;

  SPLITNERF_HD void operator()(int64_t i) const { srgb[i] = srgb_from_linear(linear[i]).value; }
};
SPLITNERF_ON_GPU(LinearToSrgbBody);

template <class T> struct LinearToSrgbBackwardBody {
  const T *linear, *grad_srgb;
  T* grad_linear;

  SPLITNERF_HD void operator()(int64_t i) const { grad_linear[i] = grad_srgb[i] * srgb_from_linear(linear[i]).slope; }
};
SPLITNERF_ON_GPU(LinearToSrgbBackwardBody);

template <class T> struct SrgbToLinearBody {
  const T* srgb;
  T* linear;

  SPLITNERF_HD void operator()(int64_t i) const { linear[i] = linear_from_srgb(srgb[i]); }
};
SPLITNERF_ON_GPU(SrgbToLinearBody);

}  // namespace splitnerf
