// Numbers of 16 bits: every one of them against its definition, and hash tables that store them on every instruction set.
#include "check.h"
#include "splitnerf/half.h"
#include "splitnerf/kernels.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf {
namespace {

// sign 2^(exponent - bias) (1 + fraction), without the 1 where the exponent is 0; all ones: infinite, or NaN.
double defined(uint32_t bits, int exponent_bits) {
  const int fraction_bits = 15 - exponent_bits, bias = (1 << (exponent_bits - 1)) - 1;
  const int exponent = int(bits >> fraction_bits & ((1u << exponent_bits) - 1));
  const double fraction = std::ldexp(double(bits & ((1u << fraction_bits) - 1)), -fraction_bits);
  const double sign = bits >> 15 ? -1 : 1;
  if (exponent == (1 << exponent_bits) - 1) return fraction != 0 ? NAN : sign * INFINITY;
  return sign * (exponent ? std::ldexp(1 + fraction, exponent - bias) : std::ldexp(fraction, 1 - bias));
}

template <class S> void every_number_is_read_exactly(int exponent_bits) {
  for (uint32_t bits = 0; bits < 65536; ++bits) {
    const double expected = defined(bits, exponent_bits), got = widen(S{static_cast<uint16_t>(bits)});
    if (std::isnan(expected)) {
      ASSERT_TRUE(std::isnan(got)) << bits;
    } else {
      ASSERT_EQ(got, expected) << bits;
      ASSERT_EQ(std::signbit(got), std::signbit(expected)) << bits;
    }
  }
}
TEST(HalfNumbers, EveryNumberIsReadExactly) {
  every_number_is_read_exactly<Half>(5);
  every_number_is_read_exactly<Bfloat16>(8);
}

// narrow takes the nearest, of two the even one, as far as the largest reaches.
template <class S> void every_number_is_rounded_to_nearest(int exponent_bits) {
  const uint32_t infinite = ((1u << exponent_bits) - 1) << (15 - exponent_bits);
  for (uint32_t bits = 0; bits + 1 < infinite; ++bits)
    for (const uint32_t sign : {0u, 0x8000u}) {
      const auto below = static_cast<uint16_t>(sign | bits), above = static_cast<uint16_t>(sign | (bits + 1));
      const float a = widen(S{below}), b = widen(S{above}), middle = a + (b - a) / 2;
      ASSERT_EQ(narrow<S>(a).bits, below);
      ASSERT_EQ(narrow<S>(middle).bits, bits & 1 ? above : below) << bits;
      if (std::nextafter(a, b) == b || middle == a) continue;  // no float32 beside the middle
      ASSERT_EQ(narrow<S>(std::nextafter(middle, a)).bits, below) << bits;
      ASSERT_EQ(narrow<S>(std::nextafter(middle, b)).bits, above) << bits;
    }
  const auto largest = static_cast<uint16_t>(infinite - 1);
  for (const float x : {widen(S{largest}), 3.402823e38f, INFINITY}) {
    EXPECT_EQ(narrow<S>(x).bits, largest) << x;
    EXPECT_EQ(narrow<S>(-x).bits, 0x8000u | largest) << x;
  }
  EXPECT_TRUE(std::isnan(widen(narrow<S>(NAN))) && std::isnan(widen(narrow<S>(-NAN))));
}
TEST(HalfNumbers, EveryNumberIsRoundedToNearest) {
  every_number_is_rounded_to_nearest<Half>(5);
  every_number_is_rounded_to_nearest<Bfloat16>(8);
}

// A table of 16 bits and one of the float32 numbers that it stands for give the same features, to the bit.
template <class S> void check_kernels() {
  Random random(3);
  const int64_t n = 300, columns = 8;
  const HashGridShape shape{4, 2, 4, 1.7, 8};
  HashLevel levels[4];
  const int64_t n_numbers = 2 * hash_levels(shape, levels);
  std::vector<S> stored(n_numbers);
  std::vector<float> table(n_numbers);
  for (int64_t i = 0; i < n_numbers; ++i) {
    stored[i].bits = static_cast<uint16_t>(random.below(0x3c00) | random.below(2) << 15);
    table[i] = widen(stored[i]);
  }
  const auto x = random.uniforms<float>(3 * n, -0.05, 1.05), g = random.uniforms<float>(n * columns, -1);
  for (const Kernels<float>& k : usable_kernels<float>()) {
    std::vector<float> out[2][3];
    for (const int i : {0, 1}) {
      const HashTable read = i ? HashTable(stored.data()) : HashTable(table.data());
      const HashEncodeArgs<float> args{levels, 2, 4, 4, n, x.data(), read};
      for (std::vector<float>& numbers : out[i]) numbers.resize(3 * n * columns);
      k.hash_encode(args, 0, n, out[i][0].data(), nullptr);
      k.hash_encode(args, 0, n, out[i][1].data(), out[i][2].data());
    }
    for (const int i : {0, 1, 2}) EXPECT_EQ(out[1][i], out[0][i]) << k.name << " output " << i;
  }
  std::vector<float> to_positions[2];
  for (const int i : {0, 1}) {
    to_positions[i].resize(3 * n);
    cpu::hash_encode_backward_positions(shape, 4, n, x.data(), i ? HashTable(stored.data()) : HashTable(table.data()),
                                        g.data(), to_positions[i].data());
  }
  EXPECT_EQ(to_positions[1], to_positions[0]);
}
TEST(HalfNumbers, TablesOf16BitsAreReadOnEveryInstructionSet) {
  check_kernels<Half>();
  check_kernels<Bfloat16>();
}

}  // namespace
}  // namespace splitnerf
