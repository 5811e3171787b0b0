#include "splitnerf/kernels.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"

namespace splitnerf::cpu {

template <class T> void adamw_step(const AdamwRule<T>& rule, const AdamwArrays<T>& x) {
  constexpr int64_t kNumbers = 1 << 14;  // of a task
  const Kernels<T>& k = kernels<T>();
  if (x.n == 0) return;
  parallel_for(x.n / x.columns, max_of<int64_t>(1, kNumbers / x.columns),
               [&](int64_t begin, int64_t end) { k.adamw_step(rule, x, begin, end); });
}
template void adamw_step<float>(const AdamwRule<float>&, const AdamwArrays<float>&);
template void adamw_step<double>(const AdamwRule<double>&, const AdamwArrays<double>&);

}  // namespace splitnerf::cpu
