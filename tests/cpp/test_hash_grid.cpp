// The hash grid's large indices, its transpose, and its kernels on every instruction set. Its values: tests/reference.py.
#include "splitnerf/hash_grid.h"

#include <sys/mman.h>

#include <array>
#include <limits>

#include "check.h"
#include "splitnerf/kernels.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf {
namespace {

std::vector<HashLevel> levels_of(const HashGridShape& shape) {
  std::vector<HashLevel> levels(shape.n_levels);
  hash_levels(shape, levels.data());
  return levels;
}
int64_t n_entries(const HashGridShape& shape) {
  std::array<HashLevel, kMaxLevels> levels;
  return hash_levels(shape, levels.data());
}

TEST(HashIndex, DenseEntriesCountEveryNodeOnceUpToTheLargestLevel) {
  std::vector<int> seen(6 * 6 * 6);
  for (int x = 0; x < 6; ++x)
    for (int y = 0; y < 6; ++y)
      for (int z = 0; z < 6; ++z) ++seen.at(node_entry<true>(x, y, z, 5, 216));
  for (int count : seen) EXPECT_EQ(count, 1);
  EXPECT_EQ(node_entry<true>(1023, 1023, 1023, 1023, 1u << 30), (1u << 30) - 1);
}

// Entries past 2^32 floats, in memory that is reserved but only touched where it is read.
TEST(HashIndex, KernelsReachEntriesPastTwoToThe32) {
  const HashLevel level{(int64_t(1) << 31) + 7, 8, 1, true};
  const size_t bytes = size_t(level.offset + 8) * 2 * sizeof(float);
  void* memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (memory == MAP_FAILED) GTEST_SKIP() << "this system reserves no 16 GiB of address space";
  auto* table = static_cast<float*>(memory);
  for (int i = 0; i < 16; ++i) table[level.offset * 2 + i] = float(i);
  const float position[] = {1, 0, 1}, gradient[] = {1, 10};
  for (const Kernels<float>& k : usable_kernels<float>()) {
    const HashEncodeArgs<float> args{&level, 2, 1, 1, 1, position, table};
    float features[2];
    k.hash_encode(args, 0, 1, features, nullptr);
    EXPECT_EQ(features[0], 10) << k.name;  // node (1, 0, 1) is entry 5
    EXPECT_EQ(features[1], 11) << k.name;
  }
  usable_kernels<float>()[0].hash_scatter({&level, 2, 1, 1, 1, position, nullptr}, 0, gradient, table);
  EXPECT_EQ(table[level.offset * 2 + 10], 11);
  EXPECT_EQ(table[level.offset * 2 + 11], 21);
  munmap(memory, bytes);
}

struct Encoding {
  std::vector<double> features, jacobian;
};
Encoding encode(const HashGridShape& shape, int n_active, const std::vector<double>& x,
                const std::vector<double>& table) {
  const size_t n = x.size() / 3, columns = size_t(shape.n_levels * shape.n_features);
  Encoding e{std::vector<double>(n * columns, -7), std::vector<double>(3 * n * columns, -7)};
  const std::vector<HashLevel> levels = levels_of(shape);
  const HashEncodeArgs<double> args{levels.data(), shape.n_features, shape.n_levels, n_active,
                                    int64_t(n),    x.data(),         table.data()};
  kernels<double>().hash_encode(args, 0, args.n_points, e.features.data(), e.jacobian.data());
  return e;
}

// ---- adjoints ----

TEST(HashEncode, TableGradientIsTheTranspose) {
  Random random(5);
  for (const int features : {1, 2, 4, 8}) {
    const HashGridShape shape{5, features, 3, 1.9, 7};
    const size_t n = 60, columns = size_t(5 * features);
    const std::vector<double> x = random.uniforms(3 * n, -0.1, 1.1),
                              table = random.uniforms(size_t(n_entries(shape) * features), -1);
    const std::vector<double> g = random.uniforms(n * columns, -1);
    const Encoding e = encode(shape, 4, x, table);  // linear in the table
    std::vector<double> to_table(table.size());
    cpu::hash_encode_backward(shape, 4, int64_t(n), x.data(), g.data(), to_table.data());
    EXPECT_NEAR(inner(to_table, table), inner(g, e.features), 1e-10) << features;
  }
}

// ---- instruction sets ----

// Fused multiply-adds round the position inside a cell differently: close relative to the largest value.
template <class T> void expect_close(const std::vector<T>& a, const std::vector<T>& b, const std::string& what) {
  double largest = 0;
  for (T x : b) largest = std::max(largest, std::abs(double(x)));
  const double tolerance = (sizeof(T) == 4 ? 2e-5 : 1e-13) * largest;
  for (size_t i = 0; i < a.size(); ++i) ASSERT_NEAR(a[i], b[i], tolerance) << what << " " << i;
}

template <class T> void every_set_agrees_with_base() {
  const std::vector<Kernels<T>> sets = usable_kernels<T>();
  ASSERT_STREQ(sets[0].name, "base");
  Random random(7);
  for (const int features : {1, 2, 4, 8}) {
    const HashGridShape shape{6, features, 4, 1.6, 9};
    const std::vector<HashLevel> levels = levels_of(shape);
    const int64_t n = 700, columns = 6 * features;
    const auto x = random.uniforms<T>(size_t(3 * n), -0.05, 1.05),
               table = random.uniforms<T>(size_t(n_entries(shape) * features), -1);
    const auto g = random.uniforms<T>(size_t(n * columns), -1);
    const HashEncodeArgs<T> args{levels.data(), features, 6, 6, n, x.data(), table.data()};
    std::vector<std::vector<T>> expected;
    for (const Kernels<T>& k : sets) {
      std::vector<std::vector<T>> got{std::vector<T>(size_t(n * columns)), std::vector<T>(size_t(n * columns)),
                                      std::vector<T>(size_t(3 * n * columns)), std::vector<T>(table.size())};
      k.hash_encode(args, 0, n, got[0].data(), nullptr);
      k.hash_encode(args, 0, n, got[1].data(), got[2].data());
      for (int l = 0; l < 6; ++l) k.hash_scatter(args, l, g.data(), got[3].data());
      if (expected.empty()) expected = got;
      for (size_t i = 0; i < got.size(); ++i)
        expect_close(got[i], expected[i],
                     std::string(k.name) + " F = " + std::to_string(features) + " output " + std::to_string(i));
    }
  }
}

// The encoding is linear in the table, and its adjoint gathers what the planes stand for.
template <class T> void along_is_the_transpose(double tolerance) {
  Random random(8);
  for (const int F : {1, 2, 4, 8}) {
    const HashGridShape shape{3, F, 4, 1.7, 8};
    const std::vector<HashLevel> levels = levels_of(shape);
    const int64_t n = 130, columns = 3 * F, open = 2;
    const auto x = random.uniforms<T>(size_t(3 * n), -0.05, 1.05), along = random.uniforms<T>(size_t(3 * n), -1);
    const auto features = random.uniforms<T>(size_t(open * n * F), -1),
               slopes = random.uniforms<T>(size_t(open * n * F), -1);
    const auto table = random.uniforms<T>(size_t(n_entries(shape) * F), -1);
    const HashEncodeArgs<T> args{levels.data(), F, 3, int(open), n, x.data(), table.data()};
    for (const Kernels<T>& k : usable_kernels<T>()) {
      std::vector<T> encoded(size_t(n * columns)), jacobian(3 * encoded.size()), to_table(table.size());
      k.hash_encode(args, 0, n, encoded.data(), jacobian.data());
      for (int l = 0; l < open; ++l)
        k.hash_scatter_along(args, l, {features.data(), slopes.data(), n * F, int(open), F}, along.data(),
                             to_table.data());
      double expected = 0, found = 0;
      for (int64_t p = 0; p < n; ++p)
        for (int64_t l = 0; l < open; ++l)
          for (int64_t f = 0; f < F; ++f) {
            const int64_t at = (l * n + p) * F + f, column = l * F + f;
            expected += double(features[at]) * encoded[p * columns + column];
            for (int64_t axis = 0; axis < 3; ++axis)
              expected += double(slopes[at]) * along[3 * p + axis] * jacobian[(3 * p + axis) * columns + column];
          }
      for (size_t i = 0; i < table.size(); ++i) found += double(to_table[i]) * table[i];
      EXPECT_NEAR(found, expected, tolerance) << k.name << " F = " << F;
    }
  }
}
TEST(HashKernels, ScatterAlongIsTheTranspose) {
  along_is_the_transpose<float>(1e-3), along_is_the_transpose<double>(1e-10);
}

TEST(HashKernels, EveryInstructionSetAgreesWithBase) {
  every_set_agrees_with_base<float>();
  every_set_agrees_with_base<double>();
}

}  // namespace
}  // namespace splitnerf
