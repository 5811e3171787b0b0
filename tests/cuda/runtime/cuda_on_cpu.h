// The part of CUDA that this library's kernels use, on the CPU: a .cu file is compiled as C++ with this folder in front of CUDA's
// own headers, and its kernels run as they are. Blocks follow one another; a block's threads are fibers, which take turns at
// barriers and at operations of a warp. A kernel fails, as cudaGetLastError tells, where
//
//   a barrier or an operation of a warp is not reached by all threads that have to come, or by some at another place;
//   a lane asks for the value of one that says none;
//   a launch asks for what no GPU has, or for more shared memory than was allowed before.
//
// Shared memory is new for each block and holds NaN. Atomics are the processor's. AddressSanitizer and ThreadSanitizer know the
// fibers: to the latter, threads of a block are ordered by barriers, those of a warp by __syncwarp, and blocks not at all.
// Nothing here tells of a GPU's speed or of its order of memory.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <type_traits>

#define __global__
#define __device__
#define __host__
#define __forceinline__ inline __attribute__((always_inline))
#define __launch_bounds__(...)
#define __align__(n) alignas(n)

struct dim3 {
  unsigned x, y, z;
  constexpr dim3(unsigned x = 1, unsigned y = 1, unsigned z = 1) : x(x), y(y), z(z) {}
};

using cudaStream_t = struct CUstream_st*;

namespace cuda_on_cpu {

struct Place {
  dim3 thread, block, block_size, grid_size;
};
Place& here();

// Where in a file something is called: what has to be the same for all threads.
struct CallSite {
  const char* file;
  int line;
};

enum class Operation { kBarrier, kWarpBarrier, kShuffle, kBallot };

void barrier(CallSite site);
// Waits for the lanes of the mask, each with 8 bytes of its own; `from` is the lane whose bytes this one gets.
uint64_t exchange(Operation operation, unsigned mask, uint64_t value, int from, CallSite site);
uint32_t ballot(unsigned mask, bool yes, CallSite site);
int lane();

// The block's memory for a variable, the same for all of its threads.
void* shared_memory(const void* variable, size_t bytes);
void* dynamic_shared_memory();

// The order in which the threads of a block begin, and take turns.
enum class Order { kForward, kBackward, kShuffled };
void set_order(Order order);

void allow_shared_memory(const void* kernel, int bytes);
void run(const void* kernel, dim3 grid, dim3 block, size_t bytes, const std::function<void()>& thread);

// What kernels have asked for since the last call: launches, and atomic additions, of which one to two or four neighbours is one.
struct Counts {
  int64_t launches, atomics;
};
Counts take_counts();
void count_atomic();

template <class... Parameters> struct Launch {
  void (*kernel)(Parameters...);
  dim3 grid, block;
  size_t bytes;

  template <class... Arguments> void operator()(const Arguments&... arguments) const {
    run(reinterpret_cast<const void*>(kernel), grid, block, bytes, [&] { kernel(arguments...); });
  }
};
template <class... Parameters>
Launch<Parameters...> launch(void (*kernel)(Parameters...), dim3 grid, dim3 block, size_t bytes, cudaStream_t) {
  return {kernel, grid, block, bytes};
}

template <class T> T shuffle(unsigned mask, T value, int from, CallSite site) {
  static_assert(sizeof(T) <= 8);
  uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof value);
  bits = exchange(Operation::kShuffle, mask, bits, from, site);
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

template <class T> void add_atomically(T* to, T value) {
  T before, after;
  __atomic_load(to, &before, __ATOMIC_RELAXED);
  do after = before + value;
  while (!__atomic_compare_exchange(to, &before, &after, true, __ATOMIC_RELAXED, __ATOMIC_RELAXED));
}

}  // namespace cuda_on_cpu

#define threadIdx (cuda_on_cpu::here().thread)
#define blockIdx (cuda_on_cpu::here().block)
#define blockDim (cuda_on_cpu::here().block_size)
#define gridDim (cuda_on_cpu::here().grid_size)

#define CUDA_ON_CPU_HERE (cuda_on_cpu::CallSite{__FILE__, __LINE__})
#define __syncthreads() cuda_on_cpu::barrier(CUDA_ON_CPU_HERE)
#define __syncwarp() \
  static_cast<void>( \
      cuda_on_cpu::exchange(cuda_on_cpu::Operation::kWarpBarrier, ~0u, 0, cuda_on_cpu::lane(), CUDA_ON_CPU_HERE))
#define __shfl_sync(mask, value, from) cuda_on_cpu::shuffle(mask, value, (from) & 31, CUDA_ON_CPU_HERE)
#define __shfl_xor_sync(mask, value, bits) \
  cuda_on_cpu::shuffle(mask, value, cuda_on_cpu::lane() ^ (bits), CUDA_ON_CPU_HERE)
#define __shfl_up_sync(mask, value, step)                                                                       \
  cuda_on_cpu::shuffle(mask, value,                                                                             \
                       cuda_on_cpu::lane() < int(step) ? cuda_on_cpu::lane() : cuda_on_cpu::lane() - int(step), \
                       CUDA_ON_CPU_HERE)
#define __ballot_sync(mask, yes) cuda_on_cpu::ballot(mask, yes, CUDA_ON_CPU_HERE)

inline int __popc(unsigned word) { return __builtin_popcount(word); }
inline int __ffs(int word) { return __builtin_ffs(word); }

struct float2 {
  float x, y;
};
struct float4 {
  float x, y, z, w;
};
inline float2 make_float2(float x, float y) { return {x, y}; }
inline float4 make_float4(float x, float y, float z, float w) { return {x, y, z, w}; }

template <int N, class T> void add_each_atomically(T* to, const T (&values)[N]) {
  cuda_on_cpu::count_atomic();
  for (int i = 0; i < N; ++i) cuda_on_cpu::add_atomically(to + i, values[i]);
}
inline void atomicAdd(float* to, float value) { add_each_atomically(to, {value}); }
inline void atomicAdd(double* to, double value) { add_each_atomically(to, {value}); }
inline void atomicAdd(float2* to, float2 v) { add_each_atomically(&to->x, {v.x, v.y}); }
inline void atomicAdd(float4* to, float4 v) { add_each_atomically(&to->x, {v.x, v.y, v.z, v.w}); }

// Shared memory, and a launch, as launch.cuh writes them.
#define SPLITNERF_SHARED(type, name, dims) \
  static const char name##_variable = 0;   \
  using name##_shape = type dims;          \
  name##_shape& name = *static_cast<name##_shape*>(cuda_on_cpu::shared_memory(&name##_variable, sizeof(name##_shape)))
#define SPLITNERF_DYNAMIC_SHARED(name) \
  unsigned char* const name = static_cast<unsigned char*>(cuda_on_cpu::dynamic_shared_memory())
#define SPLITNERF_LAUNCH(kernel, grid, block, bytes, stream) cuda_on_cpu::launch(kernel, grid, block, bytes, stream)

// ---- the runtime's calls ----

enum cudaError_t { cudaSuccess, cudaErrorInvalidValue, cudaErrorLaunchFailure };
enum cudaMemcpyKind { cudaMemcpyHostToDevice, cudaMemcpyDeviceToHost };
enum cudaDeviceAttr { cudaDevAttrMaxSharedMemoryPerBlockOptin };
enum cudaFuncAttribute { cudaFuncAttributeMaxDynamicSharedMemorySize };

cudaError_t cudaGetLastError();
const char* cudaGetErrorString(cudaError_t error);
cudaError_t cudaSetDevice(int device);
cudaError_t cudaGetDevice(int* device);
cudaError_t cudaDeviceGetAttribute(int* value, cudaDeviceAttr attribute, int device);
cudaError_t cudaMemcpyAsync(void* to, const void* from, size_t bytes, cudaMemcpyKind kind, cudaStream_t stream);
cudaError_t cudaMemsetAsync(void* to, int value, size_t bytes, cudaStream_t stream);
cudaError_t cudaStreamSynchronize(cudaStream_t stream);
template <class Kernel> cudaError_t cudaFuncSetAttribute(Kernel* kernel, cudaFuncAttribute, int bytes) {
  cuda_on_cpu::allow_shared_memory(reinterpret_cast<const void*>(kernel), bytes);
  return cudaSuccess;
}
