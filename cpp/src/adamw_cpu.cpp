// AdamwListBody through the kernel of src/kernels/adamw.cpp.
#include "splitnerf/kernels.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf::cpu {

template <class T> void run(int64_t, const AdamwListBody<T>& body) {
  constexpr int64_t kNumbers = 1 << 14;  // of a task
  if (body.allowed && !*body.allowed) return;
  for (int k = 0; k < body.n_arrays; ++k) {
    const AdamwArrays<T>& x = body.arrays[k].x;
    if (x.n == 0) continue;
    parallel_for(x.n / x.columns, max_of<int64_t>(1, kNumbers / x.columns),
                 [&](int64_t begin, int64_t end) { kernels<T>().adamw_step(body.arrays[k].rule, x, begin, end); });
  }
}

template void run<float>(int64_t, const AdamwListBody<float>&);
template void run<double>(int64_t, const AdamwListBody<double>&);

}  // namespace splitnerf::cpu
