#include "launch.cuh"

namespace splitnerf::cuda {
namespace {

constexpr int kScanThreads = 1024;

// One block for each column of n + 1 numbers: there are no more rays than that. last (may be null): the last of each.
__global__ void __launch_bounds__(kScanThreads) scan_kernel(int64_t n, int64_t* offsets, int64_t* last) {
  constexpr int kWarps = kScanThreads / Warp::size;
  SPLITNERF_SHARED(int64_t, totals, [kWarps]);
  const Warp warp;
  const int number = threadIdx.x / Warp::size;
  int64_t carried = 0;
  offsets += blockIdx.x * (n + 1);
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
  if (threadIdx.x != 0) return;
  offsets[0] = 0;
  if (last) last[blockIdx.x] = carried;
}

}  // namespace

void use_device(int device) { check(cudaSetDevice(device), "cudaSetDevice"); }

void read_numbers(const Queue& queue, int64_t n, const int64_t* numbers, int64_t* to) {
  check(cudaMemcpyAsync(to, numbers, n * sizeof *to, cudaMemcpyDeviceToHost, queue.stream), "read_numbers");
  check(cudaStreamSynchronize(queue.stream), "read_numbers");
}

int64_t read_number(const Queue& queue, const int64_t* number) {
  int64_t value = 0;
  read_numbers(queue, 1, number, &value);
  return value;
}

void clear_bytes(const Queue& queue, const char* op, void* first, int64_t bytes) {
  if (bytes > 0) check(cudaMemsetAsync(first, 0, bytes, queue.stream), op);
}

void sum_counts(const Queue& queue, const char* op, int64_t n, int64_t* offsets, unsigned columns, int64_t* totals) {
  launch(queue, op, scan_kernel, columns, kScanThreads, 0, n, offsets, totals);
}

}  // namespace splitnerf::cuda
