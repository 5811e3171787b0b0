// A step of AdamW, one thread a number.
// Source: Loshchilov and Hutter 2019, Algorithm 2; rows without gradient are left alone: Mueller et al. 2022, section 4.
#pragma once

#include <cmath>

#include "splitnerf/half.h"

namespace splitnerf {

template <class T> struct AdamwRule {
  T decay;                 // 1 - lr weight_decay
  T rate;                  // lr / (1 - beta1^step)
  T to_mean;               // 1 - beta1
  T of_square, to_square;  // beta2, 1 - beta2
  T correction;            // 1 / sqrt(1 - beta2^step)
  T eps;

  AdamwRule() = default;
  AdamwRule(double lr, double beta1, double beta2, double eps, double weight_decay, int64_t step)
      : decay(T(1 - lr * weight_decay)), rate(T(lr / (1 - std::pow(beta1, double(step))))), to_mean(T(1 - beta1)),
        of_square(T(beta2)), to_square(T(1 - beta2)), correction(T(1 / std::sqrt(1 - std::pow(beta2, double(step))))),
        eps(T(eps)) {}
};

// Numbers in rows of `columns`; half, where not null, takes a copy of param as it is after the step.
template <class T> struct AdamwArrays {
  int64_t n, columns;
  bool sparse;  // leaves a row alone whose gradients are all 0
  T* param;
  const T* grad;
  T *exp_avg, *exp_avg_sq;
  Half* half;
};

template <class T>
SPLITNERF_HD void adamw_number(const AdamwRule<T>& rule, T grad, T& param, T& exp_avg, T& exp_avg_sq) {
  exp_avg += (grad - exp_avg) * rule.to_mean;
  exp_avg_sq = rule.of_square * exp_avg_sq + rule.to_square * grad * grad;
  param = param * rule.decay - rule.rate * exp_avg / (std::sqrt(exp_avg_sq) * rule.correction + rule.eps);
}

// One array; a part of AdamwListBody.
template <class T> struct AdamwBody {
  AdamwRule<T> rule;
  AdamwArrays<T> x;

  SPLITNERF_HD void operator()(int64_t i) const {
    if (x.sparse && !row_moves(i / x.columns)) return;
    adamw_number(rule, x.grad[i], x.param[i], x.exp_avg[i], x.exp_avg_sq[i]);
    if (x.half) x.half[i] = narrow(float(x.param[i]));
  }

 private:
  SPLITNERF_HD bool row_moves(int64_t row) const {
    for (int64_t c = 0; c < x.columns; ++c)
      if (x.grad[row * x.columns + c] != T(0)) return true;
    return false;
  }
};

// Some arrays, each with its rule, as one list of numbers: array k has those from ends[k - 1] to ends[k]. Nothing moves where
// `allowed` is not null and false.
inline constexpr int kMostAdamwArrays = 24;  // so that a GPU's kernel takes them as arguments, 4 KB
template <class T> struct AdamwListBody {
  int n_arrays = 0;
  const bool* allowed = nullptr;
  int64_t ends[kMostAdamwArrays];
  AdamwBody<T> arrays[kMostAdamwArrays];

  int64_t count() const { return n_arrays ? ends[n_arrays - 1] : 0; }
  void add(const AdamwBody<T>& array) {
    const int64_t before = count();
    arrays[n_arrays] = array, ends[n_arrays++] = before + array.x.n;
  }
  SPLITNERF_HD void operator()(int64_t i) const {
    if (allowed && !*allowed) return;
    int k = 0;
    while (i >= ends[k]) ++k;
    arrays[k](i - (k ? ends[k - 1] : 0));
  }
};
SPLITNERF_ON_GPU(AdamwListBody);

}  // namespace splitnerf
