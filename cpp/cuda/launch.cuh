// Kernels over the bodies of splitnerf/bodies/, with errors as exceptions: cuda::run and what it chooses from.
#pragma once

#include <cuda_runtime.h>

#include <stdexcept>
#include <string>

#include "splitnerf/run.h"
#include "splitnerf/run_cuda.h"

// What tests replace, which compile kernels for the CPU: a launch, a variable in a block's shared memory, and that memory itself.
#ifndef SPLITNERF_LAUNCH
#define SPLITNERF_LAUNCH(kernel, grid, block, bytes, stream) kernel<<<grid, block, bytes, stream>>>
#define SPLITNERF_SHARED(type, name, dims) __shared__ type name dims
#define SPLITNERF_DYNAMIC_SHARED(name) extern __shared__ __align__(16) unsigned char name[]
#endif

namespace splitnerf::cuda {

inline constexpr int kBlock = 256;      // threads
inline constexpr int kSumBlocks = 512;  // blocks that add up

inline void check(cudaError_t error, const char* what) {
  if (error != cudaSuccess) throw std::runtime_error(std::string(what) + ": " + cudaGetErrorString(error));
}

inline unsigned blocks_for(int64_t n, int64_t per_block = kBlock) {
  const int64_t blocks = (n + per_block - 1) / per_block;
  if (blocks > 0x7fffffff) throw std::invalid_argument("too many points for one launch");
  return static_cast<unsigned>(blocks);
}

// Puts a kernel into the stream, with `bytes` of shared memory for each block; throws where that fails.
template <class... Parameters, class... Arguments>
void launch(const Queue& queue, const char* op, void (*kernel)(Parameters...), dim3 grid, unsigned block, size_t bytes,
            const Arguments&... arguments) {
  SPLITNERF_LAUNCH(kernel, grid, block, bytes, queue.stream)(arguments...);
  check(cudaGetLastError(), op);
}

// The most bytes of dynamic shared memory that a block may take; and a kernel is allowed so many.
inline int most_shared_memory(const char* op) {
  int device = 0, most = 0;
  check(cudaGetDevice(&device), op);
  check(cudaDeviceGetAttribute(&most, cudaDevAttrMaxSharedMemoryPerBlockOptin, device), op);
  return most;
}
template <class Kernel> void allow_shared_memory(const char* op, Kernel kernel, int64_t bytes) {
  check(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, static_cast<int>(bytes)), op);
}

// One thread for each index.
template <class Body> __global__ void __launch_bounds__(kBlock) for_each_kernel(int64_t n, const Body body) {
  const int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x;
  if (i < n) body(i);
}
template <class Body> void for_each(const Queue& queue, const char* op, int64_t n, const Body& body) {
  if (n <= 0) return;
  launch(queue, op, for_each_kernel<Body>, blocks_for(n), kBlock, 0, n, body);
}

// One thread for each pair; a row of blocks works on one j, and the rows follow one another.
template <class Body> __global__ void __launch_bounds__(kBlock) for_each_pair_kernel(int64_t n, const Body body) {
  const int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x;
  if (i < n) body(i, static_cast<int>(blockIdx.y));
}
template <class Body> void for_each_pair(const Queue& queue, const char* op, int64_t n, int m, const Body& body) {
  if (n <= 0 || m <= 0) return;
  launch(queue, op, for_each_pair_kernel<Body>, dim3(blocks_for(n), m), kBlock, 0, n, body);
}

// A warp as the group of threads of splitnerf/group.h.
struct Warp {
  static constexpr int size = 32;
  static constexpr unsigned all = 0xffffffffu;

  __device__ int lane() const { return threadIdx.x % size; }
  template <class T> __device__ T sum(T value) const { return sum_of_run<size>(value); }
  template <int N, class T> __device__ T sum_of_run(T value) const {
    for (int step = N / 2; step > 0; step /= 2) value += __shfl_xor_sync(all, value, step);
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
  template <class T> __device__ T from(int lane, T value) const { return __shfl_sync(all, value, lane); }
  template <class T> __device__ T last(T value) const { return from(size - 1, value); }
  template <class T> __device__ T least(T value) const {
    for (int step = size / 2; step > 0; step /= 2) value = min_of(value, __shfl_xor_sync(all, value, step));
    return value;
  }
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
  launch(queue, op, for_each_group_kernel<Body>, blocks_for(n, kBlock / Warp::size), kBlock, 0, n, body);
}

// ---- sums ----

// Sums of the threads of a block, in its first thread.
template <int N> __device__ void add_up_block(double (&sums)[N]) {
  SPLITNERF_SHARED(double, of_warps, [N][kBlock / Warp::size]);
  const Warp warp;
  for (int k = 0; k < N; ++k) {
    const double sum = warp.sum(sums[k]);
    if (warp.lane() == 0) of_warps[k][threadIdx.x / Warp::size] = sum;
  }
  __syncthreads();
  for (int k = 0; k < N; ++k) sums[k] = warp.sum(warp.lane() < kBlock / Warp::size ? of_warps[k][warp.lane()] : 0.0);
}

// parts [blocks, Body::n_sums]: each block's sums over its share of the items.
template <class Body>
__global__ void __launch_bounds__(kBlock) add_up_kernel(int64_t n, const Body body, double* parts) {
  double sums[Body::n_sums] = {};
  for (int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x; i < n; i += int64_t(gridDim.x) * kBlock) body(i, sums);
  add_up_block(sums);
  if (threadIdx.x == 0)
    for (int k = 0; k < Body::n_sums; ++k) parts[blockIdx.x * Body::n_sums + k] = sums[k];
}
template <class Body>
__global__ void __launch_bounds__(kBlock) finish_kernel(int n_parts, const Body body, const double* parts) {
  double sums[Body::n_sums] = {};
  for (int i = threadIdx.x; i < n_parts; i += kBlock)
    for (int k = 0; k < Body::n_sums; ++k) sums[k] += parts[i * Body::n_sums + k];
  add_up_block(sums);
  if (threadIdx.x == 0) body.finish(sums);
}

// Calls body(i, sums) for each item and body.finish(sums) once, in an order that depends on n alone.
template <class Body> void add_up(const Queue& queue, const char* op, int64_t n, const Body& body) {
  const auto blocks = min_of<int64_t>((n + kBlock - 1) / kBlock, kSumBlocks);
  double* parts = queue.scratch<double>(max_of<int64_t>(blocks, 1) * Body::n_sums);
  if (blocks > 0) launch(queue, op, add_up_kernel<Body>, static_cast<unsigned>(blocks), kBlock, 0, n, body, parts);
  launch(queue, op, finish_kernel<Body>, 1, kBlock, 0, static_cast<int>(blocks), body, parts);
}

// ---- the launcher ----

template <class Body> void run(const Queue& queue, const char* op, int64_t n, const Body& body) {
  if constexpr (is_sum<Body>) {
    add_up(queue, op, n, body);
  } else if constexpr (is_single<Body>) {
    for_each(queue, op, n, body);
  } else {
    for_each_group(queue, op, n, body);
  }
}

}  // namespace splitnerf::cuda
