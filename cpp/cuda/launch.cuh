// Launching kernels over index ranges, with errors as exceptions.
#pragma once

#include <cuda_runtime.h>

#include <stdexcept>
#include <string>

#include "splitnerf/ops_cuda.h"

namespace splitnerf::cuda {

inline constexpr int kBlock = 256;  // threads

inline void check(cudaError_t error, const char* what) {
  if (error != cudaSuccess) throw std::runtime_error(std::string(what) + ": " + cudaGetErrorString(error));
}

inline unsigned blocks_for(int64_t n, int64_t per_block = kBlock) {
  const int64_t blocks = (n + per_block - 1) / per_block;
  if (blocks > 0x7fffffff) throw std::invalid_argument("too many points for one launch");
  return static_cast<unsigned>(blocks);
}

// One thread for each index.
template <class Body> __global__ void __launch_bounds__(kBlock) for_each_kernel(int64_t n, const Body body) {
  const int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x;
  if (i < n) body(i);
}
template <class Body> void for_each(const Queue& queue, const char* op, int64_t n, const Body& body) {
  if (n <= 0) return;
  for_each_kernel<<<blocks_for(n), kBlock, 0, queue.stream>>>(n, body);
  check(cudaGetLastError(), op);
}

// One thread for each pair; a row of blocks works on one j, and the rows follow one another.
template <class Body> __global__ void __launch_bounds__(kBlock) for_each_pair_kernel(int64_t n, const Body body) {
  const int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x;
  if (i < n) body(i, static_cast<int>(blockIdx.y));
}
template <class Body> void for_each_pair(const Queue& queue, const char* op, int64_t n, int m, const Body& body) {
  if (n <= 0 || m <= 0) return;
  for_each_pair_kernel<<<dim3(blocks_for(n), m), kBlock, 0, queue.stream>>>(n, body);
  check(cudaGetLastError(), op);
}

template <class T> void clear(const Queue& queue, const char* op, T* values, int64_t n) {
  if (n > 0) check(cudaMemsetAsync(values, 0, n * sizeof(T), queue.stream), op);
}

}  // namespace splitnerf::cuda
