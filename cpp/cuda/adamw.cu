#include "splitnerf/bodies/adamw.h"

#include "launch.cuh"

namespace splitnerf::cuda {

template <class T> void adamw_step(const Queue& queue, const AdamwRule<T>& rule, const AdamwArrays<T>& x) {
  for_each(queue, "adamw_step_", x.n, AdamwBody<T>{rule, x});
}
template void adamw_step<float>(const Queue&, const AdamwRule<float>&, const AdamwArrays<float>&);
template void adamw_step<double>(const Queue&, const AdamwRule<double>&, const AdamwArrays<double>&);

}  // namespace splitnerf::cuda
