// linear_to_srgb and srgb_to_linear as torch operators, of tensors of any shape.
#include "device.h"
#include "splitnerf/bodies/elementwise.h"

namespace splitnerf::glue {
namespace {

// Calls body(tensor, result, T{}, device) with the tensor contiguous and an empty one like it.
template <class Body> Tensor elementwise(const char* op, const char* name, const Tensor& values, Body&& body) {
  const Kind type = real_kind(op, name, values);
  const Tensor x = torch::stable::contiguous(values);
  Tensor result = torch::stable::empty_like(x);
  on_device(type, [&](auto zero, const auto& device) { body(x, result, zero, device); });
  return result;
}

Tensor linear_to_srgb(Tensor linear) {
  return elementwise("linear_to_srgb", "linear", linear, [](const Tensor& x, Tensor& y, auto zero, const auto& device) {
    using T = decltype(zero);
    device.run("linear_to_srgb", x.numel(), LinearToSrgbBody<T>{in<T>(x), out<T>(y)});
  });
}

Tensor linear_to_srgb_backward(Tensor linear, Tensor grad_srgb) {
  const char* op = "linear_to_srgb_backward";
  require(grad_srgb.scalar_type() == linear.scalar_type() && grad_srgb.numel() == linear.numel() &&
              grad_srgb.device() == linear.device(),
          op, "grad_srgb must be like linear");
  const Tensor g = torch::stable::contiguous(grad_srgb);
  return elementwise(op, "linear", linear, [&](const Tensor& x, Tensor& y, auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, x.numel(), LinearToSrgbBackwardBody<T>{in<T>(x), in<T>(g), out<T>(y)});
  });
}

Tensor srgb_to_linear(Tensor srgb) {
  return elementwise("srgb_to_linear", "srgb", srgb, [](const Tensor& x, Tensor& y, auto zero, const auto& device) {
    using T = decltype(zero);
    device.run("srgb_to_linear", x.numel(), SrgbToLinearBody<T>{in<T>(x), out<T>(y)});
  });
}

}  // namespace

SPLITNERF_OPERATORS(op) {
  op(SPLITNERF_OP(linear_to_srgb), "linear");
  op(SPLITNERF_OP(linear_to_srgb_backward), "linear grad_srgb");
  op(SPLITNERF_OP(srgb_to_linear), "srgb");
}

}  // namespace splitnerf::glue
