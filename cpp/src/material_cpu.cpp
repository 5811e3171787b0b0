// The materials' network in tasks of points, blocks of each through the kernels of src/kernels/material_network.cpp.
#include <algorithm>
#include <memory>
#include <vector>

#include "splitnerf/kernels.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"

namespace splitnerf::cpu {
namespace {

constexpr int64_t kGrain = 512;  // points of a task

// The network with its numbers as the kernels read them.
template <class T> struct PreparedMaterial {
  std::vector<T> numbers;
  MaterialNetwork<T> net;

  explicit PreparedMaterial(const MaterialWeights<T>& w) {
    constexpr int kLanes = 64 / sizeof(T);
    numbers.resize(material_numbers(w, kLanes));
    net = material_shape(w, kLanes, numbers.data());
    T* to = numbers.data();
    for (int l = 0; l < net.n_layers; ++l)
      for (int64_t i = 0, size = net.layers[l].size(); i < size; ++i)
        *to++ = padded_number(net.layers[l], w.weights[l], w.biases[l], i);
  }
  // Values of work memory for a block: each layer's values, and the gradients to what stands before it.
  int64_t work_size() const {
    int64_t columns = 0;
    for (int l = 0; l < net.n_layers; ++l) columns += net.layers[l].output_columns + net.layers[l].input_columns;
    return kMaterialBlock * columns;
  }
};

// The memory of one task.
template <class T> struct Task {
  std::vector<T> work, inputs, grad_inputs, values;

  explicit Task(const PreparedMaterial<T>& m)
      : work(m.work_size()), inputs(kMaterialBlock * m.net.layers[0].input_columns), grad_inputs(inputs.size()),
        values(kMaterialBlock * kMaterialOutputs) {}
};

// Rows [first, first + n) of the parts, joined by columns; the padding stays 0.
template <class T>
void join(const MaterialWeights<T>& w, const T* const* parts, int64_t first, int64_t n, int64_t columns, T* inputs) {
  for (int part = 0; part < w.n_parts; ++part) {
    const int64_t its = w.columns[part];
    for (int64_t p = 0; p < n; ++p) std::copy_n(parts[part] + (first + p) * its, its, inputs + p * columns);
    inputs += its;
  }
}
// The reverse.
template <class T>
void divide(const MaterialWeights<T>& w, const T* inputs, int64_t first, int64_t n, int64_t columns, T* const* parts) {
  for (int part = 0; part < w.n_parts; ++part) {
    const int64_t its = w.columns[part];
    for (int64_t p = 0; p < n; ++p) std::copy_n(inputs + p * columns, its, parts[part] + (first + p) * its);
    inputs += its;
  }
}

}  // namespace

template <class T>
void material_network(const MaterialWeights<T>& weights, int64_t n, const T* const* parts, const MaterialArrays<T>& to) {
  const Kernels<T>& k = kernels<T>();
  const PreparedMaterial<T> prepared(weights);
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    Task<T> task(prepared);
    for (int64_t i = begin; i < end; i += kMaterialBlock) {
      const int64_t here = min_of<int64_t>(kMaterialBlock, end - i);
      join(weights, parts, i, here, prepared.net.layers[0].input_columns, task.inputs.data());
      k.material_network(prepared.net, here, task.inputs.data(), task.work.data(), task.values.data());
      for (int64_t p = 0; p < here; ++p)
        for (int m = 0; m < kMaterialOutputs; ++m) to.at(i + p, m) = task.values[p * kMaterialOutputs + m];
    }
  });
}

template <class T>
void material_network_backward(const MaterialWeights<T>& weights, int64_t n, const T* const* parts,
                               const MaterialArrays<const T>& grad, const MaterialGrads<T>& to) {
  const Kernels<T>& k = kernels<T>();
  const PreparedMaterial<T> prepared(weights);
  const MaterialNetwork<T>& net = prepared.net;
  const int64_t columns = net.layers[0].input_columns, n_tasks = (n + kGrain - 1) / kGrain, size = net.grad_size();
  std::vector<T> sums(n_tasks * size);  // one list a task, added in order: the same bits each time
  parallel_for(n_tasks, 1, [&](int64_t first, int64_t last) {
    Task<T> task(prepared);
    for (int64_t t = first; t < last; ++t)
      for (int64_t i = t * kGrain, end = min_of(n, (t + 1) * kGrain); i < end; i += kMaterialBlock) {
        const int64_t here = min_of<int64_t>(kMaterialBlock, end - i);
        join(weights, parts, i, here, columns, task.inputs.data());
        for (int64_t p = 0; p < here; ++p)
          for (int m = 0; m < kMaterialOutputs; ++m) task.values[p * kMaterialOutputs + m] = grad.at(i + p, m);
        k.material_network_backward(net, here, task.inputs.data(), task.values.data(), task.work.data(),
                                    task.grad_inputs.data(), sums.data() + t * size);
        divide(weights, task.grad_inputs.data(), i, here, columns, to.parts);
      }
  });
  for (int64_t l = 0, at = 0; l < net.n_layers; at += net.layers[l++].grad_size())
    for (int64_t i = 0; i < net.layers[l].grad_size(); ++i) {
      T total = T(0);
      for (int64_t t = 0; t < n_tasks; ++t) total += sums[t * size + at + i];
      if (T* place = grad_place(net.layers[l], to.weights[l], to.biases[l], i)) *place = total;
    }
}

#define SPLITNERF_INSTANTIATE(T)                                                                                    \
  template void material_network<T>(const MaterialWeights<T>&, int64_t, const T* const*, const MaterialArrays<T>&); \
  template void material_network_backward<T>(const MaterialWeights<T>&, int64_t, const T* const*,                   \
                                             const MaterialArrays<const T>&, const MaterialGrads<T>&);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cpu
