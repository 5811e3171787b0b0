// pixel_losses, gradient_losses and quadratic_entropy as torch operators. The last one finds its gradient in
// the same pass; those of the others find the gradients anew, and read the sums that they divide by.
#include <optional>
#include <tuple>

#include "device.h"

namespace splitnerf::glue {
namespace {

using std::optional;

// Pixels and photos, checked and contiguous.
struct Pixels {
  Kind type;
  Tensor mean, opacity, target, background;
  optional<Tensor> whole, exposure;
  bool linear;

  Pixels(const char* op, const Tensor& mean_in, const Tensor& opacity_in, const Tensor& target_in,
         const Tensor& background_in, const optional<Tensor>& whole_in, const optional<Tensor>& exposure_in,
         bool linear)
      : type(real_kind(op, "mean", mean_in)), mean(checked(op, "mean", mean_in, {kAny, 3}, type)),
        opacity(checked(op, "opacity", opacity_in, {n()}, type)),
        target(checked(op, "target", target_in, {n(), 4}, type)),
        background(checked(op, "background", background_in, {n(), 3}, type)), linear(linear) {
    if (whole_in) whole = checked(op, "whole", *whole_in, {n()}, type.with(ScalarType::Bool));
    if (exposure_in) exposure = checked(op, "exposure", *exposure_in, {n(), 3}, type);
  }
  int64_t n() const { return mean.size(0); }
  template <class T> PixelArrays<T> view() const {
    return {n(),
            in<T>(mean),
            in<T>(opacity),
            in<T>(target),
            in<T>(background),
            exposure ? in<T>(*exposure) : nullptr,
            whole ? in<bool>(*whole) : nullptr,
            linear};
  }
};

Tensor pixel_losses(Tensor mean, Tensor opacity, Tensor target, Tensor background, optional<Tensor> whole,
                    optional<Tensor> exposure, bool linear) {
  const char* op = "pixel_losses";
  const Pixels x(op, mean, opacity, target, background, whole, exposure, linear);
  Tensor losses = empty_like_type(x.mean, {2}, x.type);
  on_device(x.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, x.n(), PixelLossesBody<T>{x.view<T>(), out<T>(losses)});
  });
  return losses;
}

std::tuple<Tensor, Tensor> pixel_losses_backward(Tensor mean, Tensor opacity, Tensor target, Tensor background,
                                                 optional<Tensor> whole, optional<Tensor> exposure, bool linear,
                                                 Tensor grad_losses) {
  const char* op = "pixel_losses_backward";
  const Pixels x(op, mean, opacity, target, background, whole, exposure, linear);
  const Tensor g = checked(op, "grad_losses", grad_losses, {2}, x.type);
  Tensor grad_mean = empty_like_type(x.mean, {x.n(), 3}, x.type), grad_opacity = empty_like_type(g, {x.n()}, x.type);
  on_device(x.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, x.n(), PixelLossesBackwardBody<T>{x.view<T>(), in<T>(g), out<T>(grad_mean), out<T>(grad_opacity)});
  });
  return {grad_mean, grad_opacity};
}

// Gradients of a field and pairs of them, checked and contiguous.
struct Gradients {
  Kind type;
  Tensor gradients, weights, beside;

  Gradients(const char* op, const Tensor& gradients_in, const Tensor& weights_in, const Tensor& beside_in)
      : type(real_kind(op, "gradients", gradients_in)),
        gradients(checked(op, "gradients", gradients_in, {kAny, 3}, type)),
        weights(checked(op, "weights", weights_in, {kAny}, type)),
        beside(checked(op, "beside", beside_in, {kAny}, type.with(ScalarType::Long))) {
    require(weights.size(0) + m() <= n(), op, "gradients must hold the samples and their neighbours");
    require(m() == 0 || weights.size(0) > 0, op, "beside must hold indices of weights");
    if (type.on_cpu()) require(all_below<int64_t>(beside, weights.size(0)), op, "beside must hold indices of weights");
  }
  int64_t n() const { return gradients.size(0); }
  int64_t m() const { return beside.size(0); }
  template <class T> GradientArrays<T> view() const {
    return {n(), weights.size(0), m(), in<T>(gradients), in<T>(weights), in<int64_t>(beside)};
  }
};

std::tuple<Tensor, Tensor> gradient_losses(Tensor gradients, Tensor weights, Tensor beside) {
  const char* op = "gradient_losses";
  const Gradients x(op, gradients, weights, beside);
  Tensor losses = empty_like_type(x.gradients, {2}, x.type), total = empty_like_type(x.gradients, {}, x.type);
  on_device(x.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, x.n() + x.m(), GradientLossesBody<T>{x.view<T>(), out<T>(losses), out<T>(total)});
  });
  return {losses, total};
}

Tensor gradient_losses_backward(Tensor gradients, Tensor weights, Tensor beside, Tensor total, Tensor grad_losses) {
  const char* op = "gradient_losses_backward";
  const Gradients x(op, gradients, weights, beside);
  const Tensor sum = checked(op, "total", total, {}, x.type), g = checked(op, "grad_losses", grad_losses, {2}, x.type);
  Tensor grad_gradients = empty_like_type(g, {x.n(), 3}, x.type);
  on_device(x.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    const GradientLossesBackwardBody<T> body{x.view<T>(), in<T>(sum), in<T>(g), out<T>(grad_gradients)};
    device.run(op, x.n(), body);
    device.run(op, x.m(), SamplesOfPairsBackwardBody<T>{body});
  });
  return grad_gradients;
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

SPLITNERF_OPERATORS(op) {
  op(SPLITNERF_OP(pixel_losses), "mean opacity target background whole exposure linear");
  op(SPLITNERF_OP(pixel_losses_backward), "mean opacity target background whole exposure linear grad_losses");
  op(SPLITNERF_OP(gradient_losses), "gradients weights beside");
  op(SPLITNERF_OP(gradient_losses_backward), "gradients weights beside total grad_losses");
  op(SPLITNERF_OP(quadratic_entropy), "x");
}

}  // namespace splitnerf::glue
