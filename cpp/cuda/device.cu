#include "launch.cuh"

namespace splitnerf::cuda {
namespace {

constexpr int kScanThreads = 1024;

// One block: there are no more rays than that.
__global__ void __launch_bounds__(kScanThreads) scan_kernel(int64_t n, int64_t* offsets) {
  constexpr int kWarps = kScanThreads / Warp::size;
  SPLITNERF_SHARED(int64_t, totals, [kWarps]);
  const Warp warp;
  const int number = threadIdx.x / Warp::size;
  int64_t carried = 0;
  for (int64_t first = 0; first < n; first += kScanThreads) {
    const int64_t i = first + threadIdx.x, count = i < n ? offsets[i + 1] : 0;
    const int64_t before = warp.sum_before(count), total = warp.sum(count);
    if (warp.lane() == 0) totals[number] = total;
    __syncthreads();
    const int64_t of_warp = warp.lane() < kWarps ? totals[warp.lane()] : 0;
    const int64_t before_warp = warp.sum(warp.lane() < number ? of_warp : 0);
    if (i < n) offsets[i + 1] = carried + before_warp + before + count;
    carried += warp.sum(of_warp);
    __syncthreads();
  }
  if (threadIdx.x == 0) offsets[0] = 0;
}

}  // namespace

void use_device(int device) { check(cudaSetDevice(device), "cudaSetDevice"); }

int64_t read_number(const Queue& queue, const int64_t* number) {
  int64_t value = 0;
  check(cudaMemcpyAsync(&value, number, sizeof value, cudaMemcpyDeviceToHost, queue.stream), "read_number");
  check(cudaStreamSynchronize(queue.stream), "read_number");
  return value;
}

void clear_bytes(const Queue& queue, const char* op, void* first, int64_t bytes) {
  if (bytes > 0) check(cudaMemsetAsync(first, 0, bytes, queue.stream), op);
}

void sum_counts(const Queue& queue, const char* op, int64_t n, int64_t* offsets) {
  launch(queue, op, scan_kernel, 1, kScanThreads, 0, n, offsets);
}

}  // namespace splitnerf::cuda
