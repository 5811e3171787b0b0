// quadratic_entropy as a torch operator.
#include <tuple>

#include "check.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf::glue {
namespace {

std::tuple<Tensor, Tensor> quadratic_entropy(Tensor x) {
  const char* op = "quadratic_entropy";
  const ScalarType type = real_type(op, "x", x);
  const Tensor points = checked(op, "x", x, {kAny, kAny}, type);
  require(points.size(0) > 0, op, "x must hold at least one point");
  Tensor entropy = empty_like_type(points, {}, type), gradient = torch::stable::empty_like(points);
  dispatch_real(type, [&](auto zero) {
    using T = decltype(zero);
    cpu::quadratic_entropy(points.size(0), points.size(1), in<T>(points), out<T>(entropy), out<T>(gradient));
  });
  return {entropy, gradient};
}

}  // namespace

STABLE_TORCH_LIBRARY_FRAGMENT(splitnerf, m) { m.def("quadratic_entropy(Tensor x) -> (Tensor, Tensor)"); }

STABLE_TORCH_LIBRARY_IMPL(splitnerf, CPU, m) { m.impl("quadratic_entropy", TORCH_BOX(&quadratic_entropy)); }

}  // namespace splitnerf::glue
