// The machine's speed at what a hash grid does most: reading entries of a table in random order.
#pragma once

#include <cstdint>

#include "splitnerf/config.h"

namespace splitnerf {

// Sum of n entries of two floats at pseudo-random places of a table of 2^log2_entries of them: two multiplications and
// one load of 8 bytes each, spread over the thread pool. What no encoding of the same table can be faster than.
SPLITNERF_API float random_gathers(const float* table, int log2_entries, int64_t n);

}  // namespace splitnerf
