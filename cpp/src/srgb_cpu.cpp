#include "splitnerf/srgb.h"

#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"

namespace splitnerf::cpu {
namespace {

constexpr int64_t kGrain = 4096;

}  // namespace

template <class T> void linear_to_srgb(int64_t n, const T* linear, T* srgb) {
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) srgb[i] = srgb_from_linear(linear[i]).value;
  });
}

template <class T> void linear_to_srgb_backward(int64_t n, const T* linear, const T* grad_srgb, T* grad_linear) {
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) grad_linear[i] = grad_srgb[i] * srgb_from_linear(linear[i]).slope;
  });
}

template <class T> void srgb_to_linear(int64_t n, const T* srgb, T* linear) {
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) linear[i] = linear_from_srgb(srgb[i]);
  });
}

#define SPLITNERF_INSTANTIATE(T)                                             \
  template void linear_to_srgb<T>(int64_t, const T*, T*);                    \
  template void linear_to_srgb_backward<T>(int64_t, const T*, const T*, T*); \
  template void srgb_to_linear<T>(int64_t, const T*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cpu
