// Bodies on the GPU: where kernels are put, and what puts them there.
#pragma once

#include <cstdint>

using cudaStream_t = struct CUstream_st*;

namespace splitnerf::cuda {

// Where kernels are put, and where their work memory comes from: allocate(context, bytes) is usable by them until the
// stream has run what follows in it.
struct Queue {
  cudaStream_t stream;
  void* (*allocate)(void* context, int64_t bytes);
  void* context;

  template <class T> T* scratch(int64_t n) const { return static_cast<T*>(allocate(context, n * sizeof(T))); }
};

// Makes a GPU the current one of this library's own copy of the CUDA runtime.
void use_device(int device);

// Numbers in the GPU's memory; waits for the stream.
void read_numbers(const Queue& queue, int64_t n, const int64_t* numbers, int64_t* to);
int64_t read_number(const Queue& queue, const int64_t* number);

// Sets bytes to 0.
void clear_bytes(const Queue& queue, const char* op, void* first, int64_t bytes);
template <class T> void clear(const Queue& queue, const char* op, T* values, int64_t n) {
  clear_bytes(queue, op, values, n * sizeof(T));
}

// offsets [columns, n + 1]: 0, and the counts in what follows become their sums; totals [columns]: the sums of all, if asked for.
void sum_counts(const Queue& queue, const char* op, int64_t n, int64_t* offsets, unsigned columns = 1,
                int64_t* totals = nullptr);

// Runs a body for each index, as splitnerf/run.h says; sums of a body are added in an order that depends on n alone. Kernels
// are there for the bodies that stand under SPLITNERF_ON_GPU.
template <class Body> void run(const Queue& queue, const char* op, int64_t n, const Body& body);

}  // namespace splitnerf::cuda
