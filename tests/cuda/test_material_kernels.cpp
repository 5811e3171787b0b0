// Kernels of the materials' network, against the CPU.
#include <numeric>

#include "check.h"
#include "gpu.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/ops_cuda.h"

namespace splitnerf {
namespace {

// A network with its inputs in several arrays, and one of each gradient.
struct Network {
  MaterialWeights<double> weights{};
  std::vector<std::vector<double>> numbers;  // of weights and biases
  std::vector<std::vector<double>> inputs;
  std::vector<const double*> parts;

  Network(Random& random, int64_t n, const std::vector<int>& columns, const std::vector<int>& hidden) {
    weights.n_parts = static_cast<int>(columns.size()), weights.n_layers = static_cast<int>(hidden.size()) + 1;
    weights.sizes[0] = std::accumulate(columns.begin(), columns.end(), 0), weights.min_roughness = 0.1;
    for (size_t k = 0; k < columns.size(); ++k) {
      weights.columns[k] = columns[k];
      inputs.push_back(random.uniforms(n * columns[k], -1));
      parts.push_back(inputs.back().data());
    }
    for (int l = 0; l < weights.n_layers; ++l) {
      const int to = weights.sizes[l + 1] = l + 1 < weights.n_layers ? hidden[l] : kMaterialOutputs;
      numbers.push_back(random.uniforms(int64_t{to} * weights.sizes[l], -0.5, 0.5));
      numbers.push_back(random.uniforms(to, -0.5, 0.5));
      weights.weights[l] = numbers[2 * l].data(), weights.biases[l] = numbers[2 * l + 1].data();
    }
  }
};

struct Grads {
  std::vector<std::vector<double>> inputs, numbers;
  MaterialGrads<double> to{};

  explicit Grads(const Network& net) {
    for (const auto& x : net.inputs) inputs.push_back(unwritten<double>(x.size()));
    for (const auto& x : net.numbers) numbers.push_back(unwritten<double>(x.size()));
    for (size_t k = 0; k < inputs.size(); ++k) to.parts[k] = inputs[k].data();
    for (int l = 0; l < net.weights.n_layers; ++l)
      to.weights[l] = numbers[2 * l].data(), to.biases[l] = numbers[2 * l + 1].data();
  }
};

void check_network(const std::vector<int>& columns, const std::vector<int>& hidden, std::initializer_list<int64_t> sizes) {
  for (const int64_t n : sizes) {
    Random random(3);
    const Network net(random, n, columns, hidden);
    const auto g = random.uniforms(5 * n, -1);
    Gpu gpu;
    auto a = unwritten<double>(5 * n), b = a;
    const auto arrays = [&](auto* p) {
      return MaterialArrays<std::remove_pointer_t<decltype(p)>>{p, p + 3 * n, p + 4 * n};
    };
    cpu::material_network(net.weights, n, net.parts.data(), arrays(a.data()));
    cuda::material_network(gpu.queue(), net.weights, n, net.parts.data(), arrays(b.data()));
    expect_near(b, a, 1e-14);
    Grads to_a(net), to_b(net);
    cpu::material_network_backward(net.weights, n, net.parts.data(), arrays(g.data()), to_a.to);
    cuda::material_network_backward(gpu.queue(), net.weights, n, net.parts.data(), arrays(g.data()), to_b.to);
    for (size_t k = 0; k < to_a.inputs.size(); ++k) expect_near(to_b.inputs[k], to_a.inputs[k], 1e-14);
    for (size_t k = 0; k < to_a.numbers.size(); ++k) expect_near(to_b.numbers[k], to_a.numbers[k], 1e-11);
  }
}
TEST(MaterialKernels, NetworkAndItsGradients) { check_network({13, 3, 6}, {21, 18}, {0, 1, 64, 131}); }
TEST(MaterialKernels, AnyNumberOfLayers) {
  check_network({7}, {}, {0, 1, 70});
  check_network({2, 1}, {40}, {70});
  check_network({5}, {8, 3, 8}, {70});
}
// The last size gives each of the 256 blocks of 64 points a second tile, the last of them not full.
TEST(MaterialKernels, MoreTilesThanBlocks) { check_network({3}, {4, 4}, {2 * 64 * 256 + 17}); }

// A tile of doubles of so many units only fits with 32 points, one of more does not fit at all.
TEST(MaterialKernels, WideLayers) {
  check_network({16}, {150, 150}, {0, 1, 70});
  Random random(1);
  const Network net(random, 1, {4}, {2000});
  Gpu gpu;
  std::vector<double> out(5);
  EXPECT_THROW(cuda::material_network(gpu.queue(), net.weights, 1, net.parts.data(),
                                      MaterialArrays<double>{out.data(), out.data() + 3, out.data() + 4}),
               std::invalid_argument);
}

}  // namespace
}  // namespace splitnerf
