// A step of AdamW of many parameters in one launch, as a torch operator that writes to its arguments.
#include <optional>
#include <vector>

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

// What all parameters of a step share.
struct Settings {
  double beta1, beta2, eps;
};

// A parameter's arrays and rule, checked. The gradient is contiguous and lives as long as the caller's.
template <class T>
AdamwBody<T> step_of(const char* op, Tensor& param, const Tensor& grad, Tensor& exp_avg, Tensor& exp_avg_sq, double lr,
                     const Settings& all, double weight_decay, int64_t step, bool sparse, Tensor* copy,
                     const Kind& kind) {
  const auto in_range = [&](const char* name, bool fits, const char* range, double got) {
    require(fits, op, std::string(name) + " must be " + range + ", got " + std::to_string(got));
  };
  in_range("lr", lr >= 0, "at least 0", lr), in_range("eps", all.eps >= 0, "at least 0", all.eps);
  in_range("beta1", all.beta1 >= 0 && all.beta1 < 1, "in [0, 1)", all.beta1);
  in_range("beta2", all.beta2 >= 0 && all.beta2 < 1, "in [0, 1)", all.beta2);
  in_range("weight_decay", weight_decay >= 0, "at least 0", weight_decay);
  require(step >= 1, op, "step must be at least 1, got " + std::to_string(step));
  const AdamwArrays<T> x{param.numel(),
                         param.dim() ? param.size(param.dim() - 1) : 1,
                         sparse,
                         written<T>(op, "param", param, param, kind),
                         in<T>(grad),
                         written<T>(op, "exp_avg", exp_avg, param, kind),
                         written<T>(op, "exp_avg_sq", exp_avg_sq, param, kind),
                         copy ? written<Half>(op, "copy", *copy, param, kind.with(ScalarType::Half)) : nullptr};
  return {AdamwRule<T>(lr, all.beta1, all.beta2, all.eps, weight_decay, step), x};
}
Tensor dense_gradient(const char* op, const Tensor& grad, const Tensor& param, const Kind& kind) {
  require_like(op, "grad", grad, param, kind);
  return torch::stable::contiguous(grad);
}

void adamw_steps_(std::vector<Tensor> params, std::vector<Tensor> grads, std::vector<Tensor> exp_avgs,
                  std::vector<Tensor> exp_avg_sqs, std::vector<double> lrs, double beta1, double beta2, double eps,
                  std::vector<double> weight_decays, std::vector<int64_t> steps, std::vector<bool> sparse,
                  std::vector<Tensor> copies, std::vector<int64_t> copied, std::optional<Tensor> allowed) {
  const char* op = "adamw_steps_";
  const size_t n = params.size();
  require(n > 0, op, "params must hold a tensor");
  const auto as_many = [&](const char* name, size_t size, size_t wanted) {
    require(size == wanted, op,
            std::string(name) + " must hold " + std::to_string(wanted) + ", got " + std::to_string(size));
  };
  as_many("grads", grads.size(), n), as_many("exp_avgs", exp_avgs.size(), n),
      as_many("exp_avg_sqs", exp_avg_sqs.size(), n);
  as_many("lrs", lrs.size(), n), as_many("weight_decays", weight_decays.size(), n), as_many("steps", steps.size(), n);
  as_many("sparse", sparse.size(), n), as_many("copied", copied.size(), copies.size());
  std::vector<Tensor*> copy_of(n, nullptr);
  for (size_t k = 0; k < copies.size(); ++k) {
    require(copied[k] >= 0 && copied[k] < int64_t(n), op, "copied must hold positions in params");
    require(!copy_of[size_t(copied[k])], op, "copied must hold no position twice");
    copy_of[size_t(copied[k])] = &copies[k];
  }
  const Kind kind = real_kind(op, "params", params[0]);
  for (size_t k = 0; k < n; ++k) {
    require_like(op, "params", params[k], params[k], kind);  // one dtype, one device
    grads[k] = dense_gradient(op, grads[k], params[k], kind);
  }
  std::optional<Tensor> flag;
  if (allowed) flag = checked(op, "allowed", *allowed, {}, kind.with(ScalarType::Bool));
  on_device(kind, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    std::vector<AdamwListBody<T>> lists(1);
    for (size_t k = 0; k < n; ++k) {
      if (lists.back().n_arrays == kMostAdamwArrays) lists.emplace_back();
      lists.back().add(step_of<T>(op, params[k], grads[k], exp_avgs[k], exp_avg_sqs[k], lrs[k], {beta1, beta2, eps},
                                  weight_decays[k], steps[k], sparse[k], copy_of[k], kind));
    }
    for (AdamwListBody<T>& list : lists) {
      list.allowed = flag ? in<bool>(*flag) : nullptr;
      device.run(op, list.count(), list);
    }
  });
}

}  // namespace

SPLITNERF_OPERATORS(op) {
  op(SPLITNERF_OP(adamw_steps_),
     "params(a!) grads exp_avgs(b!) exp_avg_sqs(c!) lrs beta1 beta2 eps weight_decays steps sparse copies(d!) copied "
     "allowed=None");
}

}  // namespace splitnerf::glue
