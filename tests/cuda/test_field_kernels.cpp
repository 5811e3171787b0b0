// Kernels of the distance field and its hash grid, against the CPU.
#include <array>

#include "check.h"
#include "gpu.h"
#include "runtime/cuda_on_cpu.h"
#include "splitnerf/march.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/ops_cuda.h"

namespace splitnerf {
namespace {

// ---- hash grid ----

// Numbers in [-1, 1] as a table stores them; of 16 bits any that are finite and not above 1.
template <class S> std::vector<S> drawn_entries(Random& random, size_t n) {
  if constexpr (std::is_floating_point_v<S>) {
    return random.uniforms<S>(n, -1);
  } else {
    std::vector<S> out(n);
    for (S& x : out) x.bits = static_cast<uint16_t>(random.below(0x3c01) | random.below(2) << 15);
    return out;
  }
}

// S: what the table stores.
template <class T, int F, class S = T> void check_hash_grid(double tolerance) {
  const HashGridShape shape{4, F, 4, 1.7, 8};  // two dense levels, two hashed ones
  const int n_active = 3;
  HashLevel levels[kMaxLevels];
  const int64_t n_entries = hash_levels(shape, levels), columns = shape.n_levels * F;
  for (const int64_t n : {0, 1, 256, 601}) {
    Random random(F);
    const auto positions = random.uniforms<T>(3 * n, -0.1, 1.1);
    const auto table = drawn_entries<S>(random, n_entries * F);
    const auto g = random.uniforms<T>(n * columns, -1);
    Gpu gpu;
    auto features = unwritten<T>(n * columns), features1 = features;
    cpu::hash_encode(shape, n_active, n, positions.data(), table.data(), features.data());
    cuda::hash_encode(gpu.queue(), shape, n_active, n, positions.data(), table.data(), features1.data());
    expect_near(features1, features, tolerance);

    auto to_table = unwritten<T>(n_entries * F), to_table1 = to_table;
    cpu::hash_encode_backward(shape, n_active, n, positions.data(), g.data(), to_table.data());
    cuda::hash_encode_backward(gpu.queue(), shape, n_active, n, positions.data(), g.data(), to_table1.data());
    expect_near(to_table1, to_table, tolerance);
    auto to_positions = unwritten<T>(3 * n), to_positions1 = to_positions;
    cpu::hash_encode_backward_positions(shape, n_active, n, positions.data(), table.data(), g.data(),
                                        to_positions.data());
    cuda::hash_encode_backward_positions(gpu.queue(), shape, n_active, n, positions.data(), table.data(), g.data(),
                                         to_positions1.data());
    expect_near(to_positions1, to_positions, tolerance);
  }
}

TEST(FieldKernels, HashGrid) {
  check_hash_grid<double, 1>(1e-13), check_hash_grid<double, 2>(1e-13);
  check_hash_grid<double, 4>(1e-13), check_hash_grid<double, 8>(1e-13);
  check_hash_grid<float, 1>(2e-5), check_hash_grid<float, 2>(2e-5), check_hash_grid<float, 4>(2e-5),
      check_hash_grid<float, 8>(2e-5);
}
TEST(FieldKernels, HashGridOf16Bits) {
  check_hash_grid<float, 1, Half>(2e-5), check_hash_grid<float, 2, Half>(2e-5);
  check_hash_grid<float, 4, Half>(2e-5), check_hash_grid<float, 8, Half>(2e-5);
}

// ---- the network ----

constexpr HashGridShape kShape{6, 2, 4, 1.5, 8};

struct Network {
  int n_features = kShape.n_levels * kShape.n_features, n_inputs = 3 + n_features, width, n_outputs;
  std::vector<double> hidden, hidden_bias, out, out_bias;
  SdfWeights<double> weights;

  explicit Network(Random& random, int width = 21, int n_outputs = 5) : width(width), n_outputs(n_outputs) {
    hidden = random.uniforms(width * n_inputs, -0.5, 0.5), hidden_bias = random.uniforms(width, -0.1, 0.1);
    out = random.uniforms(n_outputs * width, -1), out_bias = random.uniforms(n_outputs, -1);
    weights = {n_inputs, width, n_outputs, hidden.data(), hidden_bias.data(), out.data(), out_bias.data(), 20., 1.5};
  }
};

struct Field {
  Network net;
  std::vector<double> table;

  explicit Field(Random& random, int width = 21) : net(random, width) {
    HashLevel levels[kMaxLevels];
    table = random.uniforms(hash_levels(kShape, levels) * kShape.n_features, -1);
  }
  SdfField<double> view() const { return {kShape, 5, table.data(), net.weights}; }
};

// A field of any sizes whose rows of weights have lengths, in T, its table in S.
template <class T, class S> struct Lengthy {
  HashGridShape shape;
  int n_inputs, width, n_outputs;
  int64_t n_entries;
  std::vector<S> table;
  std::vector<T> hidden, hidden_length, hidden_bias, out, out_length, out_bias;

  Lengthy(Random& random, const HashGridShape& shape, int width, int n_outputs)
      : shape(shape), n_inputs(3 + shape.n_levels * shape.n_features), width(width), n_outputs(n_outputs) {
    HashLevel levels[kMaxLevels];
    n_entries = hash_levels(shape, levels);
    table = drawn_entries<S>(random, n_entries * shape.n_features);
    hidden = random.uniforms<T>(width * n_inputs, -2, 2), hidden_length = random.uniforms<T>(width, 0.1, 1);
    hidden_bias = random.uniforms<T>(width, -0.1, 0.1);
    out = random.uniforms<T>(n_outputs * width, -3, 3), out_length = random.uniforms<T>(n_outputs, 0.5, 2);
    out_bias = random.uniforms<T>(n_outputs, -1);
  }
  SdfField<T> view() const {
    return {shape,
            shape.n_levels - 1,
            table.data(),
            {n_inputs, width, n_outputs, hidden.data(), hidden_bias.data(), out.data(), out_bias.data(), T(20), T(1.5),
             hidden_length.data(), out_length.data()}};
  }
};

template <class T> struct FieldResults {
  std::vector<T> outputs, features, gradient;

  template <class F>
  FieldResults(const F& field, int64_t n)
      : outputs(unwritten<T>(n * field.n_outputs)), features(unwritten<T>(n * (field.n_inputs - 3))),
        gradient(unwritten<T>(3 * n)) {}
  SdfOutputs<T> view() { return {outputs.data(), features.data(), gradient.data()}; }
};
template <class T> struct FieldGradients {
  std::vector<T> table, hidden, hidden_length, hidden_bias, out, out_length, out_bias;

  template <class F>
  explicit FieldGradients(const F& field)
      : table(unwritten<T>(field.table.size())), hidden(unwritten<T>(field.hidden.size())),
        hidden_length(unwritten<T>(field.width)), hidden_bias(unwritten<T>(field.width)),
        out(unwritten<T>(field.out.size())), out_length(unwritten<T>(field.n_outputs)),
        out_bias(unwritten<T>(field.n_outputs)) {}
  SdfFieldGrad<T> view() {
    return {table.data(), hidden.data(),     hidden_length.data(), hidden_bias.data(),
            out.data(),   out_length.data(), out_bias.data()};
  }
};

template <class T, class S = T>
void check_field(const HashGridShape& shape, int width, int n_outputs, std::initializer_list<int64_t> sizes,
                 double tolerance) {
  for (const int64_t n : sizes) {
    Random random(3);
    const Lengthy<T, S> field(random, shape, width, n_outputs);
    const auto x = random.uniforms<T>(3 * n, -1.7, 1.7);
    FieldResults<T> a(field, n), b(field, n);
    Gpu gpu;
    cpu::sdf_field(field.view(), n, x.data(), a.view());
    cuda::sdf_field(gpu.queue(), field.view(), n, x.data(), b.view());
    expect_near(b.outputs, a.outputs, tolerance), expect_near(b.features, a.features, tolerance);
    expect_near(b.gradient, a.gradient, tolerance);

    const auto go = random.uniforms<T>(n * n_outputs, -1), gf = random.uniforms<T>(a.features.size(), -1),
               gg = random.uniforms<T>(3 * n, -1);
    FieldGradients<T> c(field), d(field);
    const SdfOutputs<const T> given{go.data(), gf.data(), gg.data()};
    cpu::sdf_field_backward(field.view(), n, x.data(), given, c.view());
    cuda_on_cpu::take_counts();
    cuda::sdf_field_backward(gpu.queue(), field.view(), n, x.data(), given, d.view());
    const cuda_on_cpu::Counts counts = cuda_on_cpu::take_counts();
    const int f = shape.n_features, additions = sizeof(T) == 8 ? f : f % 4 == 0 ? f / 4 : f == 2 ? 1 : f;
    EXPECT_EQ(counts.atomics, n * (shape.n_levels - 1) * 8 * additions);  // of corners of open levels
    EXPECT_EQ(counts.launches, 3 + (n > 0));  // weights, gradients, the blocks' sums, lengths; memsets besides
    const double of_sums = tolerance * (10 + n / 100);
    expect_near(d.table, c.table, of_sums), expect_near(d.hidden, c.hidden, of_sums);
    expect_near(d.hidden_length, c.hidden_length, of_sums), expect_near(d.hidden_bias, c.hidden_bias, of_sums);
    expect_near(d.out, c.out, of_sums), expect_near(d.out_length, c.out_length, of_sums);
    expect_near(d.out_bias, c.out_bias, of_sums);
  }
}
TEST(FieldKernels, SdfField) { check_field<double>(kShape, 21, 5, {0, 1, 64, 131}, 1e-12); }
// Each of the 264 blocks of 64 points has a second tile, the last of them not full.
TEST(FieldKernels, SdfFieldOfMoreTilesThanBlocks) {
  check_field<double>({3, 1, 4, 1.5, 8}, 8, 2, {2 * 64 * 264 - 47}, 1e-12);
}
// Units come in three turns, so that their weights are loaded for each tile; the blocks' sums are in memory.
TEST(FieldKernels, SdfFieldOfManyUnits) { check_field<double>(kShape, 150, 3, {1, 200}, 1e-12); }
// More squares of sums than threads, of one turn of units.
TEST(FieldKernels, SdfFieldOfManyFeatures) { check_field<float>({8, 8, 4, 1.5, 6}, 64, 13, {70}, 2e-4); }
TEST(FieldKernels, SdfFieldInFloatFromTablesOf16Bits) {
  check_field<float, Half>(kShape, 64, 13, {0, 1, 130}, 1e-4);
  check_field<float, Half>({3, 4, 4, 1.5, 8}, 16, 1, {65}, 1e-4);
}
// Tiles of 64 points of so many numbers do not fit, those of the last ones not even of 16.
TEST(FieldKernels, SdfFieldOfManyOutputs) {
  check_field<double>(kShape, 16, 180, {1, 70}, 1e-12);
  Random random(1);
  const Lengthy<double, double> field(random, kShape, 8, 1000);
  FieldResults<double> results(field, 1);
  Gpu gpu;
  const std::vector<double> three(3);
  EXPECT_THROW(cuda::sdf_field(gpu.queue(), field.view(), 1, three.data(), results.view()), std::invalid_argument);
}

TEST(FieldKernels, SdfValues) {
  for (const int64_t n : {0, 1, 64, 200}) {
    Random random(2);
    const Field field(random);
    const auto x = random.uniforms(3 * n, -1.7, 1.7);
    auto values = unwritten<double>(n), values1 = values;
    Gpu gpu;
    cpu::sdf_values(field.view(), n, x.data(), values.data());
    cuda::sdf_values(gpu.queue(), field.view(), n, x.data(), values1.data());
    expect_near(values1, values, 1e-12);
  }
}

// Rays from all sides towards the middle of a box with cells of all kinds.
template <class T> struct Rays {
  int64_t n;
  std::vector<T> o, d, jitter;
  std::vector<uint8_t> cells = std::vector<uint8_t>(6 * 6 * 6);
  MarchOptions march{1.5f, 0.04f, 1024};
  SampleRules<T> rules{20, 1, T(0.001), T(-std::log(0.001)), T(1e-3), T(0.2), 3};

  Rays(Random& random, int64_t n) : n(n), o(3 * n) {
    const auto directions = random.directions(n);
    d.assign(directions.begin(), directions.end());
    for (int64_t i = 0; i < 3 * n; ++i) o[i] = -2 * d[i] + T(random.uniform(-0.5, 0.5));
    jitter = random.uniforms<T>(n);
    for (uint8_t& cell : cells)
      cell = uint8_t(random.below(12) == 0 ? Cell::kOpaque : random.below(5) == 0 ? Cell::kEmpty : Cell::kOccupied);
  }
};
template <class T> struct Found {
  std::vector<int64_t> offsets, evaluated, indices;
  std::vector<T> starts, ends;

  int64_t all = -7;

  explicit Found(int64_t n) : offsets(unwritten<int64_t>(n + 1)), evaluated(unwritten<int64_t>(n)) {}
  SampleAllocator<T> allocate() {
    return [this](int64_t kept) {
      indices = unwritten<int64_t>(kept), starts = ends = unwritten<T>(kept);
      return PackedSamples<T>{indices.data(), starts.data(), ends.data()};
    };
  }
};
// What the CPU finds, and the GPU.
template <class T>
std::pair<Found<T>, Found<T>> find(const SdfField<T>& field, const Rays<T>& r, int64_t capacity = 0) {
  const OccupancyCells cells(r.cells.data(), 6);
  Found<T> a(r.n), b(r.n);
  Gpu gpu;
  cpu::sample_rays<T>(field, r.march, cells.view(), r.rules, r.n, r.o.data(), r.d.data(), r.jitter.data(), capacity,
                      a.offsets.data(), a.evaluated.data(), &a.all, a.allocate());
  cuda::sample_rays<T>(gpu.queue(), field, r.march, cells.view(), r.rules, r.n, r.o.data(), r.d.data(), r.jitter.data(),
                       capacity, b.offsets.data(), b.evaluated.data(), &b.all, b.allocate());
  return {a, b};
}
void expect_same_samples(const std::pair<Found<double>, Found<double>>& found) {
  const auto& [a, b] = found;
  EXPECT_EQ(b.offsets, a.offsets);
  EXPECT_EQ(b.evaluated, a.evaluated);
  EXPECT_EQ(b.indices, a.indices);
  EXPECT_EQ(b.all, a.all);
  expect_near(b.starts, a.starts, 1e-14), expect_near(b.ends, a.ends, 1e-14);
}

// Up to more rays than the one block of a scan has threads. The last layer has more weights than a block copies.
TEST(FieldKernels, SampledRays) {
  for (const auto& [n, width] : {std::pair{0, 21}, {1, 21}, {30, 21}, {1031, 21}, {7, 600}}) {
    Random random(4);
    const Field field(random, width);
    Rays<double> rays(random, n);
    if (n > 1000) rays.march.step = 0.1f;  // fewer rounds for so many rays
    const auto found = find(field.view(), rays);
    expect_same_samples(found);
    if (n > 1) { EXPECT_GT(found.second.starts.size(), size_t(n)); }
  }
}

// With capacity for fewer and for more samples than there are, and for none of an empty box.
TEST(FieldKernels, SampledRaysWithRoom) {
  Random random(4);
  const Field field(random);
  Rays<double> rays(random, 30);
  const int64_t n = find(field.view(), rays).first.all;
  for (const int64_t capacity : {int64_t(1), n - 3, n + 300}) {
    const auto found = find(field.view(), rays, capacity);
    expect_same_samples(found);
    EXPECT_EQ(found.second.all, n);
    EXPECT_EQ(int64_t(found.second.starts.size()), capacity);
  }
  std::fill(rays.cells.begin(), rays.cells.end(), uint8_t(Cell::kEmpty));
  const auto found = find(field.view(), rays, 5);
  expect_same_samples(found);
  EXPECT_EQ(found.second.starts, std::vector<double>(5));
}

// Steeper than the rules say: some walks go back as often as they may, and look no more at each sample after that.
TEST(FieldKernels, SampledRaysOfASteepField) {
  int64_t most = 0;
  for (const double scale : {0.3, 1., 3.}) {
    Random random(5);
    Field field(random);
    for (double& w : field.net.out) w *= scale;
    Rays<double> rays(random, 41);
    rays.march.step = 0.003f, rays.rules.min_transmittance = 0, rays.rules.reach = 0.01, rays.rules.lipschitz = 0.5;
    std::fill(rays.cells.begin(), rays.cells.end(), uint8_t(Cell::kOccupied));
    const auto found = find(field.view(), rays);
    expect_same_samples(found);
    most = std::max(most, *std::max_element(found.second.evaluated.begin(), found.second.evaluated.end()));
  }
  EXPECT_GT(most, 2 * kMostReturns);
}

// In float32 the two round differently: nearly all rays have the same samples.
TEST(FieldKernels, SampledRaysInFloatFromATableOf16Bits) {
  Random random(6);
  const Network net(random);
  HashLevel levels[kMaxLevels];
  const auto table = drawn_entries<Half>(random, hash_levels(kShape, levels) * kShape.n_features);
  const auto as_float = [](const std::vector<double>& x) { return std::vector<float>(x.begin(), x.end()); };
  const auto hidden = as_float(net.hidden), bias = as_float(net.hidden_bias), out = as_float(net.out),
             out_bias = as_float(net.out_bias);
  const SdfWeights<float> weights{net.n_inputs, net.width,       net.n_outputs, hidden.data(), bias.data(),
                                  out.data(),   out_bias.data(), 20.f,          1.5f};
  const int64_t n = 150;
  const auto [a, b] = find<float>({kShape, 5, table.data(), weights}, Rays<float>(random, n));
  int64_t same = 0;
  for (int64_t r = 0; r < n; ++r)
    same += a.evaluated[r] == b.evaluated[r] && a.offsets[r + 1] - a.offsets[r] == b.offsets[r + 1] - b.offsets[r];
  EXPECT_GE(same, n * 19 / 20);
  EXPECT_GT(b.starts.size(), size_t(n));
}

// ---- the optimiser ----

// Rows of which each second one has no gradient.
template <class T> void check_adamw(double tolerance, int64_t rows, int64_t columns, bool sparse) {
  const int64_t n = rows * columns;
  Random random(static_cast<uint32_t>(columns));
  const AdamwRule<T> rule(0.1, 0.9, 0.99, 1e-8, 0.2, 3);
  auto grad = random.uniforms<T>(n, -1);
  for (int64_t i = 0; i < n; ++i)
    if (i / columns % 2 == 0 || random.below(3) == 0) grad[i] = T(0);
  const auto param = random.uniforms<T>(n, -1), m = random.uniforms<T>(n, -1), v = random.uniforms<T>(n);
  auto param1 = param, m1 = m, v1 = v, param2 = param, m2 = m, v2 = v;
  std::vector<Half> half1(n), half2(n);
  for (int64_t i = 0; i < n; ++i) half1[i] = half2[i] = narrow(float(param[i]));
  const AdamwArrays<T> x{n, columns, sparse, param1.data(), grad.data(), m1.data(), v1.data(), half1.data()};
  AdamwListBody<T> here, there;
  here.add({rule, x});
  there.add({rule, {n, columns, sparse, param2.data(), grad.data(), m2.data(), v2.data(), half2.data()}});
  cpu::run(n, here);
  on_gpu(n, there);
  expect_near(param2, param1, tolerance), expect_near(m2, m1, tolerance), expect_near(v2, v1, tolerance);
  for (int64_t i = 0; i < n; ++i) {
    for (const Half x : {half1[i], half2[i]}) EXPECT_NEAR(widen(x), param1[i], 1e-3 * (1 + std::abs(param1[i]))) << i;
    if (sparse && i / columns % 2 == 0) { EXPECT_TRUE(param2[i] == param[i] && m2[i] == m[i] && v2[i] == v[i]) << i; }
  }
}

TEST(FieldKernels, Adamw) {
  for (const int64_t rows : {0, 1, 61})
    for (const int64_t columns : {1, 2, 3, 8, 70})
      for (const bool sparse : {false, true}) {
        check_adamw<double>(1e-14, rows, columns, sparse);
        check_adamw<float>(1e-6, rows, columns, sparse);
      }
}

// As many arrays as one kernel takes, empty ones among them; the blocks' ends lie within arrays.
TEST(FieldKernels, AdamwOfManyArrays) {
  Random random(77);
  const int64_t sizes[] = {0, 1, 300, 0, 7, 513, 2};
  AdamwListBody<double> together, alone;
  std::vector<std::vector<double>> kept;
  for (int k = 0; k < kMostAdamwArrays; ++k) {
    const int64_t n = sizes[k % 7];
    const AdamwRule<double> rule(0.01 * k, 0.9, 0.99, 1e-8, 0.1, 1 + k);
    const auto grad = random.uniforms(n, -1), param = random.uniforms(n, -1), m = random.uniforms(n, -1),
               v = random.uniforms(n);
    kept.push_back(grad);
    const double* const gradient = kept.back().data();
    for (AdamwListBody<double>* list : {&together, &alone}) {
      std::array<double*, 3> written;
      for (size_t i = 0; i < 3; ++i) kept.push_back(i == 0 ? param : i == 1 ? m : v), written[i] = kept.back().data();
      list->add({rule, {n, 1, k % 2 == 0, written[0], gradient, written[1], written[2], nullptr}});
    }
  }
  cuda_on_cpu::take_counts();
  on_gpu(together.count(), together);
  EXPECT_EQ(cuda_on_cpu::take_counts().launches, 1);
  cpu::run(alone.count(), alone);
  for (int k = 0; k < kMostAdamwArrays; ++k)
    for (int i = 0; i < 3; ++i) expect_near(kept[7 * k + 1 + i], kept[7 * k + 4 + i], 1e-14);
  on_gpu(0, AdamwListBody<double>{});
  // A flag on the device decides.
  const auto moved = kept;
  for (const bool allowed : {false, true}) {
    together.allowed = alone.allowed = &allowed;
    on_gpu(together.count(), together);
    cpu::run(alone.count(), alone);
    EXPECT_EQ(kept != moved, allowed);
    for (int k = 0; k < kMostAdamwArrays; ++k)
      for (int i = 0; i < 3; ++i) expect_near(kept[7 * k + 1 + i], kept[7 * k + 4 + i], 1e-14);
  }
}

}  // namespace
}  // namespace splitnerf
