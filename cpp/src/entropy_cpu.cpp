// PairLikenessBody through the kernel of src/kernels/entropy.cpp.
#include <vector>

#include "splitnerf/kernels.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf::cpu {

template <class T> void run(int64_t n, const PairLikenessBody<T>& b) {
  constexpr int64_t kGrain = 32;
  const int64_t n_channels = b.n_channels;
  std::vector<T> planes(n * n_channels);
  for (int64_t i = 0; i < n; ++i)
    for (int64_t c = 0; c < n_channels; ++c) planes[c * n + i] = b.x[i * n_channels + c];
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    std::vector<T> likeness(n);
    for (int64_t i = begin; i < end; ++i)
      kernels<T>().pair_likeness(n, n_channels, planes.data(), i, likeness.data(), b.rows + i * (n_channels + 1));
  });
}
template void run<float>(int64_t, const PairLikenessBody<float>&);
template void run<double>(int64_t, const PairLikenessBody<double>&);

}  // namespace splitnerf::cpu
