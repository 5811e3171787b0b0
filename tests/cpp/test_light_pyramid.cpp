// The light's lookup and products with sparse maps: the instruction sets against each other.
#include "splitnerf/light_pyramid.h"

#include <vector>

#include "check.h"
#include "splitnerf/kernels.h"
#include "splitnerf/light_tables.h"
#include "splitnerf/sampling.h"

namespace splitnerf {
namespace {

constexpr int kPoints = 203;  // no multiple of a register's lanes

// A pyramid of two maps, with everything that a kernel call needs.
template <class T> struct Scene {
  std::vector<T> levels, sh, zonal, directions, roughness, grad;
  LightPyramid<T> pyramid{};

  Scene() : levels(3 * (16 * 16 + 8 * 8)), sh(3 * kShCoefficients) {
    uint32_t seed = 0;
    for (T& x : levels) x = T(random_unit<double>(++seed)) + T(0.1);
    for (T& x : sh) x = T(0.1 * random_unit<double>(++seed) - 0.05);
    sh[0] = sh[1] = sh[2] = T(3);
    for (double x : zonal_factors(0.5, 9)) zonal.push_back(T(x));
    for (int i = 0; i < kPoints; ++i) {
      const Vec3<double> w = fibonacci_sphere<double>(i, kPoints);
      for (int c = 0; c < 3; ++c) directions.push_back(T(w[c])), grad.push_back(T(random_unit<double>(++seed) - 0.5));
      roughness.push_back(T(random_unit<double>(++seed)));
    }
    pyramid.levels = levels.data(), pyramid.sh = sh.data(), pyramid.zonal = zonal.data();
    pyramid.n_levels = 2, pyramid.n_zonal = 9;
    pyramid.resolution[0] = 16, pyramid.resolution[1] = 8, pyramid.offset[1] = 16 * 16;
    pyramid.node[0] = T(0.05), pyramid.node[1] = T(0.3), pyramid.node[2] = T(0.5);
    pyramid.recurrence = &sh_recurrence<T>();
  }

  // Radiance, then the gradients to directions, roughness, levels and sh, one after the other.
  std::vector<T> run(const Kernels<T>& kernels) const {
    std::vector<T> out(7 * kPoints + levels.size() + sh.size());
    T *grad_directions = &out[3 * kPoints], *grad_roughness = &out[6 * kPoints], *grad_levels = &out[7 * kPoints];
    kernels.light_lookup(pyramid, 0, kPoints, directions.data(), roughness.data(), out.data());
    kernels.light_lookup_backward(pyramid, 0, kPoints, directions.data(), roughness.data(), grad.data(),
                                  grad_directions, grad_roughness, grad_levels, grad_levels + levels.size());
    return out;
  }
};

template <class T> void expect_equal_sets(T tolerance) {
  const Scene<T> scene;
  const std::vector<Kernels<T>> sets = usable_kernels<T>();
  const std::vector<T> expected = scene.run(sets[0]);
  for (const Kernels<T>& set : sets) {
    const std::vector<T> got = scene.run(set);
    for (size_t i = 0; i < got.size(); ++i)
      ASSERT_NEAR(got[i], expected[i], tolerance * (1 + std::fabs(expected[i]))) << set.name << " at " << i;
  }
}

TEST(LightLookup, InstructionSetsAgree) {
  expect_equal_sets<double>(1e-12);
  expect_equal_sets<float>(3e-5f);
}

// Rows of no entry to 25, whose columns may repeat, against sums one entry after the other.
template <class T> void expect_products(int n_images, T tolerance) {
  constexpr int64_t kColumns = 30;
  const int padded_columns = 4 * n_images;
  Random random(5);
  std::vector<int64_t> offsets{0};
  std::vector<int32_t> columns;
  for (int length = 0; length <= 25; ++length) {
    for (int i = 0; i < length; ++i) columns.push_back(random.below(kColumns));
    offsets.push_back(int64_t(columns.size()));
  }
  std::vector<T> weights(columns.size()), padded(padded_columns * kColumns);
  std::vector<int32_t> places(26 * n_images);
  for (size_t i = 0; i < places.size(); ++i) places[i] = int32_t(places.size() - 1 - i);
  for (T& w : weights) w = T(random.uniform(-1, 1));
  for (T& x : padded) x = T(random.uniform());
  const SparseRows<T> matrix{offsets.data(), columns.data(), weights.data(), places.data(),
                             nullptr,        kColumns,       n_images};
  for (const Kernels<T>& set : usable_kernels<T>()) {
    std::vector<T> products(3 * places.size(), T(7));
    ASSERT_TRUE(set.sparse_product(matrix, padded.data(), 1, 26, products.data())) << set.name;
    ASSERT_EQ(products[3 * places[0]], T(7)) << "row 0 was not asked for";
    for (int64_t row = 1; row < 26; ++row)
      for (int m = 0; m < n_images; ++m)
        for (int c = 0; c < 3; ++c) {
          T sum = 0;
          for (int64_t k = offsets[row]; k < offsets[row + 1]; ++k)
            sum += weights[k] * padded[padded_columns * columns[k] + 4 * m + c];
          ASSERT_NEAR(products[3 * places[row * n_images + m] + c], sum, tolerance) << set.name << ", row " << row;
        }
    for (const int32_t wrong : {int32_t(kColumns), -1}) {
      std::vector<int32_t> changed = columns;
      changed.back() = wrong;
      SparseRows<T> bad = matrix;
      bad.columns = changed.data();
      EXPECT_FALSE(set.sparse_product(bad, padded.data(), 0, 26, products.data())) << set.name;
      EXPECT_TRUE(set.sparse_product(bad, padded.data(), 0, 25, products.data())) << set.name;
    }
  }
}

TEST(SparseProduct, InstructionSetsAgree) {
  for (const int n_images : {1, kMirrorImages}) {
    expect_products<double>(n_images, 1e-14);
    expect_products<float>(n_images, 1e-5f);
  }
}

}  // namespace
}  // namespace splitnerf
