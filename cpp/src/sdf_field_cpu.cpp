// The distance field in blocks of points: the encoding of a block, with its Jacobian, stays in the cache until the layer has
// read it, and in the backward pass is made again.
#include <algorithm>
#include <memory>
#include <vector>

#include "each_level.h"
#include "prepared_field.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"

namespace splitnerf::cpu {
namespace {

constexpr int64_t kGrain = 512;   // points of a task
constexpr int64_t kEncoded = 64;  // points that are encoded together

// Encodes points and hands them on in blocks.
template <class T> class EncodedPoints {
 public:
  explicit EncodedPoints(const SdfNetwork<T>& network)
      : network_(network), n_features_(network.layer.n_inputs - 3), unit_(3 * kEncoded),
        jacobian_(3 * kEncoded * n_features_) {}

  // Points [begin, end): calls body(block, index of its first point). features(i) is memory for those of point i and, if they
  // lie in one group of kEncoded, of its successors.
  template <class Features, class Body>
  void operator()(int64_t begin, int64_t end, const T* positions, const Features& features, const Body& body) {
    HashEncodeArgs<T> grid = network_.grid;
    grid.positions = unit_.data();
    for (int64_t i = begin; i < end; i += kEncoded) {
      grid.n_points = min_of(kEncoded, end - i);
      for (int64_t k = 0; k < 3 * grid.n_points; ++k) unit_[k] = to_unit(positions[3 * i + k], network_.layer.scale);
      kernels<T>().hash_encode(grid, 0, grid.n_points, features(i), jacobian_.data());
      for (int64_t b = 0; b < grid.n_points; b += kSdfBlock)
        body(SdfPoints<T>{min_of<int64_t>(kSdfBlock, grid.n_points - b), positions + 3 * (i + b),
                          features(i) + b * n_features_, jacobian_.data() + 3 * b * n_features_},
             i + b);
    }
  }

 private:
  const SdfNetwork<T>& network_;
  int64_t n_features_;
  std::vector<T> unit_, jacobian_;
};

// Gradients to the weights, laid out as in SdfLayer.
template <class T> struct PaddedGrad {
  std::vector<T> hidden, hidden_bias, out, out_bias;

  explicit PaddedGrad(const SdfLayer<T>& l)
      : hidden(l.width * l.input_columns), hidden_bias(l.width_columns), out(l.n_outputs * l.width_columns),
        out_bias(l.n_outputs) {}
  SdfLayerGrad<T> view() { return {hidden.data(), hidden_bias.data(), out.data(), out_bias.data()}; }
};

// matrix [rows, columns] += padded [rows, padded_columns]
template <class T>
void add_unpadded(int64_t rows, int64_t columns, int64_t padded_columns, const std::vector<T>& padded, T* matrix) {
  for (int64_t r = 0; r < rows; ++r)
    for (int64_t c = 0; c < columns; ++c) matrix[r * columns + c] += padded[r * padded_columns + c];
}

// In place, row by row: the gradients to weights become those to directions and lengths.
template <class T>
void through_weight_norm(int64_t rows, int64_t columns, const T* directions, const T* lengths, T* grad,
                         T* grad_lengths) {
  for (int64_t r = 0; r < rows; ++r)
    weight_norm_backward(OneThread{}, columns, directions + r * columns, lengths[r], grad + r * columns,
                         grad + r * columns, grad_lengths + r);
}

// The sums of all tasks, added in order, and the adjoint of the weight normalisation.
template <class T>
void finish_weights(const SdfWeights<T>& w, const SdfLayer<T>& layer,
                    const std::vector<std::unique_ptr<PaddedGrad<T>>>& sums, const SdfFieldGrad<T>& grad) {
  std::fill_n(grad.hidden, w.width * w.n_inputs, T(0));
  std::fill_n(grad.hidden_bias, w.width, T(0));
  std::fill_n(grad.out, w.n_outputs * w.width, T(0));
  std::fill_n(grad.out_bias, w.n_outputs, T(0));
  for (const auto& sum : sums) {
    add_unpadded(w.width, w.n_inputs, layer.input_columns, sum->hidden, grad.hidden);
    add_unpadded(1, w.width, layer.width_columns, sum->hidden_bias, grad.hidden_bias);
    add_unpadded(w.n_outputs, w.width, layer.width_columns, sum->out, grad.out);
    add_unpadded(1, w.n_outputs, w.n_outputs, sum->out_bias, grad.out_bias);
  }
  through_weight_norm(w.width, w.n_inputs, w.hidden, w.hidden_length, grad.hidden, grad.hidden_length);
  through_weight_norm(w.n_outputs, w.width, w.out, w.out_length, grad.out, grad.out_length);
}

// The gradient to the table.
template <class T>
void scatter(const SdfNetwork<T>& network, int64_t n, const T* positions, const LevelPlanes<const T>& levels,
             const T* along, T* grad_table) {
  const std::unique_ptr<T[]> unit(new T[3 * n]);
  for (int64_t k = 0; k < 3 * n; ++k) unit[k] = to_unit(positions[k], network.layer.scale);
  HashEncodeArgs<T> grid = network.grid;
  grid.n_points = n, grid.positions = unit.get();
  for_each_level(grid, grad_table,
                 [&](int level) { kernels<T>().hash_scatter_along(grid, level, levels, along, grad_table); });
}

}  // namespace

template <class T> void sdf_field(const SdfField<T>& field, int64_t n, const T* positions, const SdfOutputs<T>& to) {
  const PreparedField<T> prepared(field);
  const SdfLayer<T>& layer = prepared.network.layer;
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    EncodedPoints<T> encoded(prepared.network);
    std::vector<T> work(sdf_work_size(layer));
    encoded(
        begin, end, positions, [&](int64_t i) { return to.features + i * (layer.n_inputs - 3); },
        [&](const SdfPoints<T>& block, int64_t i) {
          kernels<T>().sdf_layer(layer, block, work.data(), to.outputs + i * layer.n_outputs, to.gradient + 3 * i);
        });
  });
}

template <class T>
void sdf_field_backward(const SdfField<T>& field, int64_t n, const T* positions, const SdfOutputs<const T>& given,
                        const SdfFieldGrad<T>& grad) {
  const PreparedField<T> prepared(field);
  const SdfLayer<T>& layer = prepared.network.layer;
  const int64_t n_features = layer.n_inputs - 3, n_tasks = (n + kGrain - 1) / kGrain, of_level = field.shape.n_features;
  const int64_t open = field.n_active * of_level;
  const std::unique_ptr<T[]> planes(new T[2 * n * open]);
  T *const to_features = planes.get(), *const slopes = planes.get() + n * open;
  std::vector<std::unique_ptr<PaddedGrad<T>>> sums(n_tasks);
  parallel_for(n_tasks, 1, [&](int64_t first, int64_t last) {
    EncodedPoints<T> encoded(prepared.network);
    std::vector<T> work(sdf_work_size(layer)), features(kEncoded * n_features);
    for (int64_t task = first; task < last; ++task) {
      sums[task] = std::make_unique<PaddedGrad<T>>(layer);
      encoded(
          task * kGrain, min_of(n, (task + 1) * kGrain), positions, [&](int64_t) { return features.data(); },
          [&](const SdfPoints<T>& block, int64_t i) {
            const SdfOutputs<const T> here{given.outputs + i * layer.n_outputs, given.features + i * n_features,
                                           given.gradient + 3 * i};
            kernels<T>().sdf_layer_backward(
                layer, block, here, work.data(),
                {to_features + i * of_level, slopes + i * of_level, n * of_level, field.n_active, int(of_level)},
                sums[task]->view());
          });
    }
  });
  finish_weights(field.weights, layer, sums, grad);
  scatter<T>(prepared.network, n, positions, {to_features, slopes, n * of_level, field.n_active, int(of_level)},
             given.gradient, grad.table);
}

#define SPLITNERF_INSTANTIATE(T)                                                                         \
  template void sdf_field<T>(const SdfField<T>&, int64_t, const T*, const SdfOutputs<T>&);               \
  template void sdf_field_backward<T>(const SdfField<T>&, int64_t, const T*, const SdfOutputs<const T>&, \
                                      const SdfFieldGrad<T>&);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cpu
