// Interleaved three-vectors split into three arrays, so that the kernels read whole vectors.
#pragma once

#include <cstdint>
#include <vector>

namespace splitnerf {

template <class T> struct Planes {
  std::vector<T> x, y, z;

  Planes(const T* interleaved, int64_t n) : x(n), y(n), z(n) {
    for (int64_t i = 0; i < n; ++i, interleaved += 3)
      x[i] = interleaved[0], y[i] = interleaved[1], z[i] = interleaved[2];
  }
};

}  // namespace splitnerf
