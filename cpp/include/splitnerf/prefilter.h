// The pre-integration lobe of the light.
#pragma once

#include "splitnerf/ggx.h"

namespace splitnerf {

// Weight of a light direction w in gbar(w_s, rho) = sum D L (w.w_s)+ / sum D (w.w_s)+, up to a factor
// that depends on neither (it cancels). In delta = w - w_s, with n = v = w_s:
//   sin^2(theta_h) = |delta|^2 / 4,  w.w_s = 1 - 2 sin^2(theta_h),  D ~ (1 / q)^2, q = a^2 + (1 - a^2) sin^2.
// (a / q)^2 would reach 1e8 at the centre of the narrowest lobe; (a^2 / q)^2 stays in [0, 1].
// Source: SplitNeRF Eq. (11).
template <class T> SPLITNERF_HD T prefilter_weight(T dx, T dy, T dz, T alpha_squared) {
  const T sin2 = T(0.25) * (dx * dx + dy * dy + dz * dz);
  const T q = alpha_squared + (T(1) - alpha_squared) * sin2;
  return square(alpha_squared / q) * max_of(T(1) - T(2) * sin2, T(0));
}

}  // namespace splitnerf
