#include "splitnerf/bodies/monte_carlo.h"

#include "launch.cuh"
#include "splitnerf/ops_cuda.h"

namespace splitnerf::cuda {
namespace {

constexpr int kMostLightBlocks = 264;  // two for each processor of an H100

// A warp for each point, and points that follow one another for each warp, which adds to a copy of the light's gradient of its
// own in shared memory; copies [blocks, 3 directions]: their sums, in order.
//
// Counted for 9,000 points and 256 directions on an H100: each direction of a point is 300 instructions of a lane, 22 million of
// a warp in all, 24 us if each scheduler issues one a cycle. It reads 9 MB of visibility and writes 0.8 MB of copies. With an
// atomic addition for each number (7 million, on 768 addresses) it took 110 us. It never ran on a GPU as it is.
template <class T>
__global__ void __launch_bounds__(kBlock)
    shared_light_kernel(int64_t n, const SharedLightBackwardBody<T> body, T* copies) {
  SPLITNERF_DYNAMIC_SHARED(memory);
  T* const of_warps = reinterpret_cast<T*>(memory);
  const int size = 3 * body.n, n_warps = blockDim.x / Warp::size, number = threadIdx.x / Warp::size;
  for (int k = threadIdx.x; k < n_warps * size; k += blockDim.x) of_warps[k] = T(0);
  __syncthreads();
  SharedLightBackwardBody<T> to_copy = body;
  to_copy.receive.grad_light = of_warps + number * size;
  for (int64_t p = int64_t(blockIdx.x) * n_warps + number; p < n; p += int64_t(gridDim.x) * n_warps) to_copy(Warp{}, p);
  __syncthreads();
  for (int k = threadIdx.x; k < size; k += blockDim.x) {
    T sum = T(0);
    for (int w = 0; w < n_warps; ++w) sum += of_warps[w * size + k];
    copies[int64_t(blockIdx.x) * size + k] = sum;
  }
}

// sums [size] of copies [n_copies, size]; a group of threads a sum.
template <class T> struct SumCopiesBody {
  int64_t size;
  int n_copies;
  const T* copies;
  T* sums;

  template <class Group> SPLITNERF_HD void operator()(const Group& group, int64_t k) const {
    T sum = T(0);
    for (int c = group.lane(); c < n_copies; c += Group::size) sum += copies[c * size + k];
    sum = group.sum(sum);
    if (group.lane() == 0) sums[k] = sum;
  }
};

}  // namespace

template <class T> void shared_light_backward(const Queue& queue, int64_t n, const SharedLightBackwardBody<T>& body) {
  const char* op = "summed_light_backward";
  const int64_t size = 3 * int64_t{body.n}, most = most_shared_memory(op);
  int warps = kBlock / Warp::size;
  while (warps > 1 && warps * size * int64_t{sizeof(T)} > most) warps /= 2;
  const int64_t bytes = warps * size * int64_t{sizeof(T)};
  if (bytes > most)
    throw std::invalid_argument(std::string(op) + ": directions are too many for this GPU's shared memory");
  const int blocks = static_cast<int>(min_of<int64_t>(blocks_for(n, warps), kMostLightBlocks));
  T* copies = queue.scratch<T>(max_of(blocks, 1) * max_of<int64_t>(size, 1));
  if (blocks > 0) {
    const auto kernel = shared_light_kernel<T>;
    allow_shared_memory(op, kernel, bytes);
    launch(queue, op, kernel, blocks, warps * Warp::size, bytes, n, body, copies);
  }
  for_each_group(queue, op, size, SumCopiesBody<T>{size, blocks, copies, body.receive.grad_light});
}
template void shared_light_backward<float>(const Queue&, int64_t, const SharedLightBackwardBody<float>&);
template void shared_light_backward<double>(const Queue&, int64_t, const SharedLightBackwardBody<double>&);

}  // namespace splitnerf::cuda
