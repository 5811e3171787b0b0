#include <algorithm>
#include <array>
#include <memory>
#include <vector>

#include "splitnerf/kernels.h"
#include "splitnerf/neus.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"

namespace splitnerf::cpu {
namespace {

// A ray on its way: the distance at sample `k` is asked for next.
template <class T> struct Walker {
  RayLattice<T> lattice;
  int64_t k;
  int64_t last = -1;        // the sample before, -1 for none
  T f_last = T(0);          // the distance there
  bool last_kept = false;
  T depth = T(0);           // optical depth up to there
  SampledRay<T>* kept;
};

// Takes the distance at w.k and moves on; k = -1 where the ray ends.
template <class T>
void advance(Walker<T>& w, T f, const uint8_t* cells, const MarchOptions& march, const SampleRules<T>& rules) {
  SampledRay<T>& ray = *w.kept;
  ++ray.n_evaluated;
  bool keep = !(f == f);  // a NaN is kept: whoever renders the samples shall see it
  if (w.last >= 0) {
    const T tau = neus_optical_depth(w.f_last, f, rules.s);
    const T weight = std::exp(-w.depth) * -std::expm1(-tau);
    if (weight > rules.min_weight) {
      if (!w.last_kept) ray.starts.push_back(w.lattice.start(w.last));
      keep = true;
    }
    w.depth += tau;
  }
  if (keep) ray.starts.push_back(w.lattice.start(w.k));
  w.last = w.k, w.f_last = f, w.last_kept = keep;
  if (w.depth > rules.max_depth || ray.n_evaluated >= march.max_samples) {
    w.k = -1;
    return;
  }
  // Within (|f| - reach) / Lipschitz there is no density.
  const T free = (std::abs(f) - rules.reach) / (rules.lipschitz * w.lattice.step);
  w.k = next_occupied(w.lattice, cells, march, w.k + (free > T(1) ? static_cast<int64_t>(min_of(free, T(w.lattice.n_steps))) : 1));
}

// A field as the kernels read it.
template <class T> struct PreparedField {
  std::array<HashLevel, kMaxLevels> levels;
  PreparedSdfLayer<T> layer;
  SdfNetwork<T> network;

  explicit PreparedField(const SdfField<T>& f) : layer(f.weights) {
    hash_levels(f.shape, levels.data());
    network = {{levels.data(), f.shape.n_features, f.shape.n_levels, f.n_active, 0, nullptr, f.table}, layer.layer()};
  }
};

// Gradients of the weights, padded as in SdfLayer.
template <class T> struct PaddedGrad {
  std::vector<T> hidden, hidden_bias, out, out_bias;

  explicit PaddedGrad(const SdfLayer<T>& l)
      : hidden(l.width * l.input_columns), hidden_bias(l.width_columns), out(l.n_outputs * l.width_columns), out_bias(l.n_outputs) {}
  SdfLayerGrad<T> view() { return {hidden.data(), hidden_bias.data(), out.data(), out_bias.data()}; }
};

// matrix [rows, columns] += padded [rows, padded_columns]
template <class T>
void add_unpadded(int64_t rows, int64_t columns, int64_t padded_columns, const std::vector<T>& padded, T* matrix) {
  for (int64_t r = 0; r < rows; ++r)
    for (int64_t c = 0; c < columns; ++c) matrix[r * columns + c] += padded[r * padded_columns + c];
}

constexpr int64_t kLayerGrain = 512;  // points of a task

}  // namespace

template <class T> void sdf_values(const SdfField<T>& field, int64_t n, const T* positions, T* values) {
  const Kernels<T>& k = kernels<T>();
  const PreparedField<T> prepared(field);
  parallel_for(n, kLayerGrain, [&](int64_t begin, int64_t end) {
    std::vector<T> work(sdf_work_size(prepared.network.layer));
    for (int64_t i = begin; i < end; i += kSdfBlock)
      k.sdf_values(prepared.network, min_of<int64_t>(kSdfBlock, end - i), positions + 3 * i, work.data(), values + i);
  });
}

template <class T>
void sdf_layer(const SdfWeights<T>& weights, int64_t n, const T* positions, const T* features, const T* jacobian,
               T* outputs, T* gradient) {
  const Kernels<T>& k = kernels<T>();
  const PreparedSdfLayer<T> prepared(weights);
  const int64_t n_features = weights.n_inputs - 3;
  parallel_for(n, kLayerGrain, [&](int64_t begin, int64_t end) {
    std::vector<T> work(sdf_work_size(prepared.layer()));
    for (int64_t i = begin; i < end; i += kSdfBlock) {
      const SdfPoints<T> block{min_of<int64_t>(kSdfBlock, end - i), positions + 3 * i, features + i * n_features,
                               jacobian + 3 * i * n_features};
      k.sdf_layer(prepared.layer(), block, work.data(), outputs + i * weights.n_outputs, gradient + 3 * i);
    }
  });
}

template <class T>
void sdf_layer_backward(const SdfWeights<T>& weights, int64_t n, const T* positions, const T* features, const T* jacobian,
                        const T* grad_outputs, const T* grad_gradient, T* grad_features, T* grad_jacobian, T* grad_hidden,
                        T* grad_hidden_bias, T* grad_out, T* grad_out_bias) {
  const Kernels<T>& k = kernels<T>();
  const PreparedSdfLayer<T> prepared(weights);
  const SdfLayer<T>& layer = prepared.layer();
  const int64_t n_features = weights.n_inputs - 3, n_tasks = (n + kLayerGrain - 1) / kLayerGrain;
  std::vector<std::unique_ptr<PaddedGrad<T>>> sums(n_tasks);  // one a task, added in order: the same bits each time
  parallel_for(n_tasks, 1, [&](int64_t first, int64_t last) {
    std::vector<T> work(sdf_work_size(layer));
    for (int64_t task = first; task < last; ++task) {
      sums[task] = std::make_unique<PaddedGrad<T>>(layer);
      const int64_t end = min_of(n, (task + 1) * kLayerGrain);
      for (int64_t i = task * kLayerGrain; i < end; i += kSdfBlock) {
        const SdfPoints<T> block{min_of<int64_t>(kSdfBlock, end - i), positions + 3 * i, features + i * n_features,
                                 jacobian + 3 * i * n_features};
        k.sdf_layer_backward(layer, block, grad_outputs + i * weights.n_outputs, grad_gradient + 3 * i, work.data(),
                             grad_features + i * n_features, grad_jacobian + 3 * i * n_features, sums[task]->view());
      }
    }
  });
  std::fill(grad_hidden, grad_hidden + layer.width * layer.n_inputs, T(0));
  std::fill(grad_hidden_bias, grad_hidden_bias + layer.width, T(0));
  std::fill(grad_out, grad_out + layer.n_outputs * layer.width, T(0));
  std::fill(grad_out_bias, grad_out_bias + layer.n_outputs, T(0));
  for (const auto& sum : sums) {
    add_unpadded(layer.width, layer.n_inputs, layer.input_columns, sum->hidden, grad_hidden);
    add_unpadded(1, layer.width, layer.width_columns, sum->hidden_bias, grad_hidden_bias);
    add_unpadded(layer.n_outputs, layer.width, layer.width_columns, sum->out, grad_out);
    add_unpadded(1, layer.n_outputs, layer.n_outputs, sum->out_bias, grad_out_bias);
  }
}

template <class T>
void sample_rays(const SdfField<T>& field, const MarchOptions& march, const uint8_t* cells, const SampleRules<T>& rules,
                 int64_t n_rays, const T* rays_o, const T* rays_d, const T* jitter, SampledRay<T>* sampled) {
  const Kernels<T>& k = kernels<T>();
  const PreparedField<T> prepared(field);
  parallel_for(n_rays, kSdfBlock, [&](int64_t begin, int64_t end) {
    std::vector<T> work(sdf_work_size(prepared.network.layer)), positions(3 * kSdfBlock), values(kSdfBlock);
    std::vector<Walker<T>> walkers;
    for (int64_t r = begin; r < end || !walkers.empty();) {
      for (; r < end && walkers.size() < kSdfBlock; ++r) {
        const RayLattice<T> lattice(load3(rays_o + 3 * r), load3(rays_d + 3 * r), jitter[r], march);
        const int64_t start = next_occupied(lattice, cells, march, 0);
        if (start >= 0) walkers.push_back({lattice, start, -1, T(0), false, T(0), sampled + r});
      }
      const int64_t n = static_cast<int64_t>(walkers.size());
      for (int64_t i = 0; i < n; ++i) store3(positions.data() + 3 * i, walkers[i].lattice.middle(walkers[i].k));
      k.sdf_values(prepared.network, n, positions.data(), work.data(), values.data());
      const auto ended = [&](const Walker<T>& w) { return w.k < 0; };
      for (int64_t i = 0; i < n; ++i) advance(walkers[i], values[i], cells, march, rules);
      walkers.erase(std::remove_if(walkers.begin(), walkers.end(), ended), walkers.end());
    }
  });
}

#define SPLITNERF_INSTANTIATE(T)                                                                                      \
  template void sdf_values<T>(const SdfField<T>&, int64_t, const T*, T*);                                             \
  template void sdf_layer<T>(const SdfWeights<T>&, int64_t, const T*, const T*, const T*, T*, T*);                    \
  template void sdf_layer_backward<T>(const SdfWeights<T>&, int64_t, const T*, const T*, const T*, const T*, const T*, \
                                      T*, T*, T*, T*, T*, T*);                                                        \
  template void sample_rays<T>(const SdfField<T>&, const MarchOptions&, const uint8_t*, const SampleRules<T>&,        \
                               int64_t, const T*, const T*, const T*, SampledRay<T>*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cpu
