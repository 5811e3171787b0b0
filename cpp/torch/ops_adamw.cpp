// A step of AdamW as a torch operator that writes to its arguments.
#include <optional>

#include "device.h"

namespace splitnerf::glue {
namespace {

std::string shape_of(const Tensor& t) {
  std::string text;
  for (int64_t i = 0; i < t.dim(); ++i) text += (i ? ", " : "") + std::to_string(t.size(i));
  return "[" + text + "]";
}

void require_like(const char* op, const char* name, const Tensor& t, const Tensor& param, const Kind& kind) {
  const Device device = t.device();
  bool fits = t.scalar_type() == kind.type && t.dim() == param.dim() && device == kind.device;
  for (int64_t i = 0; fits && i < t.dim(); ++i) fits = t.size(i) == param.size(i);
  require(fits, op,
          std::string(name) + " must be " + shape_of(param) + " " + describe(kind.type) + " on " +
              describe(kind.device) + ", got " + shape_of(t) + " " + describe(t.scalar_type()) + " on " +
              describe(device));
}

// A tensor that is written to, and so never by way of a copy.
template <class T> T* written(const char* op, const char* name, Tensor& t, const Tensor& param, const Kind& kind) {
  require_like(op, name, t, param, kind);
  require(t.is_contiguous(), op, std::string(name) + " must be contiguous, as it is written to");
  return reinterpret_cast<T*>(t.mutable_data_ptr());
}

void adamw_step(Tensor param, Tensor grad, Tensor exp_avg, Tensor exp_avg_sq, double lr, double beta1, double beta2,
                double eps, double weight_decay, int64_t step, bool sparse, std::optional<Tensor> copy) {
  const char* op = "adamw_step_";
  const Kind kind = real_kind(op, "param", param);
  const auto in_range = [&](const char* name, bool fits, const char* range, double got) {
    require(fits, op, std::string(name) + " must be " + range + ", got " + std::to_string(got));
  };
  in_range("lr", lr >= 0, "at least 0", lr), in_range("eps", eps >= 0, "at least 0", eps);
  in_range("beta1", beta1 >= 0 && beta1 < 1, "in [0, 1)", beta1);
  in_range("beta2", beta2 >= 0 && beta2 < 1, "in [0, 1)", beta2);
  in_range("weight_decay", weight_decay >= 0, "at least 0", weight_decay);
  require(step >= 1, op, "step must be at least 1, got " + std::to_string(step));
  require_like(op, "grad", grad, param, kind);
  const Tensor g = torch::stable::contiguous(grad);
  const ScalarType copied = copy ? copy->scalar_type() : ScalarType::Half;
  require(copied == ScalarType::Half || copied == ScalarType::BFloat16, op,
          "copy must be float16 or bfloat16, got " + describe(copied));
  on_device(kind, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    AdamwArrays<T> x{param.numel(),
                     param.dim() ? param.size(param.dim() - 1) : 1,
                     sparse,
                     written<T>(op, "param", param, param, kind),
                     in<T>(g),
                     written<T>(op, "exp_avg", exp_avg, param, kind),
                     written<T>(op, "exp_avg_sq", exp_avg_sq, param, kind),
                     nullptr,
                     nullptr};
    if (copy && copied == ScalarType::Half) x.half = written<Half>(op, "copy", *copy, param, kind.with(copied));
    if (copy && copied == ScalarType::BFloat16)
      x.bfloat16 = written<Bfloat16>(op, "copy", *copy, param, kind.with(copied));
    device.run(op, x.n, AdamwBody<T>{AdamwRule<T>(lr, beta1, beta2, eps, weight_decay, step), x});
  });
}

}  // namespace

STABLE_TORCH_LIBRARY_FRAGMENT(splitnerf, m) {
  m.def(
      "adamw_step_(Tensor(a!) param, Tensor grad, Tensor(b!) exp_avg, Tensor(c!) exp_avg_sq, float lr, float beta1, "
      "float beta2, float eps, float weight_decay, int step, bool sparse, Tensor(d!)? copy=None) -> ()");
}

SPLITNERF_IMPLEMENT(m) { m.impl("adamw_step_", TORCH_BOX(&adamw_step)); }

}  // namespace splitnerf::glue
