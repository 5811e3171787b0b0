// pixel_losses, gradient_losses, material_losses and quadratic_entropy as torch operators: each returns its values and
// their gradients, found in the same pass.
#include <tuple>

#include "device.h"

namespace splitnerf::glue {
namespace {

std::tuple<Tensor, Tensor, Tensor, Tensor> pixel_losses(Tensor mean, Tensor opacity, Tensor target, Tensor background,
                                                        Tensor whole, bool linear) {
  const char* op = "pixel_losses";
  const Kind type = real_kind(op, "mean", mean);
  const Tensor m = checked(op, "mean", mean, {kAny, 3}, type);
  const int64_t n = m.size(0);
  const Tensor o = checked(op, "opacity", opacity, {n}, type), t = checked(op, "target", target, {n, 4}, type);
  const Tensor b = checked(op, "background", background, {n, 3}, type),
               w = checked(op, "whole", whole, {n}, type.with(ScalarType::Bool));
  Tensor losses = empty_like_type(m, {2}, type), colour_by_mean = torch::stable::empty_like(m);
  Tensor colour_by_opacity = empty_like_type(m, {n}, type), mask_by_opacity = empty_like_type(m, {n}, type);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, n,
               make_pixel_losses(n, in<T>(m), in<T>(o), in<T>(t), in<T>(b), in<bool>(w), linear, out<T>(losses),
                                 out<T>(colour_by_mean), out<T>(colour_by_opacity), out<T>(mask_by_opacity)));
  });
  return {losses, colour_by_mean, colour_by_opacity, mask_by_opacity};
}

std::tuple<Tensor, Tensor, Tensor> gradient_losses(Tensor gradients, Tensor weights, Tensor beside) {
  const char* op = "gradient_losses";
  const Kind type = real_kind(op, "gradients", gradients);
  const Tensor g = checked(op, "gradients", gradients, {kAny, 3}, type),
               w = checked(op, "weights", weights, {kAny}, type);
  const Tensor b = checked(op, "beside", beside, {kAny}, type.with(ScalarType::Long));
  const int64_t n = g.size(0), m = b.size(0), n_weights = w.size(0);
  require(n_weights + m <= n, op, "gradients must hold the samples and their neighbours");
  require(m == 0 || n_weights > 0, op, "beside must hold indices of weights");
  if (type.on_cpu()) require(all_below<int64_t>(b, n_weights), op, "beside must hold indices of weights");
  Tensor losses = empty_like_type(g, {2}, type), eikonal_by = torch::stable::empty_like(g),
         smoothness_by = torch::stable::empty_like(g);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    T* smoothness = out<T>(smoothness_by);
    auto* scale = device.template scratch<double>(1);
    const T per_point = T(1) / T(max_of<int64_t>(n, 1));
    device.run(op, n, EikonalBody<T>{in<T>(g), per_point, out<T>(losses), out<T>(eikonal_by), smoothness});
    device.run(
        op, m,
        NormalPairsBody<T>{n, n_weights, m, in<T>(g), in<T>(w), in<int64_t>(b), out<T>(losses) + 1, smoothness, scale});
    device.run(op, 3 * n, ScaleBody<T>{scale, smoothness});
  });
  return {losses, eikonal_by, smoothness_by};
}

std::tuple<Tensor, Tensor> material_losses(Tensor albedo, Tensor metallic, Tensor shares, bool smooth_l1) {
  const char* op = "material_losses";
  const Kind type = real_kind(op, "metallic", metallic);
  const Tensor m = checked(op, "metallic", metallic, {kAny, 1}, type);
  const Tensor a = checked(op, "albedo", albedo, {m.size(0), 3}, type),
               s = checked(op, "shares", shares, {m.size(0)}, type);
  Tensor losses = empty_like_type(m, {3}, type), by_metallic = empty_like_type(m, {3, m.size(0)}, type);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    const int64_t n = m.size(0);
    auto* scale = device.template scratch<double>(1);
    device.run(
        op, n,
        MaterialLossesBody<T>{n, in<T>(a), in<T>(m), in<T>(s), smooth_l1, out<T>(losses), out<T>(by_metallic), scale});
    device.run(op, 3 * n, ScaleBody<T>{scale, out<T>(by_metallic)});
  });
  return {losses, by_metallic};
}

std::tuple<Tensor, Tensor> quadratic_entropy(Tensor x) {
  const char* op = "quadratic_entropy";
  const Kind type = real_kind(op, "x", x);
  const Tensor points = checked(op, "x", x, {kAny, kAny}, type);
  require(points.size(0) > 0, op, "x must hold at least one point");
  Tensor entropy = empty_like_type(points, {}, type), gradient = torch::stable::empty_like(points);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    const int64_t n = points.size(0), n_channels = points.size(1);
    T* rows = device.template scratch<T>(n * (n_channels + 1));
    auto* total = device.template scratch<double>(1);
    device.run(op, n, PairLikenessBody<T>{n, n_channels, in<T>(points), rows});
    device.run(op, n, EntropyBody<T>{n, n_channels, rows, out<T>(entropy), total});
    device.run(op, n * n_channels, EntropyGradientBody<T>{n_channels, rows, total, out<T>(gradient)});
  });
  return {entropy, gradient};
}

}  // namespace

STABLE_TORCH_LIBRARY_FRAGMENT(splitnerf, m) {
  m.def(
      "pixel_losses(Tensor mean, Tensor opacity, Tensor target, Tensor background, Tensor whole, bool linear) -> "
      "(Tensor, Tensor, "
      "Tensor, Tensor)");
  m.def("gradient_losses(Tensor gradients, Tensor weights, Tensor beside) -> (Tensor, Tensor, Tensor)");
  m.def("material_losses(Tensor albedo, Tensor metallic, Tensor shares, bool smooth_l1) -> (Tensor, Tensor)");
  m.def("quadratic_entropy(Tensor x) -> (Tensor, Tensor)");
}

SPLITNERF_IMPLEMENT(m) {
  m.impl("pixel_losses", TORCH_BOX(&pixel_losses));
  m.impl("gradient_losses", TORCH_BOX(&gradient_losses));
  m.impl("material_losses", TORCH_BOX(&material_losses));
  m.impl("quadratic_entropy", TORCH_BOX(&quadratic_entropy));
}

}  // namespace splitnerf::glue
