// Function qualifiers shared by g++ and nvcc, the library's symbol visibility, and the list of what the GPU runs.
#pragma once

#include <cstdint>

// Formulas are always inlined: a kernel file is compiled once per instruction set, and an
// out-of-line copy built for AVX-512 must never be the one that the linker keeps for all.
#if defined(__CUDACC__)
#define SPLITNERF_HD __host__ __device__ __forceinline__
#elif defined(__GNUC__)
#define SPLITNERF_HD inline __attribute__((always_inline))
#else
#define SPLITNERF_HD inline
#endif

// Before a loop of few turns: written out, so that a loop around it has nothing but straight code.
#if defined(__CUDACC__)
#define SPLITNERF_UNROLL _Pragma("unroll")
#elif defined(__GNUC__)
#define SPLITNERF_UNROLL _Pragma("GCC unroll 4")
#else
#define SPLITNERF_UNROLL
#endif

#if defined(__GNUC__)
#define SPLITNERF_API __attribute__((visibility("default")))
#else
#define SPLITNERF_API
#endif

// SPLITNERF_ON_GPU(Body); stands below a body of splitnerf/bodies/ that cuda::run (ops_cuda.h) is called with, for float and
// double; SPLITNERF_ON_GPU_TYPE(Body); below one that is no template. cpp/cuda/bodies.cu.in makes kernels of them; elsewhere
// they say nothing.
#ifndef SPLITNERF_ON_GPU_TYPE
#define SPLITNERF_ON_GPU_TYPE(...) static_assert(true)
#endif
#define SPLITNERF_ON_GPU(Body)        \
  SPLITNERF_ON_GPU_TYPE(Body<float>); \
  SPLITNERF_ON_GPU_TYPE(Body<double>)
