#include "splitnerf/bodies/light_pyramid.h"

#include "launch.cuh"
#include "splitnerf/ops_cuda.h"

namespace splitnerf::cuda {
namespace {

constexpr int kPoints = Warp::size;  // of a tile, one a lane of the first warp
constexpr int kThreads = 192;        // at least one for each coefficient
static_assert(kThreads >= kShCoefficients && kThreads % Warp::size == 0);

// Writes what each coefficient counts for at a point beside those of the tile's other points.
template <class T> struct BasisOfPoint {
  T (*basis)[kPoints + 1];  // a column more, so that neither rows nor columns meet in one bank
  int lane;
  Vec3<T>* constant;

  __device__ void add(int i, const T& value, const T*) const { basis[i][lane] = value; }
  __device__ void add_constant(Vec3<T> grad) const { *constant = grad; }
};

// The gradient to the coefficients is a product of two lists, basis and light, summed over the points: a block works out the
// basis of a tile of points in shared memory, then each of its threads sums for one coefficient.
template <class T>
__global__ void __launch_bounds__(kThreads)
    lookup_backward_kernel(int64_t n, const LightPyramid<T> pyramid, const ShRecurrence<T> recurrence,
                           const T* directions, const T* roughness, const T* grad_radiance, T* grad_directions,
                           T* grad_roughness, T* grad_levels, T* grad_sh) {
  SPLITNERF_SHARED(T, basis, [kShCoefficients][kPoints + 1]);
  SPLITNERF_SHARED(Vec3<T>, light, [kPoints]);
  SPLITNERF_SHARED(Vec3<T>, constant, [kPoints]);
  const int coefficient = threadIdx.x;
  Vec3<T> sum{T(0), T(0), T(0)};
  for (int64_t first = int64_t(blockIdx.x) * kPoints; first < n; first += int64_t(gridDim.x) * kPoints) {
    for (int i = threadIdx.x; i < kShCoefficients * (kPoints + 1); i += kThreads) (&basis[0][0])[i] = T(0);
    __syncthreads();
    if (threadIdx.x < kPoints) {
      const int lane = threadIdx.x;
      const int64_t i = first + lane;
      light[lane] = constant[lane] = {T(0), T(0), T(0)};
      if (i < n) {
        const Vec3<T> grad = load3(grad_radiance + 3 * i);
        T* const factors = &light[lane].x;
        const LightArgumentsGrad<T> to =
            read_light_backward(pyramid, recurrence, load3(directions + 3 * i), roughness[i], grad, grad_levels,
                                BasisOfPoint<T>{basis, lane, &constant[lane]}, factors);
        store3(grad_directions + 3 * i, to.direction);
        grad_roughness[i] = to.roughness;
      }
    }
    __syncthreads();
    if (coefficient < kShCoefficients)
      for (int p = 0; p < kPoints; ++p) sum += light[p] * basis[coefficient][p];
    if (coefficient == 0)
      for (int p = 0; p < kPoints; ++p) sum += constant[p];
    __syncthreads();
  }
  if (coefficient < kShCoefficients) add3_to(grad_sh + 3 * coefficient, sum);
}

}  // namespace

template <class T>
void light_lookup_backward(const Queue& queue, const LightPyramid<T>& pyramid, int64_t n, const T* directions,
                           const T* roughness, const T* grad_radiance, T* grad_directions, T* grad_roughness,
                           T* grad_levels, T* grad_sh) {
  const char* op = "light_lookup_backward";
  clear(queue, op, grad_levels, 3 * light_texels(pyramid));
  clear(queue, op, grad_sh, 3 * kShCoefficients);
  if (n == 0) return;
  constexpr unsigned kMostBlocks = 1024;  // each adds once to every coefficient
  launch(queue, op, lookup_backward_kernel<T>, min_of(blocks_for(n, kPoints), kMostBlocks), kThreads, 0, n, pyramid,
         *pyramid.recurrence, directions, roughness, grad_radiance, grad_directions, grad_roughness, grad_levels,
         grad_sh);
}

template void light_lookup_backward<float>(const Queue&, const LightPyramid<float>&, int64_t, const float*,
                                           const float*, const float*, float*, float*, float*, float*);
template void light_lookup_backward<double>(const Queue&, const LightPyramid<double>&, int64_t, const double*,
                                            const double*, const double*, double*, double*, double*, double*);

}  // namespace splitnerf::cuda
