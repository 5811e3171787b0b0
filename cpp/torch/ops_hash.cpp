// hash_encode and its derivatives as torch operators.
#include <optional>

#include "check_hash.h"
#include "device.h"

namespace splitnerf::glue {
namespace {

Tensor hash_encode(Tensor positions, Tensor table, int64_t n_levels, int64_t base_resolution, double growth,
                   int64_t log2_table_size, int64_t n_active, std::optional<Tensor> stored) {
  const char* op = "hash_encode";
  Table t(op, table, n_levels, base_resolution, growth, log2_table_size, n_active);
  if (stored) t.read(op, *stored);
  const Tensor x = checked(op, "positions", positions, {kAny, 3}, t.type);
  Tensor features = empty_like_type(x, {x.size(0), n_levels * t.shape.n_features}, t.type);
  on_device(t.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.hash_encode(t.shape, t.n_active, x.size(0), in<T>(x), t.view(), out<T>(features));
  });
  return features;
}

Tensor hash_encode_backward(Tensor positions, Tensor grad_features, int64_t n_levels, int64_t base_resolution,
                            double growth, int64_t log2_table_size, int64_t n_active) {
  const char* op = "hash_encode_backward";
  const Kind type = real_kind(op, "positions", positions);
  require(grad_features.dim() == 2 && n_levels > 0 && grad_features.size(1) % n_levels == 0, op,
          "grad_features must be [n, n_levels * n_features]");
  const int64_t columns = grad_features.size(1);
  const auto shape =
      checked_shape(op, n_levels, base_resolution, growth, log2_table_size, columns / n_levels, n_active);
  const Tensor x = checked(op, "positions", positions, {kAny, 3}, type);
  const Tensor g = checked(op, "grad_features", grad_features, {x.size(0), columns}, type);
  Tensor grad_table = empty_like_type(x, {n_entries(shape), shape.n_features}, type);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.hash_encode_backward(shape, static_cast<int>(n_active), x.size(0), in<T>(x), in<T>(g), out<T>(grad_table));
  });
  return grad_table;
}

Tensor hash_encode_backward_positions(Tensor positions, Tensor table, Tensor grad_features, int64_t n_levels,
                                      int64_t base_resolution, double growth, int64_t log2_table_size,
                                      int64_t n_active) {
  const char* op = "hash_encode_backward_positions";
  const Table t(op, table, n_levels, base_resolution, growth, log2_table_size, n_active);
  const Tensor x = checked(op, "positions", positions, {kAny, 3}, t.type);
  const Tensor g = checked(op, "grad_features", grad_features, {x.size(0), n_levels * t.shape.n_features}, t.type);
  Tensor grad_positions = empty_like_type(x, {x.size(0), 3}, t.type);
  on_device(t.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.hash_encode_backward_positions(t.shape, t.n_active, x.size(0), in<T>(x), t.view(), in<T>(g),
                                          out<T>(grad_positions));
  });
  return grad_positions;
}

}  // namespace

SPLITNERF_OPERATORS(op) {
  op(SPLITNERF_OP(hash_encode), "positions table n_levels base_resolution growth log2_table_size n_active stored=None");
  op(SPLITNERF_OP(hash_encode_backward),
     "positions grad_features n_levels base_resolution growth log2_table_size n_active");
  op(SPLITNERF_OP(hash_encode_backward_positions),
     "positions table grad_features n_levels base_resolution growth log2_table_size n_active");
}

}  // namespace splitnerf::glue
