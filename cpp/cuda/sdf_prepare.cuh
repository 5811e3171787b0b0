// The weights of the distance field as its kernels read them: rows normalised, W transposed and units padded.
#pragma once

#include "launch.cuh"
#include "splitnerf/sdf_layer.h"

namespace splitnerf::cuda {

inline constexpr int kPaddedUnits = 16;  // their number is a multiple of this

// A row of W, of which those beyond the last unit are zeros, or of V.
template <class T> struct PrepareBody {
  SdfWeights<T> weights;
  SdfLayer<T> layer;
  T *hidden_transposed, *hidden_bias, *out;

  template <class Group> SPLITNERF_HD void operator()(const Group& group, int64_t r) const {
    const int64_t columns = layer.width_columns;
    if (r < columns) {
      const int64_t n = weights.n_inputs;
      const bool real = r < weights.width;
      const T* row = weights.hidden + r * n;
      const T scale = real ? scale_of(group, row, n, weights.hidden_length, r) : T(0);
      for (int64_t k = group.lane(); k < n; k += Group::size)
        hidden_transposed[k * columns + r] = real ? scale * row[k] : T(0);
      if (group.lane() == 0) hidden_bias[r] = real ? weights.hidden_bias[r] : T(0);
    } else {
      const int64_t m = r - columns, n = weights.width;
      const T* row = weights.out + m * n;
      const T scale = scale_of(group, row, n, weights.out_length, m);
      for (int64_t h = group.lane(); h < columns; h += Group::size)
        out[m * columns + h] = h < n ? scale * row[h] : T(0);
    }
  }

 private:
  template <class Group>
  SPLITNERF_HD static T scale_of(const Group& group, const T* row, int64_t n, const T* lengths, int64_t r) {
    return lengths ? lengths[r] * inverse_norm(group, n, row) : T(1);
  }
};

// W [n_inputs, units], b [units] and V [n_outputs, units] stand behind one another.
template <class T> SdfLayer<T> prepare(const Queue& queue, const char* op, const SdfWeights<T>& w) {
  SdfLayer<T> layer{};
  layer.n_inputs = w.n_inputs, layer.width = w.width, layer.n_outputs = w.n_outputs;
  layer.width_columns = (w.width + kPaddedUnits - 1) / kPaddedUnits * kPaddedUnits;
  layer.beta = w.beta, layer.scale = T(0.5) / w.box;
  T* const hidden = queue.scratch<T>((layer.n_inputs + 1 + layer.n_outputs) * layer.width_columns);
  T *const bias = hidden + layer.n_inputs * layer.width_columns, *const out = bias + layer.width_columns;
  layer.hidden_transposed = hidden, layer.hidden_bias = bias, layer.out = out, layer.out_bias = w.out_bias;
  for_each_group(queue, op, layer.width_columns + layer.n_outputs, PrepareBody<T>{w, layer, hidden, bias, out});
  return layer;
}

}  // namespace splitnerf::cuda
