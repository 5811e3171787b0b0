#include "splitnerf/bodies/losses.h"
#include "warp.cuh"

namespace splitnerf::cuda {
namespace {

constexpr int kMostBlocks = 512;

// Sums of the threads of a block, in its first thread.
template <int N> __device__ void add_up_block(double (&sums)[N]) {
  __shared__ double of_warps[N][kBlock / Warp::size];
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
  const auto blocks = min_of<int64_t>((n + kBlock - 1) / kBlock, kMostBlocks);
  double* parts = queue.scratch<double>(max_of<int64_t>(blocks, 1) * Body::n_sums);
  if (blocks > 0) {
    add_up_kernel<<<static_cast<unsigned>(blocks), kBlock, 0, queue.stream>>>(n, body, parts);
    check(cudaGetLastError(), op);
  }
  finish_kernel<<<1, kBlock, 0, queue.stream>>>(static_cast<int>(blocks), body, parts);
  check(cudaGetLastError(), op);
}

}  // namespace

template <class T>
void pixel_losses(const Queue& queue, int64_t n, const T* mean, const T* opacity, const T* target, const T* background,
                  bool linear, T* losses, T* colour_by_mean, T* colour_by_opacity, T* mask_by_opacity) {
  add_up(queue, "pixel_losses", n,
         make_pixel_losses(n, mean, opacity, target, background, linear, losses, colour_by_mean, colour_by_opacity,
                           mask_by_opacity));
}

template <class T>
void gradient_losses(const Queue& queue, int64_t n, int64_t n_weights, int64_t m, const T* gradients, const T* weights,
                     const int64_t* beside, T* losses, T* eikonal_by, T* smoothness_by) {
  const char* op = "gradient_losses";
  double* factor = queue.scratch<double>(1);
  add_up(queue, op, n, EikonalBody<T>{gradients, T(1) / T(max_of<int64_t>(n, 1)), losses, eikonal_by, smoothness_by});
  add_up(queue, op, m,
         NormalPairsBody<T>{n, n_weights, m, gradients, weights, beside, losses + 1, smoothness_by, factor});
  for_each(queue, op, 3 * n, ScaleBody<T>{factor, smoothness_by});
}

template <class T>
void material_losses(const Queue& queue, int64_t n, const T* albedo, const T* metallic, const T* shares, bool smooth_l1,
                     T* losses, T* by_metallic) {
  const char* op = "material_losses";
  double* factor = queue.scratch<double>(1);
  add_up(queue, op, n, MaterialLossesBody<T>{n, albedo, metallic, shares, smooth_l1, losses, by_metallic, factor});
  for_each(queue, op, 3 * n, ScaleBody<T>{factor, by_metallic});
}

template <class T>
void quadratic_entropy(const Queue& queue, int64_t n, int64_t n_channels, const T* x, T* entropy, T* gradient) {
  const char* op = "quadratic_entropy";
  T* rows = queue.scratch<T>(n * (n_channels + 1));
  double* total = queue.scratch<double>(1);
  for_each_group(queue, op, n, PairLikenessBody<T>{n, n_channels, x, rows});
  add_up(queue, op, n, EntropyBody<T>{n, n_channels, rows, entropy, total});
  for_each(queue, op, n * n_channels, EntropyGradientBody<T>{n_channels, rows, total, gradient});
}

#define SPLITNERF_INSTANTIATE(T)                                                                                      \
  template void pixel_losses<T>(const Queue&, int64_t, const T*, const T*, const T*, const T*, bool, T*, T*, T*, T*); \
  template void gradient_losses<T>(const Queue&, int64_t, int64_t, int64_t, const T*, const T*, const int64_t*, T*,   \
                                   T*, T*);                                                                           \
  template void quadratic_entropy<T>(const Queue&, int64_t, int64_t, const T*, T*, T*);                               \
  template void material_losses<T>(const Queue&, int64_t, const T*, const T*, const T*, bool, T*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cuda
