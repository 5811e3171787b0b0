#include "for_each.h"
#include "splitnerf/bodies/elementwise.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf::cpu {
namespace {

constexpr int64_t kGrain = 4096;

}  // namespace

template <class T> void linear_to_srgb(int64_t n, const T* linear, T* srgb) {
  for_each(n, kGrain, LinearToSrgbBody<T>{linear, srgb});
}

template <class T> void linear_to_srgb_backward(int64_t n, const T* linear, const T* grad_srgb, T* grad_linear) {
  for_each(n, kGrain, LinearToSrgbBackwardBody<T>{linear, grad_srgb, grad_linear});
}

template <class T> void srgb_to_linear(int64_t n, const T* srgb, T* linear) {
  for_each(n, kGrain, SrgbToLinearBody<T>{srgb, linear});
}

#define SPLITNERF_INSTANTIATE(T)                                             \
  template void linear_to_srgb<T>(int64_t, const T*, T*);                    \
  template void linear_to_srgb_backward<T>(int64_t, const T*, const T*, T*); \
  template void srgb_to_linear<T>(int64_t, const T*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cpu
