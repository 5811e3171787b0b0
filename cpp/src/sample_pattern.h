// The random numbers of the path tracer.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "splitnerf/sampling.h"

namespace splitnerf {

// Well-spread sample points: every pair of dimensions holds the spp-point Fibonacci lattice in a
// random order of its own; each pixel starts at a random place of the order and shifts the points
// modulo 1. Each sample is then uniform, so estimates stay unbiased.
class SamplePattern {
 public:
  SamplePattern(int spp, int n_pairs, uint32_t seed) : spp_(spp), n_pairs_(n_pairs), seed_(hash_u32(seed)) {
    points_.resize(size_t(spp) * n_pairs);
    for (int pair = 0; pair < n_pairs; ++pair) {
      Vec2<float>* points = points_.data() + size_t(pair) * spp;
      for (int i = 0; i < spp; ++i) points[i] = fibonacci_lattice<float>(i, spp);
      for (int i = spp - 1; i > 0; --i) {  // Fisher-Yates
        std::swap(points[i], points[hash_u32(i, pair, seed_) % uint32_t(i + 1)]);
      }
    }
  }

  struct Offset {
    Vec2<float> shift;
    uint32_t start;
  };
  void start_pixel(uint32_t pixel, std::vector<Offset>& offsets) const {
    offsets.resize(n_pairs_);
    for (int pair = 0; pair < n_pairs_; ++pair) {
      const uint32_t bits = hash_u32(pixel, 3 * pair, seed_ + 1);
      offsets[pair] = {{unit_from_bits<float>(hash_u32(bits + 1)), unit_from_bits<float>(hash_u32(bits + 2))},
                       bits % uint32_t(spp_)};
    }
  }
  Vec2<float> get(const std::vector<Offset>& offsets, int sample, int pair) const {
    const Offset& o = offsets[pair];
    const Vec2<float> p = points_[size_t(pair) * spp_ + (o.start + sample) % spp_];
    return {wrap_unit(p.x, o.shift.x), wrap_unit(p.y, o.shift.y)};
  }

 private:
  int spp_, n_pairs_;
  uint32_t seed_;
  std::vector<Vec2<float>> points_;  // [n_pairs, spp]
};

}  // namespace splitnerf
