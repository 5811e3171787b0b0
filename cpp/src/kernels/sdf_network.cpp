#include "kernel_set.h"
#include "splitnerf/vector_math.h"

namespace splitnerf::SPLITNERF_ISA {

constexpr int64_t kSdfLanes = 16;  // points are padded to a multiple of it

// Points lie along the rows, so that the loops over them are vector code: inputs[k][p].
template <class T> void sdf_values(const SdfNetwork<T>& net, int64_t n, const T* positions, T* work, T* values) {
  const int64_t n_features = net.n_features(), n_inputs = 3 + n_features;
  const int64_t n_open = 3 + int64_t(net.grid.n_active) * net.grid.n_features;
  T *unit = work, *features = unit + 3 * kSdfBlock, *inputs = features + n_features * kSdfBlock;
  for (int64_t i = 0; i < 3 * n; ++i) unit[i] = positions[i] * (T(0.5) / net.box) + T(0.5);
  HashEncodeArgs<T> grid = net.grid;
  grid.n_points = n, grid.positions = unit;
  hash_encode<T>(grid, 0, n, features, nullptr);
  for (int64_t p = 0; p < n; ++p) {
    for (int64_t k = 0; k < 3; ++k) inputs[k * kSdfBlock + p] = positions[3 * p + k];
    for (int64_t k = 3; k < n_open; ++k) inputs[k * kSdfBlock + p] = features[p * n_features + k - 3];
  }
  const int64_t padded = (n + kSdfLanes - 1) / kSdfLanes * kSdfLanes;
  for (int64_t k = 0; k < n_open; ++k)
    for (int64_t p = n; p < padded; ++p) inputs[k * kSdfBlock + p] = T(0);

  T sum[kSdfBlock], pre[kSdfBlock];
  for (int64_t p = 0; p < padded; ++p) sum[p] = net.out_bias;
  for (int h = 0; h < net.width; ++h) {
    for (int64_t p = 0; p < padded; ++p) pre[p] = net.hidden_bias[h];
    for (int64_t k = 0; k < n_open; ++k) {
      const T weight = net.hidden[h * n_inputs + k];
      const T* row = inputs + k * kSdfBlock;
#pragma omp simd
      for (int64_t p = 0; p < padded; ++p) pre[p] += weight * row[p];
    }
    const T weight = net.out[h];
#pragma omp simd
    for (int64_t p = 0; p < padded; ++p) sum[p] += weight * softplus_and_slope(pre[p], net.beta).value;
  }
  for (int64_t p = 0; p < n; ++p) values[p] = sum[p];
}

#define SPLITNERF_INSTANTIATE(T) \
  template void sdf_values<T>(const SdfNetwork<T>&, int64_t, const T*, T*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::SPLITNERF_ISA
