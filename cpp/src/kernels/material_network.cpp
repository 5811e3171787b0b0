// The materials' network on blocks of points. Beside torch's own layers (addmm of MKL; 48 inputs, twice 64 units, float32, one thread
// of an AMD EPYC of family 25, AVX2, CPU time) with 2,000 and 9,000 points: forward .95 and .99 x, backward .71 and .74 x, as it works the
// hidden values out again. So training on the CPU keeps to torch's layers, see fields/heads.py.
#include "block_product.h"
#include "kernel_set.h"

// Points are the rows of all matrices here, units the columns, padded to whole vectors.
namespace splitnerf::SPLITNERF_ISA {
namespace {

// What the layers give, [n, output_columns] each: rectified, but for the last one the plain sums.
template <class T> struct LayerValues {
  const T* inputs;
  T* of[kMostMaterialLayers];
  T* rest;  // of the work memory

  LayerValues(const MaterialNetwork<T>& net, const T* inputs, T* work) : inputs(inputs) {
    for (int l = 0; l < net.n_layers; ++l) {
      of[l] = work;
      work += kMaterialBlock * int64_t{net.layers[l].output_columns};
    }
    rest = work;
  }
  const T* before(int l) const { return l ? of[l - 1] : inputs; }
};

template <class T> void forward(const MaterialNetwork<T>& net, int64_t n, const LayerValues<T>& values) {
  for (int l = 0; l < net.n_layers; ++l) {
    const DenseLayer<T>& layer = net.layers[l];
    const int64_t columns = layer.output_columns;
    T* const y = values.of[l];
    for (int64_t p = 0; p < n; ++p)
      for (int64_t h = 0; h < columns; ++h) y[p * columns + h] = layer.bias[h];
    add_product<T>(n, layer.n_inputs, columns, {values.before(l), layer.input_columns, 1}, layer.transposed, columns, y,
                   columns);
    if (l + 1 == net.n_layers) break;
#pragma omp simd
    for (int64_t i = 0; i < n * columns; ++i) y[i] = rectified(y[i]);
  }
}

}  // namespace

template <class T>
void material_network(const MaterialNetwork<T>& net, int64_t n, const T* inputs, T* work, T* outputs) {
  const LayerValues<T> values(net, inputs, work);
  forward(net, n, values);
  const int last = net.n_layers - 1;
  const int64_t columns = net.layers[last].output_columns;
  for (int64_t p = 0; p < n; ++p) {
    const T* sums = values.of[last] + p * columns;
#pragma omp simd
    for (int m = 0; m < kMaterialOutputs; ++m)
      outputs[p * kMaterialOutputs + m] = material_output(sums[m], m, net.min_roughness);
  }
}

template <class T>
void material_network_backward(const MaterialNetwork<T>& net, int64_t n, const T* inputs, const T* grad_outputs,
                               T* work, T* grad_inputs, T* grads) {
  const LayerValues<T> values(net, inputs, work);
  forward(net, n, values);
  const int last = net.n_layers - 1;
  const int64_t out_columns = net.layers[last].output_columns;
  T *g = values.of[last], *next = values.rest;  // gradients to a layer's sums, and to what comes before it
  for (int64_t p = 0; p < n; ++p)
    for (int m = 0; m < kMaterialOutputs; ++m) {
      T& sum = g[p * out_columns + m];
      sum = material_output_backward(sum, m, net.min_roughness, grad_outputs[p * kMaterialOutputs + m]);
    }
  grads += net.grad_size();
  for (int l = last; l >= 0; --l) {
    const DenseLayer<T>& layer = net.layers[l];
    const int64_t rows = layer.n_outputs, columns = layer.input_columns, row = layer.output_columns;
    grads -= layer.grad_size();
    // sums = weights x + bias
    add_product<T>(rows, n, columns, {g, 1, row}, values.before(l), columns, grads, columns);
    T* const to_bias = grads + rows * columns;
    for (int64_t p = 0; p < n; ++p)
      for (int64_t h = 0; h < rows; ++h) to_bias[h] += g[p * row + h];
    T* const to_x = l ? next : grad_inputs;
    for (int64_t i = 0; i < n * columns; ++i) to_x[i] = T(0);
    add_product<T>(n, rows, columns, {g, row, 1}, layer.weights, columns, to_x, columns);
    if (l == 0) break;
    const T* const x = values.of[l - 1];
#pragma omp simd
    for (int64_t i = 0; i < n * columns; ++i) to_x[i] = rectified_backward(x[i], to_x[i]);
    g = to_x, next = to_x + n * columns;
  }
}

#define SPLITNERF_INSTANTIATE(T)                                                                 \
  template void material_network<T>(const MaterialNetwork<T>&, int64_t, const T*, T*, T*);       \
  template void material_network_backward<T>(const MaterialNetwork<T>&, int64_t, const T*, const T*, T*, T*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::SPLITNERF_ISA
