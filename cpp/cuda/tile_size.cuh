// How many points a block takes at a time, where its shared memory holds a row of numbers for each of them.
#pragma once

#include "launch.cuh"

namespace splitnerf::cuda {

constexpr int kTilePoints[] = {64, 32};  // points of a tile

struct TileSize {
  int points, bytes;
};

// The most points of a tile with so many rows, and its shared memory, which the kernel is set to allow. too_many: what to say
// where not even the fewest fit. A row has a number more, so that neither rows nor columns meet in one bank.
template <class T, class Kernel> TileSize tile_size(const char* op, int rows, Kernel kernel, const char* too_many) {
  const int most = most_shared_memory(op);
  for (const int points : kTilePoints) {
    const int64_t bytes = int64_t{rows} * (points + 1) * int64_t{sizeof(T)};
    if (bytes > most) continue;
    allow_shared_memory(op, kernel, bytes);
    return {points, static_cast<int>(bytes)};
  }
  throw std::invalid_argument(std::string(op) + ": " + too_many + " for this GPU's shared memory");
}

}  // namespace splitnerf::cuda
