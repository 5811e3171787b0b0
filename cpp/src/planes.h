// Interleaved three-vectors split into three arrays, so that the kernels read whole vectors.
#pragma once

#include <cstdint>
#include <vector>

namespace splitnerf {

template <class T> struct Planes {
  std::vector<T> x, y, z;

  Planes(const T* interleaved, int64_t n) : x(n), y(n), z(n) {
    for (int64_t i = 0; i < n; ++i) x[i] = interleaved[3 * i], y[i] = interleaved[3 * i + 1], z[i] = interleaved[3 * i + 2];
  }
};

}  // namespace splitnerf
