// Sums of counts, from cpp/cuda/rays.cu.
#pragma once

#include "splitnerf/ops_cuda.h"

namespace splitnerf::cuda {

// offsets [n + 1]: 0, and the counts in what follows become their sums.
void sum_counts(const Queue& queue, const char* op, int64_t n, int64_t* offsets);

}  // namespace splitnerf::cuda
