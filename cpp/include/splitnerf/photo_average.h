// Photos averaged down in linear light, block by block.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "splitnerf/srgb.h"

namespace splitnerf {

// The linear value of each whole number that a photo may hold.
template <class Code> const float* linear_values() {
  static const std::vector<float> table = [] {
    constexpr int kLast = std::numeric_limits<Code>::max();
    std::vector<float> values(kLast + 1);
    for (int i = 0; i <= kLast; ++i) values[i] = static_cast<float>(linear_from_srgb(double(i) / kLast));
    return values;
  }();
  return table.data();
}

// Means of blocks of factor x factor pixels: codes [height, width, 4] in sRGB with straight alpha, out
// [height / factor, width / factor, 4] times 65535. Incomplete blocks at the bottom and right are left out.
// object_alone: colours weigh by alpha, and are 0 where alpha is 0; else all weigh the same.
template <class Code>
void average_photo(const Code* codes, int64_t height, int64_t width, int64_t factor, bool object_alone, uint16_t* out) {
  const float* linear = linear_values<Code>();
  const double full = std::numeric_limits<Code>::max(), n_pixels = double(factor) * double(factor);
  const int64_t n_rows = height / factor, n_columns = width / factor;
  const auto code = [](double value) { return uint16_t(std::lrint(65535 * std::clamp(value, 0.0, 1.0))); };
  std::vector<double> sums(4 * n_columns);
  for (int64_t row = 0; row < n_rows; ++row) {
    std::fill(sums.begin(), sums.end(), 0.0);
    for (int64_t y = row * factor; y < (row + 1) * factor; ++y) {
      const Code* pixel = codes + 4 * y * width;
      for (int64_t column = 0; column < n_columns; ++column) {
        double red = 0, green = 0, blue = 0, alpha = 0;
        for (int64_t x = 0; x < factor; ++x, pixel += 4) {
          const double weight = object_alone ? pixel[3] : 1.0;
          red += weight * linear[pixel[0]];
          green += weight * linear[pixel[1]];
          blue += weight * linear[pixel[2]];
          alpha += pixel[3];
        }
        double* sum = &sums[4 * column];
        sum[0] += red, sum[1] += green, sum[2] += blue, sum[3] += alpha;
      }
    }
    for (int64_t column = 0; column < n_columns; ++column, out += 4) {
      const double* sum = &sums[4 * column];
      const double weight = object_alone ? std::max(sum[3], 1.0) : n_pixels;
      for (int c = 0; c < 3; ++c) out[c] = code(srgb_from_linear(sum[c] / weight).value);
      out[3] = code(sum[3] / (n_pixels * full));
    }
  }
}

}  // namespace splitnerf
