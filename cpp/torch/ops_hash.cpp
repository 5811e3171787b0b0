// hash_encode and its derivatives as torch operators.
#include <optional>
#include <tuple>

#include "check_hash.h"
#include "device.h"

namespace splitnerf::glue {
namespace {

struct Encoding {
  Tensor features, jacobian;
};

Encoding encode(const char* op, bool with_jacobian, const Tensor& positions, const Tensor& table, int64_t n_levels,
                int64_t base_resolution, double growth, int64_t log2_table_size, int64_t n_active,
                const std::optional<Tensor>& stored) {
  Table t(op, table, n_levels, base_resolution, growth, log2_table_size, n_active);
  if (stored) t.read(op, *stored);
  const Tensor x = checked(op, "positions", positions, {kAny, 3}, t.type);
  const int64_t n = x.size(0), columns = n_levels * t.shape.n_features;
  Encoding e{empty_like_type(x, {n, columns}, t.type), empty_like_type(x, {with_jacobian ? n : 0, 3, columns}, t.type)};
  on_device(t.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.hash_encode(t.shape, t.n_active, n, in<T>(x), t.view(), out<T>(e.features),
                       with_jacobian ? out<T>(e.jacobian) : nullptr);
  });
  return e;
}

Tensor hash_encode(Tensor positions, Tensor table, int64_t n_levels, int64_t base_resolution, double growth,
                   int64_t log2_table_size, int64_t n_active, std::optional<Tensor> stored) {
  return encode("hash_encode", false, positions, table, n_levels, base_resolution, growth, log2_table_size, n_active,
                stored)
      .features;
}

std::tuple<Tensor, Tensor> hash_encode_jacobian(Tensor positions, Tensor table, int64_t n_levels,
                                                int64_t base_resolution, double growth, int64_t log2_table_size,
                                                int64_t n_active, std::optional<Tensor> stored) {
  Encoding e = encode("hash_encode_jacobian", true, positions, table, n_levels, base_resolution, growth,
                      log2_table_size, n_active, stored);
  return {e.features, e.jacobian};
}

Tensor scatter(const char* op, const Tensor& positions, const Tensor& grad_features, const Tensor* grad_jacobian,
               int64_t n_levels, int64_t base_resolution, double growth, int64_t log2_table_size, int64_t n_active) {
  const Kind type = real_kind(op, "positions", positions);
  require(grad_features.dim() == 2 && n_levels > 0 && grad_features.size(1) % n_levels == 0, op,
          "grad_features must be [n, n_levels * n_features]");
  const int64_t columns = grad_features.size(1);
  const auto shape =
      checked_shape(op, n_levels, base_resolution, growth, log2_table_size, columns / n_levels, n_active);
  const Tensor x = checked(op, "positions", positions, {kAny, 3}, type);
  const Tensor g = checked(op, "grad_features", grad_features, {x.size(0), columns}, type);
  const Tensor gj = grad_jacobian ? checked(op, "grad_jacobian", *grad_jacobian, {x.size(0), 3, columns}, type) : g;
  Tensor grad_table = empty_like_type(x, {n_entries(shape), shape.n_features}, type);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.hash_encode_backward(shape, static_cast<int>(n_active), x.size(0), in<T>(x), in<T>(g),
                                grad_jacobian ? in<T>(gj) : nullptr, out<T>(grad_table));
  });
  return grad_table;
}

Tensor hash_encode_backward(Tensor positions, Tensor grad_features, int64_t n_levels, int64_t base_resolution,
                            double growth, int64_t log2_table_size, int64_t n_active) {
  return scatter("hash_encode_backward", positions, grad_features, nullptr, n_levels, base_resolution, growth,
                 log2_table_size, n_active);
}

Tensor hash_encode_jacobian_backward(Tensor positions, Tensor grad_features, Tensor grad_jacobian, int64_t n_levels,
                                     int64_t base_resolution, double growth, int64_t log2_table_size,
                                     int64_t n_active) {
  return scatter("hash_encode_jacobian_backward", positions, grad_features, &grad_jacobian, n_levels, base_resolution,
                 growth, log2_table_size, n_active);
}

Tensor hash_encode_jacobian_backward_positions(Tensor positions, Tensor table, Tensor grad_features,
                                               Tensor grad_jacobian, int64_t n_levels, int64_t base_resolution,
                                               double growth, int64_t log2_table_size, int64_t n_active) {
  const char* op = "hash_encode_jacobian_backward_positions";
  const Table t(op, table, n_levels, base_resolution, growth, log2_table_size, n_active);
  const int64_t columns = n_levels * t.shape.n_features;
  const Tensor x = checked(op, "positions", positions, {kAny, 3}, t.type);
  const Tensor g = checked(op, "grad_features", grad_features, {x.size(0), columns}, t.type);
  const Tensor gj = checked(op, "grad_jacobian", grad_jacobian, {x.size(0), 3, columns}, t.type);
  Tensor grad_positions = empty_like_type(x, {x.size(0), 3}, t.type);
  on_device(t.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.hash_encode_backward_positions(t.shape, t.n_active, x.size(0), in<T>(x), t.view(), in<T>(g), in<T>(gj),
                                          out<T>(grad_positions));
  });
  return grad_positions;
}

}  // namespace

#define SPLITNERF_GRID "int n_levels, int base_resolution, float growth, int log2_table_size, int n_active"
STABLE_TORCH_LIBRARY_FRAGMENT(splitnerf, m) {
  m.def("hash_encode(Tensor positions, Tensor table, " SPLITNERF_GRID ", Tensor? stored=None) -> Tensor");
  m.def("hash_encode_backward(Tensor positions, Tensor grad_features, " SPLITNERF_GRID ") -> Tensor");
  m.def("hash_encode_jacobian(Tensor positions, Tensor table, " SPLITNERF_GRID
        ", Tensor? stored=None) -> (Tensor, Tensor)");
  m.def("hash_encode_jacobian_backward(Tensor positions, Tensor grad_features, Tensor grad_jacobian, " SPLITNERF_GRID
        ") -> Tensor");
  m.def(
      "hash_encode_jacobian_backward_positions(Tensor positions, Tensor table, Tensor grad_features, "
      "Tensor grad_jacobian, " SPLITNERF_GRID ") -> Tensor");
}

SPLITNERF_IMPLEMENT(m) {
  m.impl("hash_encode", TORCH_BOX(&hash_encode));
  m.impl("hash_encode_backward", TORCH_BOX(&hash_encode_backward));
  m.impl("hash_encode_jacobian", TORCH_BOX(&hash_encode_jacobian));
  m.impl("hash_encode_jacobian_backward", TORCH_BOX(&hash_encode_jacobian_backward));
  m.impl("hash_encode_jacobian_backward_positions", TORCH_BOX(&hash_encode_jacobian_backward_positions));
}

}  // namespace splitnerf::glue
