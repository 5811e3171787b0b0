// The distance network on every instruction set, and the functions that it is made of.
#include "check.h"
#include "splitnerf/kernels.h"
#include "splitnerf/neus.h"
#include "splitnerf/vector_math.h"

namespace splitnerf {
namespace {

template <class T> void check_exp(double tolerance) {
  for (int i = 0; i <= 100000; ++i) {
    const T x = T(i) * T(8.6e-4);
    const double exact = std::exp(-static_cast<double>(x));
    ASSERT_NEAR(exp_of_minus(x) / exact, 1.0, tolerance) << x;
  }
  EXPECT_EQ(exp_of_minus(T(0)), T(1));
  EXPECT_GT(exp_of_minus(T(1e30)), T(0));
  EXPECT_LT(exp_of_minus(T(1e30)), T(1e-37));
  EXPECT_LT(exp_of_minus(std::numeric_limits<T>::infinity()), T(1e-37));
  EXPECT_TRUE(std::isnan(exp_of_minus(std::numeric_limits<T>::quiet_NaN())));
}
TEST(VectorMath, Exp) { check_exp<float>(3e-7), check_exp<double>(5e-16); }

template <class T> void check_log(double tolerance) {
  for (int i = 1; i <= 100000; ++i) {
    const T u = T(i) * T(1e-5);
    ASSERT_NEAR(log1p_of_unit(u) / std::log1p(static_cast<double>(u)), 1.0, tolerance) << u;
  }
  EXPECT_EQ(log1p_of_unit(T(0)), T(0));
  EXPECT_NEAR(log1p_of_unit(T(1e-30)) / T(1e-30), 1.0, tolerance);
}
TEST(VectorMath, Log) { check_log<float>(3e-7), check_log<double>(5e-16); }

// A small network with drawn weights, and the same by the plain formula.
struct Case {
  HashGridShape shape{3, 2, 4, 1.7, 8};
  int width = 5;
  std::vector<HashLevel> levels = std::vector<HashLevel>(3);
  std::vector<double> table, hidden, bias, out, positions;

  Case() {
    const int64_t n_entries = hash_levels(shape, levels.data());
    Random draw(7);
    table = draw.uniforms(2 * n_entries, -0.5, 0.5), hidden = draw.uniforms(width * 9, -1, 1);
    bias = draw.uniforms(width, -0.1, 0.1), out = draw.uniforms(width, -1, 1);
    positions = draw.uniforms(3 * kSdfBlock, -1.6, 1.6);
  }

  double expected(int64_t p, int n_active) const {
    double input[9] = {positions[3 * p], positions[3 * p + 1], positions[3 * p + 2]};
    const Vec3<double> unit{input[0] / 3 + 0.5, input[1] / 3 + 0.5, input[2] / 3 + 0.5};
    for (int l = 0; l < n_active; ++l) {
      const HashCell<double> cell = hash_cell(levels[l], unit);
      const double x[] = {1 - cell.f.x, cell.f.x}, y[] = {1 - cell.f.y, cell.f.y}, z[] = {1 - cell.f.z, cell.f.z};
      for (int i = 0; i < 8; ++i)
        for (int f = 0; f < 2; ++f)
          input[3 + 2 * l + f] += x[i & 1] * y[i >> 1 & 1] * z[i >> 2] * table[2 * cell.index[i] + f];
    }
    double sum = 0.25;
    for (int h = 0; h < width; ++h) {
      double pre = bias[h];
      for (int k = 0; k < 9; ++k) pre += hidden[9 * h + k] * input[k];
      sum += out[h] * softplus(100.0 * pre) / 100.0;
    }
    return sum;
  }
};

template <class T> void check_network(double tolerance) {
  const Case c;
  const auto as = [](const std::vector<double>& x) { return std::vector<T>(x.begin(), x.end()); };
  const auto table = as(c.table), hidden = as(c.hidden), bias = as(c.bias), out = as(c.out), at = as(c.positions);
  const T out_bias = T(0.25);
  for (const Kernels<T>& kernels : usable_kernels<T>()) {
    for (int n_active : {0, 2, 3}) {
      const PreparedSdfLayer<T> layer(
          {9, c.width, 1, hidden.data(), bias.data(), out.data(), &out_bias, T(100), T(1.5)});
      const SdfNetwork<T> net{{c.levels.data(), 2, 3, n_active, 0, nullptr, table.data()}, layer.layer()};
      for (int64_t n : {0, 1, 7, kSdfBlock}) {
        std::vector<T> work(sdf_work_size(net.layer)), values(n + 1, T(-77));
        kernels.sdf_values(net, n, at.data(), work.data(), values.data());
        for (int64_t p = 0; p < n; ++p)
          EXPECT_NEAR(values[p], c.expected(p, n_active), tolerance) << kernels.name << " " << p;
        EXPECT_EQ(values[n], T(-77)) << "wrote past the points";
      }
    }
  }
}
TEST(SdfNetwork, FloatOnEveryInstructionSet) { check_network<float>(2e-5); }
TEST(SdfNetwork, DoubleOnEveryInstructionSet) { check_network<double>(1e-12); }

}  // namespace
}  // namespace splitnerf
