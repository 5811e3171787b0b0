// Rows of several arrays, chosen by one list of their numbers, and the sums of gradients at those rows.
#pragma once

#include "splitnerf/accumulate.h"

namespace splitnerf {

inline constexpr int kMostRowArrays = 16;

// Pairs of arrays, [rows, columns] and [m, columns], all numbers of one of each in one list.
template <class T> struct RowArrays {
  int n_arrays = 0;
  int64_t ends[kMostRowArrays] = {}, rows[kMostRowArrays], columns[kMostRowArrays];
  const T* from[kMostRowArrays];
  T* to[kMostRowArrays];

  // The list holds the numbers of `listed` rows.
  void add(int64_t listed, int64_t its_rows, int64_t its_columns, const T* source, T* target) {
    ends[n_arrays] = count() + listed * its_columns;
    rows[n_arrays] = its_rows, columns[n_arrays] = its_columns, from[n_arrays] = source, to[n_arrays++] = target;
  }
  int64_t count() const { return n_arrays ? ends[n_arrays - 1] : 0; }
  SPLITNERF_HD int array_of(int64_t i) const {
    int k = 0;
    while (i >= ends[k]) ++k;
    return k;
  }
};

template <class T> struct TakeRowsBody {
  const int64_t* index;
  RowArrays<T> arrays;

  SPLITNERF_HD void operator()(int64_t i) const {
    const int k = arrays.array_of(i);
    const int64_t columns = arrays.columns[k], j = i - (k ? arrays.ends[k - 1] : 0);
    // On the CPU `index` has been checked. On the GPU it has not; any value keeps all accesses inside the arrays.
    const int64_t row = clamp<int64_t>(index[j / columns], 0, arrays.rows[k] - 1);
    arrays.to[k][j] = arrays.from[k][row * columns + j % columns];
  }
};
SPLITNERF_ON_GPU(TakeRowsBody);

template <class T> struct ClearArraysBody {
  RowArrays<T> arrays;

  SPLITNERF_HD void operator()(int64_t i) const {
    const int k = arrays.array_of(i);
    arrays.to[k][i - (k ? arrays.ends[k - 1] : 0)] = T(0);
  }
};
SPLITNERF_ON_GPU(ClearArraysBody);

// Clears unless a flag is true.
template <class T> struct ClearUnlessBody {
  const bool* kept;
  ClearArraysBody<T> clear;

  SPLITNERF_HD void operator()(int64_t i) const {
    if (!*kept) clear(i);
  }
};
SPLITNERF_ON_GPU(ClearUnlessBody);

template <class T> struct AddRowsBody {
  static constexpr bool adds_to_shared = true;
  const int64_t* index;
  RowArrays<T> arrays;

  SPLITNERF_HD void operator()(int64_t i) const {
    const int k = arrays.array_of(i);
    const int64_t columns = arrays.columns[k], j = i - (k ? arrays.ends[k - 1] : 0);
    const int64_t row = clamp<int64_t>(index[j / columns], 0, arrays.rows[k] - 1);
    add_to(arrays.to[k] + row * columns + j % columns, arrays.from[k][j]);
  }
};
SPLITNERF_ON_GPU(AddRowsBody);

}  // namespace splitnerf
