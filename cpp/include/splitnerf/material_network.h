// The materials' network, hidden layers of rectified units and a sigmoid over the inputs: its weights as they come, and as the
// kernels read them.
#pragma once

#include <cstdint>

#include "splitnerf/neus.h"

namespace splitnerf {

inline constexpr int kMostMaterialLayers = 16, kMostMaterialInputs = 4;
inline constexpr int kMaterialOutputs = 5, kRoughnessOutput = 3;  // albedo, roughness, metallic

// ---- the formulas; NaN stays NaN ----

template <class T> SPLITNERF_HD T rectified(T x) { return x <= T(0) ? T(0) : x; }
// grad of x from that of y = rectified(x)
template <class T> SPLITNERF_HD T rectified_backward(T y, T grad) { return y <= T(0) ? T(0) : grad; }

// Output m of the last layer's sum: the sigmoid, for the roughness in [min_roughness, 1].
template <class T> SPLITNERF_HD T material_output(T sum, int m, T min_roughness) {
  const T s = sigmoid(sum);
  return m == kRoughnessOutput ? min_roughness + (T(1) - min_roughness) * s : s;
}
// d sigmoid = s (1 - s), where 1 - s = sigmoid(-sum) keeps its digits
template <class T> SPLITNERF_HD T material_output_backward(T sum, int m, T min_roughness, T grad) {
  const T slope = sigmoid(sum) * sigmoid(-sum);
  return grad * (m == kRoughnessOutput ? (T(1) - min_roughness) * slope : slope);
}

// ---- the numbers ----

// Layer l: weights[l] [outputs, inputs] and biases[l] [outputs], rows one after the other. The inputs of the first layer come in
// n_parts arrays [n, columns], joined by columns.
template <class T> struct MaterialWeights {
  int n_layers, n_parts;
  int columns[kMostMaterialInputs];
  int sizes[kMostMaterialLayers + 1];  // of the inputs and of each layer
  const T *weights[kMostMaterialLayers], *biases[kMostMaterialLayers];
  T min_roughness;
};
template <class T> struct MaterialGrads {
  T* parts[kMostMaterialInputs];
  T *weights[kMostMaterialLayers], *biases[kMostMaterialLayers];
};
// albedo [n, 3], roughness [n], metallic [n], or the gradients to them.
template <class T> struct MaterialArrays {
  T *albedo, *roughness, *metallic;

  SPLITNERF_HD T& at(int64_t i, int m) const {
    return m < kRoughnessOutput ? albedo[3 * i + m] : (m == kRoughnessOutput ? roughness : metallic)[i];
  }
};

// A layer with rows padded, and transposed, as products over many points need it; its numbers stand side by side from `weights` on.
template <class T> struct DenseLayer {
  int n_inputs, n_outputs, input_columns, output_columns;
  const T *weights, *transposed, *bias;  // [n_outputs, input_columns], [n_inputs, output_columns], [output_columns]

  // Where its gradients stand in a list of them: weights as above, then the bias.
  SPLITNERF_HD int64_t grad_size() const { return int64_t{n_outputs} * input_columns + output_columns; }
  SPLITNERF_HD int64_t size() const { return grad_size() + int64_t{n_inputs} * output_columns; }
};
template <class T> struct MaterialNetwork {
  int n_layers;
  DenseLayer<T> layers[kMostMaterialLayers];
  T min_roughness;

  SPLITNERF_HD int n_inputs() const { return layers[0].n_inputs; }
  SPLITNERF_HD int64_t grad_size() const {
    int64_t size = 0;
    for (int l = 0; l < n_layers; ++l) size += layers[l].grad_size();
    return size;
  }
};

// The shape of the network, rows padded to `lanes`; `numbers` [material_numbers] will hold what it points to.
template <class T> MaterialNetwork<T> material_shape(const MaterialWeights<T>& w, int lanes, const T* numbers) {
  const auto padded = [&](int n) { return (n + lanes - 1) / lanes * lanes; };
  MaterialNetwork<T> net{};
  net.n_layers = w.n_layers, net.min_roughness = w.min_roughness;
  for (int l = 0; l < w.n_layers; ++l) {
    DenseLayer<T>& layer = net.layers[l];
    layer = {w.sizes[l], w.sizes[l + 1], padded(w.sizes[l]), padded(w.sizes[l + 1]), numbers, nullptr, nullptr};
    layer.transposed = layer.weights + int64_t{layer.n_outputs} * layer.input_columns;
    layer.bias = layer.transposed + int64_t{layer.n_inputs} * layer.output_columns;
    numbers += layer.size();
  }
  return net;
}
template <class T> int64_t material_numbers(const MaterialWeights<T>& w, int lanes) {
  const MaterialNetwork<T> net = material_shape<T>(w, lanes, nullptr);
  int64_t size = 0;
  for (int l = 0; l < net.n_layers; ++l) size += net.layers[l].size();
  return size;
}

// Number i of a layer as material_shape lays it out, zero in the padding.
template <class T> SPLITNERF_HD T padded_number(const DenseLayer<T>& layer, const T* weights, const T* bias, int64_t i) {
  const int64_t plain = int64_t{layer.n_outputs} * layer.input_columns,
                transposed = int64_t{layer.n_inputs} * layer.output_columns;
  if (i < plain) {
    const int64_t h = i / layer.input_columns, k = i % layer.input_columns;
    return k < layer.n_inputs ? weights[h * layer.n_inputs + k] : T(0);
  }
  const int64_t j = i - plain, k = j / layer.output_columns, h = j % layer.output_columns;
  if (h >= layer.n_outputs) return T(0);
  return j < transposed ? weights[h * layer.n_inputs + k] : bias[h];
}
// Where number i of a layer's list of gradients goes, or null for padding.
template <class T> SPLITNERF_HD T* grad_place(const DenseLayer<T>& layer, T* weights, T* bias, int64_t i) {
  const int64_t of_weights = int64_t{layer.n_outputs} * layer.input_columns, k = i % layer.input_columns;
  if (i >= of_weights) return i - of_weights < layer.n_outputs ? bias + (i - of_weights) : nullptr;
  return k < layer.n_inputs ? weights + i / layer.input_columns * layer.n_inputs + k : nullptr;
}

inline constexpr int kMaterialBlock = 64;  // points of a block on the CPU

}  // namespace splitnerf
