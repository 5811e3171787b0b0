#include <algorithm>
#include <array>
#include <memory>
#include <vector>

#include "splitnerf/bodies/rays.h"
#include "splitnerf/kernels.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"
#include "splitnerf/ray_walk.h"

namespace splitnerf::cpu {
namespace {

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
void sdf_layer_backward(const SdfWeights<T>& weights, int64_t n, const T* positions, const T* features,
                        const T* jacobian, const T* grad_outputs, const T* grad_gradient, T* grad_features,
                        T* grad_jacobian, T* grad_hidden, T* grad_hidden_bias, T* grad_out, T* grad_out_bias) {
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
void sample_rays(const SdfField<T>& field, const MarchOptions& march, const OccupancyView& grid,
                 const SampleRules<T>& rules, int64_t n_rays, const T* rays_o, const T* rays_d, const T* jitter,
                 int64_t room, int64_t* offsets, int64_t* n_evaluated, int64_t* n_found,
                 const SampleAllocator<T>& allocate) {
  const Kernels<T>& k = kernels<T>();
  const PreparedField<T> prepared(field);
  std::vector<std::vector<T>> kept(n_rays);  // where the samples of each ray start, front to back
  std::fill(n_evaluated, n_evaluated + n_rays, 0);
  parallel_for(n_rays, kSdfBlock, [&](int64_t begin, int64_t end) {
    std::vector<T> work(sdf_work_size(prepared.network.layer)), positions(3 * kSdfBlock), values(kSdfBlock);
    std::vector<Walk<T>> walks;
    for (int64_t r = begin; r < end || !walks.empty();) {
      for (; r < end && walks.size() < kSdfBlock; ++r) {
        Walk<T> walk(RayLattice<T>(load3(rays_o + 3 * r), load3(rays_d + 3 * r), jitter[r], march), r, march, grid);
        if (walk.next >= 0) walks.push_back(walk);
      }
      const int64_t n = static_cast<int64_t>(walks.size());
      for (int64_t i = 0; i < n; ++i) store3(positions.data() + 3 * i, walks[i].lattice.middle(walks[i].next));
      k.sdf_values(prepared.network, n, positions.data(), work.data(), values.data());
      for (int64_t i = 0; i < n; ++i) {
        std::vector<T>& starts = kept[walks[i].ray];
        advance(walks[i], values[i], grid, march, rules, [&](T start) { starts.push_back(start); });
        n_evaluated[walks[i].ray] = walks[i].n_evaluated;
      }
      walks.erase(std::remove_if(walks.begin(), walks.end(), [](const Walk<T>& w) { return w.next < 0; }), walks.end());
    }
  });
  std::vector<int64_t> all(n_rays + 1);
  for (int64_t r = 0; r < n_rays; ++r) all[r + 1] = all[r] + static_cast<int64_t>(kept[r].size());
  const int64_t rows = room > 0 ? room : all[n_rays];
  const FitOffsetsBody fit{n_rays, rows, all.data(), offsets, n_found};
  for (int64_t r = 0; r <= n_rays; ++r) fit(r);
  const PackedSamples<T> to = allocate(rows);
  for (int64_t r = 0; r < n_rays; ++r) {
    for (int64_t i = offsets[r]; i < offsets[r + 1]; ++i) {
      to.ray_indices[i] = r;
      to.t_starts[i] = kept[r][i - offsets[r]];
      to.t_ends[i] = to.t_starts[i] + T(march.step);
    }
  }
  const PadSamplesBody<T> pad{offsets + n_rays, to};
  for (int64_t i = offsets[n_rays]; i < rows; ++i) pad(i);
}

#define SPLITNERF_INSTANTIATE(T)                                                                                       \
  template void sdf_values<T>(const SdfField<T>&, int64_t, const T*, T*);                                              \
  template void sdf_layer<T>(const SdfWeights<T>&, int64_t, const T*, const T*, const T*, T*, T*);                     \
  template void sdf_layer_backward<T>(const SdfWeights<T>&, int64_t, const T*, const T*, const T*, const T*, const T*, \
                                      T*, T*, T*, T*, T*, T*);                                                         \
  template void sample_rays<T>(const SdfField<T>&, const MarchOptions&, const OccupancyView&, const SampleRules<T>&,   \
                               int64_t, const T*, const T*, const T*, int64_t, int64_t*, int64_t*, int64_t*,           \
                               const SampleAllocator<T>&);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cpu
