// Losses and their gradients, one item per call; the sums over items are added to `sums`, in double.
#pragma once

#include "splitnerf/accumulate.h"
#include "splitnerf/group.h"
#include "splitnerf/losses.h"
#include "splitnerf/vector_math.h"

namespace splitnerf {

// What the losses of pixels read. Without `exposure` all factors are 1, without `whole` no pixel is whole.
template <class T> struct PixelArrays {
  int64_t n;
  const T *mean, *opacity, *target, *background, *exposure;
  const bool* whole;
  bool linear;

  SPLITNERF_HD T per_value() const { return T(1) / T(max_of<int64_t>(3 * n, 1)); }
  SPLITNERF_HD T per_ray() const { return T(1) / T(max_of<int64_t>(n, 1)); }
  SPLITNERF_HD Vec3<T> exposure_of(int64_t i) const {
    return exposure ? load3(exposure + 3 * i) : Vec3<T>{T(1), T(1), T(1)};
  }
  SPLITNERF_HD PixelLosses<T> at(int64_t i) const {
    return pixel_losses(load3(mean + 3 * i) * exposure_of(i), opacity[i], target + 4 * i, load3(background + 3 * i),
                        whole && whole[i], linear);
  }
};

// sums = {colour, mask}
template <class T> struct PixelLossesBody {
  static constexpr int n_sums = 2;
  PixelArrays<T> in;
  T* losses;  // [2]

  SPLITNERF_HD void operator()(int64_t i, double* sums) const {
    const auto pixel = in.at(i);
    sums[0] += double(pixel.colour), sums[1] += double(pixel.mask);
  }
  SPLITNERF_HD void finish(const double* sums) const {
    losses[0] = T(sums[0] * double(in.per_value())), losses[1] = T(sums[1] * double(in.per_ray()));
  }
};
SPLITNERF_ON_GPU(PixelLossesBody);

template <class T> struct PixelLossesBackwardBody {
  PixelArrays<T> in;
  const T* grad_losses;  // [2]
  T *grad_mean, *grad_opacity;

  SPLITNERF_HD void operator()(int64_t i) const {
    const auto pixel = in.at(i);
    const T by_colour = grad_losses[0] * in.per_value(), by_mask = grad_losses[1] * in.per_ray();
    store3(grad_mean + 3 * i, pixel.colour_by_mean * in.exposure_of(i) * by_colour);
    grad_opacity[i] = pixel.colour_by_opacity * by_colour + pixel.mask_by_opacity * by_mask;
  }
};
SPLITNERF_ON_GPU(PixelLossesBackwardBody);

inline constexpr double kLeastWeight = 1e-8;  // a smaller sum of weights counts as this one

// What the losses of gradients read: pair j is of sample beside[j] and of gradient n - m + j.
template <class T> struct GradientArrays {
  int64_t n, n_weights, m;
  const T *gradients, *weights;
  const int64_t* beside;

  SPLITNERF_HD T per_point() const { return T(1) / T(max_of<int64_t>(n, 1)); }
  // On the CPU `beside` has been checked. On the GPU it has not; any value keeps all accesses inside the arrays.
  SPLITNERF_HD int64_t sample_of(int64_t j) const { return clamp<int64_t>(beside[j], 0, n_weights - 1); }
  SPLITNERF_HD NormalDistance<T> pair(int64_t j) const {
    return normal_distance(load3(gradients + 3 * sample_of(j)), load3(gradients + 3 * (n - m + j)));
  }
};

// One call for each of the n points, then for each of the m pairs. sums = {eikonal, weight distance, weight}
template <class T> struct GradientLossesBody {
  static constexpr int n_sums = 3;
  GradientArrays<T> in;
  T *losses, *total;  // [2], and the weight of the pairs that count

  SPLITNERF_HD void operator()(int64_t i, double* sums) const {
    if (i < in.n) {
      sums[0] += double(eikonal_loss(load3(in.gradients + 3 * i)).value);
    } else if (const auto pair = in.pair(i - in.n); pair.counts) {
      const T weight = in.weights[in.sample_of(i - in.n)];
      sums[1] += double(weight * pair.value), sums[2] += double(weight);
    }
  }
  SPLITNERF_HD void finish(const double* sums) const {
    losses[0] = T(sums[0] * double(in.per_point())), losses[1] = T(sums[1] / max_of(sums[2], kLeastWeight));
    *total = T(sums[2]);
  }
};
SPLITNERF_ON_GPU(GradientLossesBody);

// The gradient at each of the n points, but for what the pairs pull at their samples.
template <class T> struct GradientLossesBackwardBody {
  GradientArrays<T> in;
  const T *total, *grad_losses;
  T* grad_gradients;

  SPLITNERF_HD T by_pair(int64_t j) const {
    return grad_losses[1] * in.weights[in.sample_of(j)] / max_of(*total, T(kLeastWeight));
  }
  SPLITNERF_HD void operator()(int64_t i) const {
    Vec3<T> grad = eikonal_loss(load3(in.gradients + 3 * i)).by_gradient * (grad_losses[0] * in.per_point());
    const int64_t j = i - (in.n - in.m);
    if (j >= 0)
      if (const auto pair = in.pair(j); pair.counts) grad += pair.by_there * by_pair(j);
    store3(grad_gradients + 3 * i, grad);
  }
};
SPLITNERF_ON_GPU(GradientLossesBackwardBody);

// What pair j pulls at its sample, added to the gradient that the body above has stored there.
template <class T> struct SamplesOfPairsBackwardBody {
  static constexpr bool adds_to_shared = true;
  GradientLossesBackwardBody<T> of;

  SPLITNERF_HD void operator()(int64_t j) const {
    const auto pair = of.in.pair(j);
    if (pair.counts) add3_to(of.grad_gradients + 3 * of.in.sample_of(j), pair.by_here * of.by_pair(j));
  }
};
SPLITNERF_ON_GPU(SamplesOfPairsBackwardBody);

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
