// Numbers of 16 bits: every one of them against its definition, and hash tables that store them on every instruction set.
#include "check.h"
#include "splitnerf/half.h"
#include "splitnerf/kernels.h"

namespace splitnerf {
namespace {

// sign 2^(exponent - 15) (1 + fraction), without the 1 where the exponent is 0; all ones: infinite, or NaN.
double defined(uint32_t bits) {
  const int exponent = int(bits >> 10 & 31u);
  const double fraction = std::ldexp(double(bits & 1023u), -10), sign = bits >> 15 ? -1 : 1;
  if (exponent == 31) return fraction != 0 ? NAN : sign * INFINITY;
  return sign * (exponent ? std::ldexp(1 + fraction, exponent - 15) : std::ldexp(fraction, -14));
}

TEST(HalfNumbers, EveryNumberIsReadExactly) {
  for (uint32_t bits = 0; bits < 65536; ++bits) {
    const double expected = defined(bits), got = widen(Half{static_cast<uint16_t>(bits)});
    if (std::isnan(expected)) {
      ASSERT_TRUE(std::isnan(got)) << bits;
    } else {
      ASSERT_EQ(got, expected) << bits;
      ASSERT_EQ(std::signbit(got), std::signbit(expected)) << bits;
    }
  }
}

// narrow takes the nearest, of two the even one, as far as the largest reaches.
TEST(HalfNumbers, EveryNumberIsRoundedToNearest) {
  const uint32_t infinite = 0x7c00;
  for (uint32_t bits = 0; bits + 1 < infinite; ++bits)
    for (const uint32_t sign : {0u, 0x8000u}) {
      const auto below = static_cast<uint16_t>(sign | bits), above = static_cast<uint16_t>(sign | (bits + 1));
      const float a = widen(Half{below}), b = widen(Half{above}), middle = a + (b - a) / 2;
      ASSERT_EQ(narrow(a).bits, below);
      ASSERT_EQ(narrow(middle).bits, bits & 1 ? above : below) << bits;
      if (std::nextafter(a, b) == b || middle == a) continue;  // no float32 beside the middle
      ASSERT_EQ(narrow(std::nextafter(middle, a)).bits, below) << bits;
      ASSERT_EQ(narrow(std::nextafter(middle, b)).bits, above) << bits;
    }
  const auto largest = static_cast<uint16_t>(infinite - 1);
  for (const float x : {widen(Half{largest}), 3.402823e38f, INFINITY}) {
    EXPECT_EQ(narrow(x).bits, largest) << x;
    EXPECT_EQ(narrow(-x).bits, 0x8000u | largest) << x;
  }
  EXPECT_TRUE(std::isnan(widen(narrow(NAN))) && std::isnan(widen(narrow(-NAN))));
}

// A table of 16 bits and one of the float32 numbers that it stands for give the same features, to the bit.
TEST(HalfNumbers, TablesOf16BitsAreReadOnEveryInstructionSet) {
  Random random(3);
  const int64_t n = 300, columns = 8;
  const HashGridShape shape{4, 2, 4, 1.7, 8};
  HashLevel levels[4];
  const int64_t n_numbers = 2 * hash_levels(shape, levels);
  std::vector<Half> stored(n_numbers);
  std::vector<float> table(n_numbers);
  for (int64_t i = 0; i < n_numbers; ++i) {
    stored[i].bits = static_cast<uint16_t>(random.below(0x3c00) | random.below(2) << 15);
    table[i] = widen(stored[i]);
  }
  const auto x = random.uniforms<float>(3 * n, -0.05, 1.05);
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
}

}  // namespace
}  // namespace splitnerf
