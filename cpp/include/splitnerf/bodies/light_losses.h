// The loss of the light and its gradient, one texel per call; the sums over items are added to `sums`, in double.
#pragma once

#include "splitnerf/light_losses.h"

namespace splitnerf {

// The texels of a light's levels, the coarsest first. Their mean over it, a few texels that each call adds up for itself, is the
// brightness of the whole light: that costs nothing.
template <class T> struct TexelLevels {
  static constexpr int kMost = 16;
  int n_levels;
  int64_t sizes[kMost];
  const T* texels;

  SPLITNERF_HD T share_of(int64_t i) const {
    int level = 0;
    for (int64_t end = sizes[0]; i >= end && level + 1 < n_levels; end += sizes[level]) ++level;
    return T(1) / T(sizes[level]);
  }
  SPLITNERF_HD Vec3<T> mean() const {
    Vec3<T> sum{T(0), T(0), T(0)};
    for (int64_t i = 0; i < sizes[0]; ++i) sum += load3(texels + 3 * i);
    return sum * (T(1) / T(sizes[0]));
  }
  // The cost of a texel, and its gradient by the texel alone; `mean` counts for the coarsest ones.
  SPLITNERF_HD TexelCost<T> cost(int64_t i, Vec3<T> mean) const {
    const Vec3<T> texel = load3(texels + 3 * i);
    return texel_cost(i < sizes[0] ? texel - mean : texel);
  }
};

// sums = {cost}, the sum over the levels of the mean cost of a texel
template <class T> struct LightPriorBody {
  static constexpr int n_sums = 1;
  TexelLevels<T> in;
  T* loss;

  SPLITNERF_HD void operator()(int64_t i, double* sums) const {
    const Vec3<T> mean = i < in.sizes[0] ? in.mean() : Vec3<T>{};
    sums[0] += double(in.cost(i, mean).value * in.share_of(i));
  }
  SPLITNERF_HD void finish(const double* sums) const { *loss = T(sums[0]); }
};
SPLITNERF_ON_GPU(LightPriorBody);

// With d = x - mean x of the coarsest texels, grad x = grad d - mean grad d.
template <class T> struct LightPriorBackwardBody {
  TexelLevels<T> in;
  const T* grad_loss;
  T* grad_texels;

  SPLITNERF_HD void operator()(int64_t i) const {
    Vec3<T> mean{}, pulled{};
    if (i < in.sizes[0]) {
      mean = in.mean();
      for (int64_t k = 0; k < in.sizes[0]; ++k) pulled += in.cost(k, mean).by_apart;
    }
    const Vec3<T> grad = in.cost(i, mean).by_apart - pulled * (T(1) / T(in.sizes[0]));
    store3(grad_texels + 3 * i, grad * (*grad_loss * in.share_of(i)));
  }
};
SPLITNERF_ON_GPU(LightPriorBackwardBody);

}  // namespace splitnerf
