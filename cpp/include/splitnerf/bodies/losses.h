// Losses with their gradients, one item per call; the sums over items are added to `sums`, in double.
#pragma once

#include "splitnerf/accumulate.h"
#include "splitnerf/group.h"
#include "splitnerf/losses.h"
#include "splitnerf/vector_math.h"

namespace splitnerf {

// sums = {colour, mask}
template <class T> struct PixelLossesBody {
  static constexpr int n_sums = 2;
  const T *mean, *opacity, *target, *background;
  const bool* whole;
  bool linear;
  T per_value, per_ray;  // 1 over the number of values and of rays, as the means are taken
  T *losses, *colour_by_mean, *colour_by_opacity, *mask_by_opacity;

  SPLITNERF_HD void operator()(int64_t i, double* sums) const {
    const auto pixel =
        pixel_losses(load3(mean + 3 * i), opacity[i], target + 4 * i, load3(background + 3 * i), whole[i], linear);
    sums[0] += double(pixel.colour), sums[1] += double(pixel.mask);
    store3(colour_by_mean + 3 * i, pixel.colour_by_mean * per_value);
    colour_by_opacity[i] = pixel.colour_by_opacity * per_value;
    mask_by_opacity[i] = pixel.mask_by_opacity * per_ray;
  }
  SPLITNERF_HD void finish(const double* sums) const {
    losses[0] = T(sums[0] * double(per_value)), losses[1] = T(sums[1] * double(per_ray));
  }
};
SPLITNERF_ON_GPU(PixelLossesBody);
template <class T>
PixelLossesBody<T> make_pixel_losses(int64_t n, const T* mean, const T* opacity, const T* target, const T* background,
                                     const bool* whole, bool linear, T* losses, T* colour_by_mean, T* colour_by_opacity,
                                     T* mask_by_opacity) {
  return {mean,
          opacity,
          target,
          background,
          whole,
          linear,
          T(1) / T(max_of<int64_t>(3 * n, 1)),
          T(1) / T(max_of<int64_t>(n, 1)),
          losses,
          colour_by_mean,
          colour_by_opacity,
          mask_by_opacity};
}

// sums = {eikonal}; clears smoothness_by for what NormalPairsBody adds.
template <class T> struct EikonalBody {
  static constexpr int n_sums = 1;
  const T* gradients;
  T per_point;
  T *loss, *eikonal_by, *smoothness_by;

  SPLITNERF_HD void operator()(int64_t i, double* sums) const {
    const auto point = eikonal_loss(load3(gradients + 3 * i));
    sums[0] += double(point.value);
    store3(eikonal_by + 3 * i, point.by_gradient * per_point);
    store3(smoothness_by + 3 * i, Vec3<T>{T(0), T(0), T(0)});
  }
  SPLITNERF_HD void finish(const double* sums) const { *loss = T(sums[0] * double(per_point)); }
};
SPLITNERF_ON_GPU(EikonalBody);

// Pair j is of sample beside[j] and of gradient n - m + j. sums = {weight distance, weight}; adds to smoothness_by, which is
// then to be scaled by *scale.
template <class T> struct NormalPairsBody {
  static constexpr int n_sums = 2;
  int64_t n, n_weights, m;
  const T *gradients, *weights;
  const int64_t* beside;
  T *loss, *smoothness_by;
  double* scale;

  SPLITNERF_HD void operator()(int64_t j, double* sums) const {
    // On the CPU `beside` has been checked. On the GPU it has not; any value keeps all accesses inside the arrays.
    const int64_t here = clamp<int64_t>(beside[j], 0, n_weights - 1), there = n - m + j;
    const T weight = weights[here];
    const auto pair = normal_distance(load3(gradients + 3 * here), load3(gradients + 3 * there));
    if (!pair.counts) return;
    sums[0] += double(weight * pair.value), sums[1] += double(weight);
    add3_to(smoothness_by + 3 * here, pair.by_here * weight);
    add3_to(smoothness_by + 3 * there, pair.by_there * weight);
  }
  SPLITNERF_HD void finish(const double* sums) const {
    *scale = 1.0 / max_of(sums[1], 1e-8);
    *loss = T(sums[0] * *scale);
  }
};
SPLITNERF_ON_GPU(NormalPairsBody);

// sums = {metal, binary, dark, share}; by_metallic is then to be scaled by *scale.
template <class T> struct MaterialLossesBody {
  static constexpr int n_sums = 4;
  int64_t n;
  const T *albedo, *metallic, *shares;
  bool smooth_l1;
  T *losses, *by_metallic;
  double* scale;

  SPLITNERF_HD void operator()(int64_t i, double* sums) const {
    const auto point = material_losses(load3(albedo + 3 * i), metallic[i], smooth_l1);
    const T values[3] = {point.metal, point.binary, point.dark},
            slopes[3] = {point.metal_slope, point.binary_slope, point.dark_slope};
    for (int k = 0; k < 3; ++k) {
      sums[k] += double(shares[i] * values[k]);
      by_metallic[k * n + i] = shares[i] * slopes[k];
    }
    sums[3] += double(shares[i]);
  }
  SPLITNERF_HD void finish(const double* sums) const {
    *scale = 1.0 / max_of(sums[3], 1e-8);
    for (int k = 0; k < 3; ++k) losses[k] = T(sums[k] * *scale);
  }
};
SPLITNERF_ON_GPU(MaterialLossesBody);

template <class T> struct ScaleBody {
  const double* scale;
  T* values;

  SPLITNERF_HD void operator()(int64_t i) const { values[i] *= T(*scale); }
};
SPLITNERF_ON_GPU(ScaleBody);

// ---- quadratic entropy: E = -ln(sum_ij k_ij / n^2),  dE / dx_i = sum_j k_ij (x_i - x_j) / sum k ----

// rows [n, n_channels + 1] = {sum_j k_ij (x_i - x_j), sum_j k_ij}, k_ij = exp(-|x_i - x_j|^2 / 4); a group of threads a point.
template <class T> struct PairLikenessBody {
  int64_t n, n_channels;
  const T* x;  // [n, n_channels]
  T* rows;

  template <class Group> SPLITNERF_HD void operator()(const Group& group, int64_t i) const {
    constexpr int kChannels = 8;  // summed together; for more the likeness is worked out again
    const T* here = x + i * n_channels;
    T* row = rows + i * (n_channels + 1);
    for (int64_t first = 0; first == 0 || first < n_channels; first += kChannels) {
      T pull[kChannels] = {}, total = T(0);
      for (int64_t j = group.lane(); j < n; j += Group::size) {
        const T* there = x + j * n_channels;
        T apart = T(0);
        for (int64_t c = 0; c < n_channels; ++c) apart += square(there[c] - here[c]);
        const T likeness = exp_of_minus(T(0.25) * apart);
        total += likeness;
        for (int c = 0; c < kChannels; ++c)
          if (first + c < n_channels) pull[c] += likeness * (here[first + c] - there[first + c]);
      }
      total = group.sum(total);
      for (int c = 0; c < kChannels; ++c) {
        const T sum = group.sum(pull[c]);
        if (group.lane() == 0 && first + c < n_channels) row[first + c] = sum;
      }
      if (group.lane() == 0) row[n_channels] = total;
    }
  }
};
SPLITNERF_ON_GPU(PairLikenessBody);

// sums = {sum_ij k_ij}
template <class T> struct EntropyBody {
  static constexpr int n_sums = 1;
  int64_t n, n_channels;
  const T* rows;
  T* entropy;
  double* total;

  SPLITNERF_HD void operator()(int64_t i, double* sums) const {
    sums[0] += double(rows[i * (n_channels + 1) + n_channels]);
  }
  SPLITNERF_HD void finish(const double* sums) const {
    *total = sums[0];
    *entropy = static_cast<T>(-std::log(sums[0] / (double(n) * double(n))));
  }
};
SPLITNERF_ON_GPU(EntropyBody);

// One call for each of gradient [n, n_channels].
template <class T> struct EntropyGradientBody {
  int64_t n_channels;
  const T* rows;
  const double* total;
  T* gradient;

  SPLITNERF_HD void operator()(int64_t at) const {
    const int64_t i = at / n_channels, c = at % n_channels;
    gradient[at] = static_cast<T>(double(rows[i * (n_channels + 1) + c]) / *total);
  }
};
SPLITNERF_ON_GPU(EntropyGradientBody);

}  // namespace splitnerf
