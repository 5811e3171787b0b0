#include "splitnerf/losses.h"

#include <vector>

#include "splitnerf/kernels.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"

namespace splitnerf::cpu {

template <class T>
void pixel_losses(int64_t n, const T* mean, const T* opacity, const T* target, const T* background, bool linear,
                  T* losses, T* colour_by_mean, T* colour_by_opacity, T* mask_by_opacity) {
  const T per_value = T(1) / T(max_of<int64_t>(3 * n, 1)), per_ray = T(1) / T(max_of<int64_t>(n, 1));
  double colour = 0, mask = 0;
  for (int64_t i = 0; i < n; ++i) {
    const auto pixel =
        splitnerf::pixel_losses(load3(mean + 3 * i), opacity[i], target + 4 * i, load3(background + 3 * i), linear);
    colour += double(pixel.colour), mask += double(pixel.mask);
    store3(colour_by_mean + 3 * i, pixel.colour_by_mean * per_value);
    colour_by_opacity[i] = pixel.colour_by_opacity * per_value;
    mask_by_opacity[i] = pixel.mask_by_opacity * per_ray;
  }
  losses[0] = T(colour * double(per_value)), losses[1] = T(mask * double(per_ray));
}

template <class T>
void gradient_losses(int64_t n, int64_t m, const T* gradients, const T* weights, const int64_t* beside, T* losses,
                     T* eikonal_by, T* smoothness_by) {
  const T per_point = T(1) / T(max_of<int64_t>(n, 1));
  double eikonal = 0, apart = 0, total = 0;
  for (int64_t i = 0; i < n; ++i) {
    const auto point = eikonal_loss(load3(gradients + 3 * i));
    eikonal += double(point.value);
    store3(eikonal_by + 3 * i, point.by_gradient * per_point);
    store3(smoothness_by + 3 * i, Vec3<T>{T(0), T(0), T(0)});
  }
  for (int64_t j = 0; j < m; ++j) {
    const int64_t here = 3 * beside[j], there = 3 * (n - m + j);
    const T weight = weights[beside[j]];
    const auto pair = normal_distance(load3(gradients + here), load3(gradients + there));
    if (pair.value >= T(kOtherSide)) continue;
    apart += double(weight * pair.value), total += double(weight);
    store3(smoothness_by + here, load3(smoothness_by + here) + pair.by_here * weight);
    store3(smoothness_by + there, load3(smoothness_by + there) + pair.by_there * weight);
  }
  const double per_weight = 1.0 / max_of(total, 1e-8);
  for (int64_t i = 0; i < 3 * n; ++i) smoothness_by[i] *= T(per_weight);
  losses[0] = T(eikonal * double(per_point)), losses[1] = T(apart * per_weight);
}

template <class T>
void material_losses(int64_t n, const T* albedo, const T* metallic, const T* shares, bool smooth_l1, T* losses,
                     T* by_metallic) {
  double sums[3] = {}, total = 0;
  for (int64_t i = 0; i < n; ++i) {
    const auto point = splitnerf::material_losses(load3(albedo + 3 * i), metallic[i], smooth_l1);
    const T values[3] = {point.metal, point.binary, point.dark},
            slopes[3] = {point.metal_slope, point.binary_slope, point.dark_slope};
    total += double(shares[i]);
    for (int k = 0; k < 3; ++k) {
      sums[k] += double(shares[i] * values[k]);
      by_metallic[k * n + i] = shares[i] * slopes[k];
    }
  }
  const double per_share = 1.0 / max_of(total, 1e-8);
  for (int64_t i = 0; i < 3 * n; ++i) by_metallic[i] *= T(per_share);
  for (int k = 0; k < 3; ++k) losses[k] = T(sums[k] * per_share);
}

// E = -ln(sum_ij k_ij / n^2),  dE / dx_i = sum_j k_ij (x_i - x_j) / sum k
template <class T> void quadratic_entropy(int64_t n, int64_t n_channels, const T* x, T* entropy, T* gradient) {
  constexpr int64_t kGrain = 32;
  std::vector<T> planes(n * n_channels), sums(n * (n_channels + 1));
  for (int64_t i = 0; i < n; ++i)
    for (int64_t c = 0; c < n_channels; ++c) planes[c * n + i] = x[i * n_channels + c];
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    std::vector<T> likeness(n);
    for (int64_t i = begin; i < end; ++i)
      kernels<T>().pair_likeness(n, n_channels, planes.data(), i, likeness.data(), &sums[i * (n_channels + 1)]);
  });
  double total = 0;
  for (int64_t i = 0; i < n; ++i) total += double(sums[i * (n_channels + 1) + n_channels]);
  *entropy = static_cast<T>(-std::log(total / (double(n) * double(n))));
  for (int64_t i = 0; i < n; ++i)
    for (int64_t c = 0; c < n_channels; ++c)
      gradient[i * n_channels + c] = static_cast<T>(double(sums[i * (n_channels + 1) + c]) / total);
}

#define SPLITNERF_INSTANTIATE(T)                                                                        \
  template void pixel_losses<T>(int64_t, const T*, const T*, const T*, const T*, bool, T*, T*, T*, T*); \
  template void gradient_losses<T>(int64_t, int64_t, const T*, const T*, const int64_t*, T*, T*, T*);   \
  template void material_losses<T>(int64_t, const T*, const T*, const T*, bool, T*, T*);                \
  template void quadratic_entropy<T>(int64_t, int64_t, const T*, T*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cpu
