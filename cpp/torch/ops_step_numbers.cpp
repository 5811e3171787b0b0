// step_numbers as a torch operator.
#include <tuple>
#include <vector>

#include "device.h"
#include "splitnerf/bodies/step_numbers.h"

namespace splitnerf::glue {
namespace {

// Numbers per item: on a GPU a thread reads 16 bytes, on the CPU a run long enough not to count the items' own cost.
constexpr int64_t kOnGpu = 4, kOnCpu = 4096;

// A contiguous tensor of any shape. It is read number by number, so it need not begin where several can be read at once.
Tensor flat(const char* op, const char* name, const Tensor& t, const Kind& kind) {
  const Device device = t.device();
  require(t.scalar_type() == kind.type && device.type() == kind.device.type() &&
              (kind.on_cpu() || device.index() == kind.device.index()),
          op,
          std::string(name) + " must be " + describe(kind.type) + " on " + describe(kind.device) + ", got " +
              describe(t.scalar_type()) + " on " + describe(device));
  return torch::stable::contiguous(t);
}

std::vector<Tensor> all_flat(const char* op, const char* name, const std::vector<Tensor>& tensors, const Kind& kind) {
  std::vector<Tensor> found;
  for (const Tensor& t : tensors) found.push_back(flat(op, name, t, kind));
  return found;
}

// Adds the places of all numbers of the tensors; returns how many there are now.
template <class T> int places(const char* op, const char* name, const std::vector<Tensor>& tensors, int most, const T** to) {
  int64_t n = 0;
  for (const Tensor& t : tensors) {
    require(n + t.numel() <= most, op, std::string(name) + " must hold at most " + std::to_string(most) + " numbers");
    for (int64_t i = 0; i < t.numel(); ++i) to[n++] = in<T>(t) + i;
  }
  return static_cast<int>(n);
}

std::tuple<Tensor, Tensor> step_numbers(std::vector<Tensor> gradients, std::vector<Tensor> terms,
                                        std::vector<Tensor> counts, Tensor evaluated, Tensor s, Tensor limits) {
  const char* op = "step_numbers";
  const Kind type = real_kind(op, "limits", limits), whole = type.with(ScalarType::Long);
  require(gradients.size() <= kMostGradients, op, "gradients must be at most " + std::to_string(kMostGradients));
  const auto g = all_flat(op, "gradients", gradients, type), t = all_flat(op, "terms", terms, type),
             c = all_flat(op, "counts", counts, whole);
  const Tensor asked = checked(op, "evaluated", evaluated, {kAny}, whole), sharpness = flat(op, "s", s, type);
  require(sharpness.numel() == 1, op, "s must be one number");
  int64_t n = 3;  // norm, evaluated, s
  for (const auto* list : {&t, &c})
    for (const Tensor& x : *list) n += x.numel();
  const Tensor bounds = checked(op, "limits", limits, {n}, type);
  Tensor numbers = empty_like_type(bounds, {n}, type), allowed = empty_like_type(bounds, {}, ScalarType::Bool);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    StepNumbersBody<T> body;
    body.per_item = type.on_cpu() ? kOnCpu : kOnGpu;
    for (const Tensor& x : g) body.add_gradient(in<T>(x), x.numel());
    body.n_terms = places<T>(op, "terms", t, kMostTerms, body.terms);
    body.n_counts = places<int64_t>(op, "counts", c, kMostCounts, body.counts);
    body.n_evaluated = asked.numel(), body.evaluated = in<int64_t>(asked), body.s = in<T>(sharpness);
    body.limits = in<T>(bounds), body.numbers = out<T>(numbers), body.allowed = out<bool>(allowed);
    device.run(op, body.count(), body);
  });
  return {numbers, allowed};
}

}  // namespace

STABLE_TORCH_LIBRARY_FRAGMENT(splitnerf, m) {
  m.def(
      "step_numbers(Tensor[] gradients, Tensor[] terms, Tensor[] counts, Tensor evaluated, Tensor s, Tensor limits) -> "
      "(Tensor, Tensor)");
}

SPLITNERF_IMPLEMENT(m) { m.impl("step_numbers", TORCH_BOX(&step_numbers)); }

}  // namespace splitnerf::glue
