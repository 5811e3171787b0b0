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

}  // namespace splitnerf::glue
