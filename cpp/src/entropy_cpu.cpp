#include <vector>

#include "splitnerf/kernels.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"

namespace splitnerf::cpu {

// E = -ln(sum_ij k_ij / n^2),  dE / dx_i = sum_j k_ij (x_i - x_j) / sum k
template <class T> void quadratic_entropy(int64_t n, int64_t n_channels, const T* x, T* entropy, T* gradient) {
  constexpr int64_t kGrain = 32;
  std::vector<T> planes(n * n_channels), sums(n * (n_channels + 1));
  for (int64_t i = 0; i < n; ++i)
    for (int64_t c = 0; c < n_channels; ++c) planes[c * n + i] = x[i * n_channels + c];
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    std::vector<T> likeness(n);
    for (int64_t i = begin; i < end; ++i)
      kernels<T>().pair_likeness(n, n_channels, planes.data(), i, likeness.data(), &sums[i * (n_channels + 1)]);
  });
  double total = 0;
  for (int64_t i = 0; i < n; ++i) total += double(sums[i * (n_channels + 1) + n_channels]);
  *entropy = static_cast<T>(-std::log(total / (double(n) * double(n))));
  for (int64_t i = 0; i < n; ++i)
    for (int64_t c = 0; c < n_channels; ++c)
      gradient[i * n_channels + c] = static_cast<T>(double(sums[i * (n_channels + 1) + c]) / total);
}

template void quadratic_entropy<float>(int64_t, int64_t, const float*, float*, float*);
template void quadratic_entropy<double>(int64_t, int64_t, const double*, double*, double*);

}  // namespace splitnerf::cpu
