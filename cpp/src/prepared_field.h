// The distance field as the kernels read it.
#pragma once

#include <array>

#include "splitnerf/kernels.h"

namespace splitnerf::cpu {

template <class T> struct PreparedField {
  std::array<HashLevel, kMaxLevels> levels;
  PreparedSdfLayer<T> layer;
  SdfNetwork<T> network;

  explicit PreparedField(const SdfField<T>& f) : layer(f.weights) {
    hash_levels(f.shape, levels.data());
    network = {{levels.data(), f.shape.n_features, f.shape.n_levels, f.n_active, 0, nullptr, f.table}, layer.layer()};
  }
  PreparedField(const PreparedField&) = delete;
  PreparedField& operator=(const PreparedField&) = delete;
};

}  // namespace splitnerf::cpu
