// A warp as the group of threads of splitnerf/group.h.
#pragma once

#include "launch.cuh"
#include "splitnerf/group.h"

namespace splitnerf::cuda {

struct Warp {
  static constexpr int size = 32;
  static constexpr unsigned all = 0xffffffffu;

  __device__ int lane() const { return threadIdx.x % size; }
  template <class T> __device__ T sum(T value) const {
    for (int step = size / 2; step > 0; step /= 2) value += __shfl_xor_sync(all, value, step);
    return value;
  }
  template <class T> __device__ T sum_before(T value) const {
    T running = __shfl_up_sync(all, value, 1);
    if (lane() == 0) running = T(0);
    for (int step = 1; step < size; step *= 2) {
      const T before = __shfl_up_sync(all, running, step);
      if (lane() >= step) running += before;
    }
    return running;
  }
  template <class T> __device__ T last(T value) const { return __shfl_sync(all, value, size - 1); }
  __device__ uint32_t ballot(bool yes) const { return __ballot_sync(all, yes); }
  __device__ void sync() const { __syncwarp(); }
};

// A warp for each index.
template <class Body> __global__ void __launch_bounds__(kBlock) for_each_group_kernel(int64_t n, const Body body) {
  const int64_t i = int64_t(blockIdx.x) * (kBlock / Warp::size) + threadIdx.x / Warp::size;
  if (i < n) body(Warp{}, i);
}
template <class Body> void for_each_group(const Queue& queue, const char* op, int64_t n, const Body& body) {
  if (n <= 0) return;
  for_each_group_kernel<<<blocks_for(n, kBlock / Warp::size), kBlock, 0, queue.stream>>>(n, body);
  check(cudaGetLastError(), op);
}

}  // namespace splitnerf::cuda
