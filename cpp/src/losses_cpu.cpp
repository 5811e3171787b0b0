#include <vector>

#include "splitnerf/bodies/losses.h"
#include "splitnerf/kernels.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"

namespace splitnerf::cpu {
namespace {

// One after the other, so that sums have the same bits each time.
template <class Body> void add_up(int64_t n, const Body& body) {
  double sums[Body::n_sums] = {};
  for (int64_t i = 0; i < n; ++i) body(i, sums);
  body.finish(sums);
}

template <class T> void scale(int64_t n, const double& factor, T* values) {
  const ScaleBody<T> body{&factor, values};
  for (int64_t i = 0; i < n; ++i) body(i);
}

}  // namespace

template <class T>
void pixel_losses(int64_t n, const T* mean, const T* opacity, const T* target, const T* background, bool linear,
                  T* losses, T* colour_by_mean, T* colour_by_opacity, T* mask_by_opacity) {
  add_up(n, make_pixel_losses(n, mean, opacity, target, background, linear, losses, colour_by_mean, colour_by_opacity,
                              mask_by_opacity));
}

template <class T>
void gradient_losses(int64_t n, int64_t n_weights, int64_t m, const T* gradients, const T* weights,
                     const int64_t* beside, T* losses, T* eikonal_by, T* smoothness_by) {
  add_up(n, EikonalBody<T>{gradients, T(1) / T(max_of<int64_t>(n, 1)), losses, eikonal_by, smoothness_by});
  double factor;
  add_up(m, NormalPairsBody<T>{n, n_weights, m, gradients, weights, beside, losses + 1, smoothness_by, &factor});
  scale(3 * n, factor, smoothness_by);
}

template <class T>
void material_losses(int64_t n, const T* albedo, const T* metallic, const T* shares, bool smooth_l1, T* losses,
                     T* by_metallic) {
  double factor;
  add_up(n, MaterialLossesBody<T>{n, albedo, metallic, shares, smooth_l1, losses, by_metallic, &factor});
  scale(3 * n, factor, by_metallic);
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

#define SPLITNERF_INSTANTIATE(T)                                                                               \
  template void pixel_losses<T>(int64_t, const T*, const T*, const T*, const T*, bool, T*, T*, T*, T*);        \
  template void gradient_losses<T>(int64_t, int64_t, int64_t, const T*, const T*, const int64_t*, T*, T*, T*); \
  template void material_losses<T>(int64_t, const T*, const T*, const T*, bool, T*, T*);                       \
  template void quadratic_entropy<T>(int64_t, int64_t, const T*, T*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cpu
