// The hash grid's large indices, and its kernels on every instruction set. Its values and adjoint: tests/reference.py.
#include "splitnerf/hash_grid.h"

#include <sys/mman.h>

#include "check.h"
#include "splitnerf/kernels.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf {
namespace {

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

// Fused multiply-adds round the position inside a cell differently: close relative to the largest value.
template <class T> void every_set_agrees_with_base() {
  const std::vector<Kernels<T>> sets = usable_kernels<T>();
  ASSERT_STREQ(sets[0].name, "base");
  Random random(7);
  for (const int features : {1, 2, 4, 8}) {
    const HashGridShape shape{6, features, 4, 1.6, 9};
    HashLevel levels[kMaxLevels];
    const int64_t n_entries = hash_levels(shape, levels);
    const int64_t n = 700, columns = 6 * features;
    const auto x = random.uniforms<T>(size_t(3 * n), -0.05, 1.05),
               table = random.uniforms<T>(size_t(n_entries * features), -1);
    const auto g = random.uniforms<T>(size_t(n * columns), -1);
    const auto along = random.uniforms<T>(size_t(3 * n), -1), planes = random.uniforms<T>(size_t(2 * n * columns), -1);
    const HashEncodeArgs<T> args{levels, features, 6, 6, n, x.data(), table.data()};
    std::vector<std::vector<T>> expected;
    for (const Kernels<T>& k : sets) {
      std::vector<std::vector<T>> got{std::vector<T>(size_t(n * columns)), std::vector<T>(size_t(n * columns)),
                                      std::vector<T>(size_t(3 * n * columns)), std::vector<T>(table.size()),
                                      std::vector<T>(table.size())};
      k.hash_encode(args, 0, n, got[0].data(), nullptr);
      k.hash_encode(args, 0, n, got[1].data(), got[2].data());
      for (int l = 0; l < 6; ++l) {
        k.hash_scatter(args, l, g.data(), got[3].data());
        k.hash_scatter_along(args, l, {planes.data(), planes.data() + n * columns, n * features, 6, features},
                             along.data(), got[4].data());
      }
      if (expected.empty()) expected = got;
      SCOPED_TRACE(std::string(k.name) + " F = " + std::to_string(features));
      for (size_t i = 0; i < got.size(); ++i) expect_near(got[i], expected[i], sizeof(T) == 4 ? 2e-5 : 1e-13);
    }
  }
}

TEST(HashKernels, SetsAgreeWithBase) { every_set_agrees_with_base<float>(), every_set_agrees_with_base<double>(); }

}  // namespace
}  // namespace splitnerf
