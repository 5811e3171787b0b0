#include "launch.cuh"

namespace splitnerf::cuda {

void use_device(int device) { check(cudaSetDevice(device), "cudaSetDevice"); }

int64_t read_number(const Queue& queue, const int64_t* number) {
  int64_t value = 0;
  check(cudaMemcpyAsync(&value, number, sizeof value, cudaMemcpyDeviceToHost, queue.stream), "read_number");
  check(cudaStreamSynchronize(queue.stream), "read_number");
  return value;
}

}  // namespace splitnerf::cuda
