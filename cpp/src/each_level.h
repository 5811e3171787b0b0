// The gradient to a hash grid's table, level by level.
#pragma once

#include <algorithm>

#include "huge_pages.h"
#include "splitnerf/kernels.h"
#include "splitnerf/parallel.h"

namespace splitnerf::cpu {

// Zeros grad_table and calls add(level) for each open level. Levels are spread over the threads, so that no two threads write one
// entry: no atomics, and the same bits each time.
template <class T, class Add> void for_each_level(const HashEncodeArgs<T>& grid, T* grad_table, const Add& add) {
  const HashLevel& last = grid.levels[grid.n_levels - 1];
  prefer_huge_pages(grad_table, (last.offset + last.n_entries) * grid.n_features * sizeof(T));
  parallel_for(grid.n_levels, 1, [&](int64_t begin, int64_t end) {
    for (int64_t l = begin; l < end; ++l) {
      const HashLevel& level = grid.levels[l];
      std::fill_n(grad_table + level.offset * grid.n_features, level.n_entries * grid.n_features, T(0));
      if (l < grid.n_active) add(static_cast<int>(l));
    }
  });
}

}  // namespace splitnerf::cpu
