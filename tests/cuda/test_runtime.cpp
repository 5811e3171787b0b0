// That the CPU in a GPU's place does what a GPU does, and finds kernels that are wrong. Compiled as kernels are.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "gpu.h"
#include "launch.cuh"

namespace splitnerf::cuda {
namespace {

// What a launch throws; empty where it throws nothing.
template <class... Parameters, class... Arguments>
std::string failure(void (*kernel)(Parameters...), dim3 grid, unsigned block, size_t bytes,
                    const Arguments&... arguments) {
  Gpu gpu;
  try {
    launch(gpu.queue(), "test", kernel, grid, block, bytes, arguments...);
  } catch (const std::runtime_error& error) { return error.what(); }
  return "";
}

#define EXPECT_HAS(text, part) EXPECT_NE(std::string(text).find(part), std::string::npos) << text

__global__ void warp_kernel(double* out) {
  const Warp warp;
  const double x = double(threadIdx.x);
  out[4 * threadIdx.x] = warp.sum(x);
  out[4 * threadIdx.x + 1] = warp.sum_before(x);
  out[4 * threadIdx.x + 2] = warp.last(x);
  out[4 * threadIdx.x + 3] = warp.ballot(threadIdx.x % 3 == 0);
}
TEST(Runtime, AWarpAddsUpAndVotes) {
  std::vector<double> out(4 * 64);
  EXPECT_EQ(failure(warp_kernel, 1, 64, 0, out.data()), "");
  for (int t = 0; t < 64; ++t) {
    const int first = t / 32 * 32, lane = t % 32;
    EXPECT_EQ(out[4 * t], 32 * first + 496);
    EXPECT_EQ(out[4 * t + 1], lane * first + lane * (lane - 1) / 2);
    EXPECT_EQ(out[4 * t + 2], first + 31);
    uint32_t bits = 0;
    for (int i = 0; i < 32; ++i) bits |= uint32_t((first + i) % 3 == 0) << i;
    EXPECT_EQ(out[4 * t + 3], bits);
  }
}

// Each block has shared memory of its own, and what nobody wrote there is NaN.
__global__ void shared_kernel(float* out) {
  SPLITNERF_SHARED(float, numbers, [64]);
  SPLITNERF_DYNAMIC_SHARED(memory);
  float* const more = reinterpret_cast<float*>(memory);
  if (threadIdx.x < 32) numbers[threadIdx.x] = more[threadIdx.x] = float(blockIdx.x);
  __syncthreads();
  out[blockIdx.x * 64 + threadIdx.x] = numbers[threadIdx.x] + more[threadIdx.x];
}
TEST(Runtime, SharedMemoryIsTheBlocksAndHoldsNan) {
  std::vector<float> out(2 * 64);
  EXPECT_EQ(failure(shared_kernel, 2, 64, 64 * sizeof(float), out.data()), "");
  for (int i = 0; i < 128; ++i) {
    if (i % 64 < 32) {
      EXPECT_EQ(out[i], 2 * (i / 64));
    } else {
      EXPECT_TRUE(std::isnan(out[i]));
    }
  }
}

// ---- what is wrong ----

__global__ void some_wait_kernel(int n) {
  if (int(threadIdx.x) < n) __syncthreads();
  if (int(threadIdx.x) >= n) __syncthreads();
}
TEST(Runtime, ABarrierThatOnlySomeReachIsFound) {
  EXPECT_EQ(failure(some_wait_kernel, 2, 64, 0, 64), "");
  const std::string told = failure(some_wait_kernel, 2, 64, 0, 40);
  EXPECT_HAS(told, "test: block (0, 0, 0), thread (40, 0, 0): __syncthreads at test_runtime.cpp:");
}
__global__ void lane_missing_kernel(float* out) {
  const Warp warp;
  out[threadIdx.x] = 0;
  if (threadIdx.x != 37) out[threadIdx.x] = warp.sum(1.f);
  __syncthreads();
}
TEST(Runtime, ALaneThatStaysAwayIsFound) {
  std::vector<float> out(64);
  EXPECT_HAS(failure(lane_missing_kernel, 1, 64, 0, out.data()), "waits for lane 5, which is at __syncthreads");
}
__global__ void lane_gone_kernel(float* out) {
  if (threadIdx.x == 5) return;
  out[threadIdx.x] = __shfl_xor_sync(0xffffffffu, float(threadIdx.x), 1);
}
TEST(Runtime, AskingALaneThatIsGoneIsFound) {
  std::vector<float> out(32);
  EXPECT_HAS(failure(lane_gone_kernel, 1, 32, 0, out.data()), "thread (4, 0, 0): a shuffle at test_runtime.cpp:");
}
TEST(Runtime, LaunchesThatNoGpuTakesAreFound) {
  std::vector<float> out(64);
  EXPECT_HAS(failure(lane_gone_kernel, 0, 32, 0, out.data()), "no threads");
  EXPECT_HAS(failure(lane_gone_kernel, 1, 1025, 0, out.data()), "more threads than a block");
  EXPECT_HAS(failure(lane_gone_kernel, dim3(1, 65536), 32, 0, out.data()), "more blocks than a grid");
  EXPECT_HAS(failure(shared_kernel, 1, 64, 49153, out.data()), "more shared memory than was allowed");
  EXPECT_HAS(failure(shared_kernel, 1, 64, 49000, out.data()), "with that of variables");  // which are 256 bytes
  cudaFuncSetAttribute(shared_kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, 49153);
  EXPECT_EQ(failure(shared_kernel, 1, 64, 49153, out.data()), "");
  cudaFuncSetAttribute(shared_kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, 0);
}
// A failure is told once, and the next launch is none the worse.
TEST(Runtime, AfterAFailureLaunchesGoOn) {
  std::vector<double> out(4 * 32);
  EXPECT_NE(failure(some_wait_kernel, 1, 64, 0, 40), "");
  EXPECT_EQ(failure(warp_kernel, 1, 32, 0, out.data()), "");
}

}  // namespace
}  // namespace splitnerf::cuda
