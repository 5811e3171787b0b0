// Argument checks of the operators that read a hash grid.
#pragma once

#include <array>

#include "check.h"
#include "splitnerf/hash_grid.h"

namespace splitnerf::glue {

inline HashGridShape checked_shape(const char* op, int64_t n_levels, int64_t base_resolution, double growth,
                                   int64_t log2_table_size, int64_t n_features, int64_t n_active) {
  const std::string error = hash_shape_error(n_levels, n_features, base_resolution, growth, log2_table_size);
  require(error.empty(), op, error);
  require(n_active >= 0 && n_active <= n_levels, op,
          "n_active must be in [0, n_levels], got " + std::to_string(n_active));
  return {static_cast<int>(n_levels), static_cast<int>(n_features), static_cast<int>(base_resolution), growth,
          static_cast<int>(log2_table_size)};
}

inline int64_t n_entries(const HashGridShape& shape) {
  std::array<HashLevel, kMaxLevels> levels;
  return hash_levels(shape, levels.data());
}

// A hash grid's table, and what is computed with: for one of float16 float32.
struct Table {
  HashGridShape shape;
  Kind type;
  Tensor entries;
  int n_active;

  Table(const char* op, const Tensor& table, int64_t n_levels, int64_t base_resolution, double growth,
        int64_t log2_table_size, int64_t n_active)
      : shape(checked_shape(op, n_levels, base_resolution, growth, log2_table_size, features(op, table), n_active)),
        type(compute_kind(op, table)),
        entries(checked(op, "table", table, {n_entries(shape), shape.n_features}, type.with(table.scalar_type()))),
        n_active(static_cast<int>(n_active)) {}

  // Reads another tensor of the same shape in place of the table.
  void read(const char* op, const Tensor& stored) {
    require(type == ScalarType::Float && stored.scalar_type() == ScalarType::Half, op,
            "stored must be float16 beside a float32 table, got " + describe(stored.scalar_type()) + " beside " +
                describe(type));
    entries = checked(op, "stored", stored, {n_entries(shape), shape.n_features}, type.with(stored.scalar_type()));
  }

  HashTable view() const {
    switch (entries.scalar_type()) {
      case ScalarType::Half:
        return in<Half>(entries);
      case ScalarType::Float:
        return in<float>(entries);
      default:
        return in<double>(entries);
    }
  }

 private:
  static int64_t features(const char* op, const Tensor& table) {
    require(table.dim() == 2, op, "table must be [n_entries, n_features]");
    return table.size(1);
  }
  static Kind compute_kind(const char* op, const Tensor& table) {
    const ScalarType type = table.scalar_type();
    if (type == ScalarType::Half) return {ScalarType::Float, table.device()};
    require(type == ScalarType::Float || type == ScalarType::Double, op,
            "table must be float32, float64 or float16, got " + describe(type));
    return {type, table.device()};
  }
};

}  // namespace splitnerf::glue
