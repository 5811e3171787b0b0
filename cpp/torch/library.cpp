// Declares the operator namespace and hands torch's thread pool to the library.
#include <torch/csrc/stable/library.h>
#include <torch/csrc/stable/ops.h>

#include "splitnerf/parallel.h"

namespace {

void run_on_torch_threads(int64_t n, int64_t grain, splitnerf::RangeBody body, void* context) {
  torch::stable::parallel_for(0, n, grain, [=](int64_t begin, int64_t end) { body(begin, end, context); });
}

}  // namespace

STABLE_TORCH_LIBRARY(splitnerf, m) {
  (void)m;  // each ops_*.cpp defines its own operators as a fragment of this namespace
  splitnerf::set_parallel_backend(run_on_torch_threads);
}
