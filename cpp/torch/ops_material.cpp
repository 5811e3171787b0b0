// material_network as a torch operator.
#include <tuple>
#include <vector>

#include "device.h"

namespace splitnerf::glue {
namespace {

// Inputs and weights, checked and contiguous.
struct Network {
  Kind type;
  std::vector<Tensor> inputs, weights, biases;
  int64_t n;
  double min_roughness;

  Network(const char* op, const std::vector<Tensor>& inputs_in, const std::vector<Tensor>& weights_in,
          const std::vector<Tensor>& biases_in, double min_roughness)
      : type(first_kind(op, inputs_in)), min_roughness(min_roughness) {
    require(inputs_in.size() <= kMostMaterialInputs, op, "inputs must be 1 to " + std::to_string(kMostMaterialInputs));
    require(!weights_in.empty() && weights_in.size() <= kMostMaterialLayers && weights_in.size() == biases_in.size(),
            op, "weights and biases must be as many, 1 to " + std::to_string(kMostMaterialLayers));
    int64_t columns = 0;
    n = inputs_in[0].size(0);
    for (const Tensor& t : inputs_in) {
      inputs.push_back(checked(op, "inputs", t, {n, kAny}, type));
      columns += t.size(1);
    }
    for (size_t l = 0; l < weights_in.size(); ++l) {
      const int64_t outputs = l + 1 == weights_in.size() ? kMaterialOutputs : kAny;
      weights.push_back(checked(op, "weights", weights_in[l], {outputs, columns}, type));
      columns = weights[l].size(0);
      biases.push_back(checked(op, "biases", biases_in[l], {columns}, type));
    }
    require(min_roughness >= 0 && min_roughness < 1, op, "min_roughness must be in [0, 1)");
  }
  template <class T> MaterialWeights<T> view() const {
    MaterialWeights<T> w{};
    w.n_layers = static_cast<int>(weights.size()), w.n_parts = static_cast<int>(inputs.size());
    w.min_roughness = T(min_roughness);
    for (int k = 0; k < w.n_parts; ++k) w.sizes[0] += w.columns[k] = static_cast<int>(inputs[k].size(1));
    for (int l = 0; l < w.n_layers; ++l) {
      w.sizes[l + 1] = static_cast<int>(weights[l].size(0));
      w.weights[l] = in<T>(weights[l]), w.biases[l] = in<T>(biases[l]);
    }
    return w;
  }
  template <class T> std::vector<const T*> parts() const {
    std::vector<const T*> rows;
    for (const Tensor& t : inputs) rows.push_back(in<T>(t));
    return rows;
  }

 private:
  static Kind first_kind(const char* op, const std::vector<Tensor>& inputs) {
    require(!inputs.empty() && inputs[0].dim() == 2, op, "inputs must hold a [n, columns] tensor");
    return real_kind(op, "inputs", inputs[0]);
  }
};

std::tuple<Tensor, Tensor, Tensor> material_network(std::vector<Tensor> inputs, std::vector<Tensor> weights,
                                                    std::vector<Tensor> biases, double min_roughness) {
  const char* op = "material_network";
  const Network net(op, inputs, weights, biases, min_roughness);
  const auto make = [&](int64_t columns) { return empty_like_type(net.inputs[0], {net.n, columns}, net.type); };
  Tensor albedo = make(3), roughness = make(1), metallic = make(1);
  on_device(net.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    const auto parts = net.parts<T>();
    const MaterialArrays<T> to{out<T>(albedo), out<T>(roughness), out<T>(metallic)};
    device.material_network(net.view<T>(), net.n, parts.data(), to);
  });
  return {albedo, roughness, metallic};
}

// The gradients to inputs, weights and biases, in one list.
std::vector<Tensor> material_network_backward(std::vector<Tensor> inputs, std::vector<Tensor> weights,
                                              std::vector<Tensor> biases, double min_roughness, Tensor grad_albedo,
                                              Tensor grad_roughness, Tensor grad_metallic) {
  const char* op = "material_network_backward";
  const Network net(op, inputs, weights, biases, min_roughness);
  const Tensor ga = checked(op, "grad_albedo", grad_albedo, {net.n, 3}, net.type);
  const Tensor gr = checked(op, "grad_roughness", grad_roughness, {net.n, 1}, net.type);
  const Tensor gm = checked(op, "grad_metallic", grad_metallic, {net.n, 1}, net.type);
  std::vector<Tensor> grads;
  for (const auto* list : {&net.inputs, &net.weights, &net.biases})
    for (const Tensor& t : *list) grads.push_back(torch::stable::empty_like(t));
  on_device(net.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    const auto parts = net.parts<T>();
    MaterialGrads<T> to{};
    const size_t n_parts = net.inputs.size(), n_layers = net.weights.size();
    for (size_t k = 0; k < n_parts; ++k) to.parts[k] = out<T>(grads[k]);
    for (size_t l = 0; l < n_layers; ++l)
      to.weights[l] = out<T>(grads[n_parts + l]), to.biases[l] = out<T>(grads[n_parts + n_layers + l]);
    device.material_network_backward(net.view<T>(), net.n, parts.data(),
                                     MaterialArrays<const T>{in<T>(ga), in<T>(gr), in<T>(gm)}, to);
  });
  return grads;
}

}  // namespace

STABLE_TORCH_LIBRARY_FRAGMENT(splitnerf, m) {
  m.def(
      "material_network(Tensor[] inputs, Tensor[] weights, Tensor[] biases, float min_roughness) -> "
      "(Tensor, Tensor, Tensor)");
  m.def(
      "material_network_backward(Tensor[] inputs, Tensor[] weights, Tensor[] biases, float min_roughness, "
      "Tensor grad_albedo, Tensor grad_roughness, Tensor grad_metallic) -> Tensor[]");
}

SPLITNERF_IMPLEMENT(m) {
  m.impl("material_network", TORCH_BOX(&material_network));
  m.impl("material_network_backward", TORCH_BOX(&material_network_backward));
}

}  // namespace splitnerf::glue
