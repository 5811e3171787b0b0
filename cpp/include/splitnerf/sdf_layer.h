// The network of the distance field, one hidden layer of softplus units over position and hash-grid features: its weights
// as they come, and as the kernels read them.
#pragma once

#include <cstdint>
#include <vector>

#include "splitnerf/hash_grid.h"
#include "splitnerf/vector_math.h"
#include "splitnerf/weight_norm.h"

namespace splitnerf {

// From scene units to the unit cube of the grid, scale = 1 / (2 box).
template <class T> SPLITNERF_HD T to_unit(T coordinate, T scale) { return coordinate * scale + T(0.5); }
template <class T> SPLITNERF_HD Vec3<T> to_unit(Vec3<T> position, T scale) {
  return {to_unit(position.x, scale), to_unit(position.y, scale), to_unit(position.z, scale)};
}

// The gradient to the sum y of a unit, from those to its value softplus(y) and to its slope softplus'(y). 1 - slope =
// exp(-beta value) keeps its digits where the slope is close to 1.
template <class T> SPLITNERF_HD T unit_backward(Softplus<T> unit, T beta, T grad_value, T grad_slope) {
  return grad_value * unit.slope + grad_slope * beta * unit.slope * exp_of_minus(beta * unit.value);
}

// outputs = out softplus_beta(hidden [position, features] + hidden_bias) + out_bias; the first output is the distance.
template <class T> struct SdfWeights {
  int n_inputs;                                    // 3 + features
  int width, n_outputs;                            // hidden units; outputs
  const T *hidden, *hidden_bias, *out, *out_bias;  // [width, n_inputs], [width], [n_outputs, width], [n_outputs]
  T beta;
  T box;  // half size of the cube that the grid covers: d unit position / d position = 1 / (2 box)
  // Of the rows of hidden [width] and out [n_outputs], which are then directions, see weight_norm.h; null where the rows are the
  // weights themselves.
  const T *hidden_length = nullptr, *out_length = nullptr;
};

// The distance field as it comes.
template <class T> struct SdfField {
  HashGridShape shape;
  int n_active;
  HashTable table;
  SdfWeights<T> weights;
};

// What a field gives at n points: [n, n_outputs], [n, C] features of the grid, [n, 3] d first output / d position. The gradients
// to them have the same shapes.
template <class T> struct SdfOutputs {
  T *outputs, *features, *gradient;
};

// Gradients to the numbers of a field whose rows have lengths, in their own shapes.
template <class T> struct SdfFieldGrad {
  T *table, *hidden, *hidden_length, *hidden_bias, *out, *out_length, *out_bias;
};

// The same weights with rows padded to whole vectors, and transposed, as products over blocks of points need them.
template <class T> struct SdfLayer {
  int64_t n_inputs, width, n_outputs;
  int64_t input_columns, width_columns, output_columns;  // padded
  const T *hidden, *hidden_transposed;                   // [width, input_columns], [n_inputs, width_columns]
  const T *out, *out_transposed;                         // [n_outputs, width_columns], [width, output_columns]
  const T *hidden_bias, *out_bias;                       // [width_columns], [output_columns]
  T beta, scale;                                         // scale = 1 / (2 box)
};

// A block of at most kSdfBlock points.
template <class T> struct SdfPoints {
  int64_t n;
  const T *positions, *features, *jacobian;  // [n, 3] scene units, [n, C], [n, 3, C] d features / d unit position
};

// Sums over points, laid out as in SdfLayer.
template <class T> struct SdfLayerGrad {
  T *hidden, *hidden_bias, *out, *out_bias;
};

inline constexpr int kSdfBlock = 64;

// Values of work memory that the kernels over a block need.
template <class T> int64_t sdf_work_size(const SdfLayer<T>& layer) {
  return kSdfBlock * (4 * layer.input_columns + 5 * layer.width_columns + layer.output_columns);
}

// Owns what an SdfLayer points to.
template <class T> class PreparedSdfLayer {
 public:
  explicit PreparedSdfLayer(const SdfWeights<T>& w) {
    const int64_t lanes = 64 / sizeof(T);
    const auto padded = [&](int64_t n) { return (n + lanes - 1) / lanes * lanes; };
    const int64_t inputs = padded(w.n_inputs), width = padded(w.width), outputs = padded(w.n_outputs);
    hidden_.resize(w.width * inputs), hidden_transposed_.resize(w.n_inputs * width), hidden_bias_.resize(width);
    out_.resize(w.n_outputs * width), out_transposed_.resize(w.width * outputs), out_bias_.resize(outputs);
    const auto scale = [](const T* rows, const T* lengths, int64_t r, int64_t n) {
      return lengths ? lengths[r] * inverse_norm(OneThread{}, n, rows + r * n) : T(1);
    };
    for (int64_t h = 0; h < w.width; ++h) {
      hidden_bias_[h] = w.hidden_bias[h];
      const T factor = scale(w.hidden, w.hidden_length, h, w.n_inputs);
      for (int64_t k = 0; k < w.n_inputs; ++k)
        hidden_[h * inputs + k] = hidden_transposed_[k * width + h] = factor * w.hidden[h * w.n_inputs + k];
    }
    for (int64_t m = 0; m < w.n_outputs; ++m) {
      out_bias_[m] = w.out_bias[m];
      const T factor = scale(w.out, w.out_length, m, w.width);
      for (int64_t h = 0; h < w.width; ++h)
        out_[m * width + h] = out_transposed_[h * outputs + m] = factor * w.out[m * w.width + h];
    }
    layer_ = {w.n_inputs,
              w.width,
              w.n_outputs,
              inputs,
              width,
              outputs,
              hidden_.data(),
              hidden_transposed_.data(),
              out_.data(),
              out_transposed_.data(),
              hidden_bias_.data(),
              out_bias_.data(),
              w.beta,
              T(0.5) / w.box};
  }
  PreparedSdfLayer(const PreparedSdfLayer&) = delete;
  PreparedSdfLayer& operator=(const PreparedSdfLayer&) = delete;

  const SdfLayer<T>& layer() const { return layer_; }

 private:
  std::vector<T> hidden_, hidden_transposed_, hidden_bias_, out_, out_transposed_, out_bias_;
  SdfLayer<T> layer_;
};

}  // namespace splitnerf
