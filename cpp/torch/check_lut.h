// The check of the table that shading reads.
#pragma once

#include "check.h"
#include "splitnerf/split_sum.h"

namespace splitnerf::glue {

inline Tensor checked_lut(const char* op, const Tensor& lut, Kind kind) {
  return checked(op, "lut", lut, {kLutSize, kLutSize, kLutChannels}, kind.with(ScalarType::Float));
}

}  // namespace splitnerf::glue
