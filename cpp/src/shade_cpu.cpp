// ShadeBody and its adjoint through the kernels of src/kernels/shading.cpp.
#include "splitnerf/kernels.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf::cpu {
namespace {

constexpr int64_t kGrain = 1024;

}  // namespace

template <class T> void run(int64_t n, const ShadeBody<T>& b) {
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    kernels<T>().split_sum_shade(b.lut, b.options, begin, end, b.n_channels, b.in, b.radiance);
  });
}
template void run<float>(int64_t, const ShadeBody<float>&);
template void run<double>(int64_t, const ShadeBody<double>&);

template <class T> void run(int64_t n, const ShadeBackwardBody<T>& b) {
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    kernels<T>().split_sum_shade_backward(b.lut, b.options, begin, end, b.n_channels, b.in, b.grad_radiance, b.grad);
  });
}
template void run<float>(int64_t, const ShadeBackwardBody<float>&);
template void run<double>(int64_t, const ShadeBackwardBody<double>&);

}  // namespace splitnerf::cpu
