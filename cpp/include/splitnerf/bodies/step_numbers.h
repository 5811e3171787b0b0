// The numbers of a training step, and whether it may be taken.
#pragma once

#include "splitnerf/run.h"
#include "splitnerf/vec.h"

namespace splitnerf {

inline constexpr int kMostGradients = 96, kMostTerms = 24, kMostCounts = 8;  // a GPU's kernel takes them as arguments, 3 KB

// Lists the terms of the loss, the norm of all gradients, some counts, the sum of `evaluated`, and s; `allowed` tells whether each
// is below its limit. An item is `per_item` numbers of one gradient or, behind those of all gradients, one number of `evaluated`.
template <class T> struct StepNumbersBody {
  static constexpr int n_sums = 2;  // of the gradients' squares, and of what was evaluated
  int64_t per_item;
  int n_gradients = 0, n_terms = 0, n_counts = 0;
  int64_t ends[kMostGradients], sizes[kMostGradients];  // of items, of numbers
  const T *gradients[kMostGradients], *terms[kMostTerms];
  const int64_t* counts[kMostCounts];
  int64_t n_evaluated;
  const int64_t* evaluated;
  const T *s, *limits;
  T* numbers;
  bool* allowed;

  void add_gradient(const T* values, int64_t size) {
    ends[n_gradients] = n_items() + (size + per_item - 1) / per_item;
    gradients[n_gradients] = values, sizes[n_gradients++] = size;
  }
  SPLITNERF_HD int64_t n_items() const { return n_gradients ? ends[n_gradients - 1] : 0; }
  int64_t count() const { return n_items() + n_evaluated; }

  SPLITNERF_HD void operator()(int64_t i, double* sums) const {
    if (i >= n_items()) {
      sums[1] += double(evaluated[i - n_items()]);
      return;
    }
    int k = 0;
    while (i >= ends[k]) ++k;
    const int64_t begin = (i - (k ? ends[k - 1] : 0)) * per_item;
    sums[0] += squares(gradients[k] + begin, min_of(per_item, sizes[k] - begin));
  }
  // Called once.
  SPLITNERF_HD void finish(const double* sums) const {
    int at = 0;
    bool all = true;
    const auto put = [&](T value) {
      numbers[at] = value;
      all = all && std::fabs(value) < limits[at];  // false for NaN
      ++at;
    };
    for (int k = 0; k < n_terms; ++k) put(*terms[k]);
    put(T(std::sqrt(sums[0])));
    for (int k = 0; k < n_counts; ++k) put(T(*counts[k]));
    put(T(sums[1])), put(*s);
    *allowed = all;
  }

 private:
  // In runs side by side, which a compiler computes at once.
  SPLITNERF_HD static double squares(const T* x, int64_t n) {
    constexpr int kRuns = 8;
    T runs[kRuns] = {};
    int64_t j = 0;
    for (; j + kRuns <= n; j += kRuns)
      for (int r = 0; r < kRuns; ++r) runs[r] += x[j + r] * x[j + r];
    double sum = 0;
    for (; j < n; ++j) sum += double(x[j]) * double(x[j]);
    for (int r = 0; r < kRuns; ++r) sum += double(runs[r]);
    return sum;
  }
};
SPLITNERF_ON_GPU(StepNumbersBody);

}  // namespace splitnerf
