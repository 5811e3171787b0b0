// One row of a point set's likenesses, beside PairLikenessBody: 9 x for 256 points, 11 x for 4096, 5 channels each
// (float32, one thread of an AMD EPYC of family 25, AVX-512).
#include "kernel_set.h"
#include "splitnerf/vector_math.h"

namespace splitnerf::SPLITNERF_ISA {

template <class T>
void pair_likeness(int64_t n, int64_t n_channels, const T* planes, int64_t point, T* likeness, T* sums) {
  for (int64_t j = 0; j < n; ++j) likeness[j] = T(0);
  for (int64_t c = 0; c < n_channels; ++c) {
    const T* x = planes + c * n;
    const T here = x[point];
#pragma omp simd
    for (int64_t j = 0; j < n; ++j) likeness[j] += (x[j] - here) * (x[j] - here);
  }
  T total = T(0);
#pragma omp simd reduction(+ : total)
  for (int64_t j = 0; j < n; ++j) {
    likeness[j] = exp_of_minus(T(0.25) * likeness[j]);
    total += likeness[j];
  }
  sums[n_channels] = total;
  for (int64_t c = 0; c < n_channels; ++c) {
    const T* x = planes + c * n;
    const T here = x[point];
    T pull = T(0);
#pragma omp simd reduction(+ : pull)
    for (int64_t j = 0; j < n; ++j) pull += likeness[j] * (here - x[j]);
    sums[c] = pull;
  }
}

#define SPLITNERF_INSTANTIATE(T) template void pair_likeness<T>(int64_t, int64_t, const T*, int64_t, T*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::SPLITNERF_ISA
