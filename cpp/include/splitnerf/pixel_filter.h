// Reconstruction filters of the image, applied by filter importance sampling: sub-samples are
// spread with the filter's density and weigh the same.   Source: Ernst, Stamminger, Greiner 2006.
#pragma once

#include <array>
#include <cmath>

#include "splitnerf/sampling.h"

namespace splitnerf {

enum class PixelFilter : int {
  kBox = 0,             // 1 pixel wide
  kBlackmanHarris = 1,  // 3 pixels from end to end, which Blender calls a width of 1.5, its default
};

// Maps a uniform u in [0, 1) to an offset from the pixel's centre, in pixels.
class PixelFilterSampler {
 public:
  explicit PixelFilterSampler(PixelFilter filter) : box_(filter == PixelFilter::kBox), window_(window()) {}
  float operator()(float u) const {
    if (box_) return u - 0.5f;
    const float x = u * kIntervals;
    const int i = min_of(static_cast<int>(x), kIntervals - 1);
    return lerp(window_[i], window_[i + 1], x - i);
  }

 private:
  static constexpr int kIntervals = 4096;
  static constexpr double kWidth = 3;  // pixels

  static const float* window() {
    static const std::array<float, kIntervals + 1> offsets = [] {
      std::array<float, kIntervals + 1> table;
      for (int i = 0; i <= kIntervals; ++i) {
        table[i] = static_cast<float>(kWidth * (invert(static_cast<double>(i) / kIntervals) - 0.5));
      }
      return table;
    }();
    return offsets.data();
  }

  // The 4-term window w(t) = a0 - a1 cos 2 pi t + a2 cos 4 pi t - a3 cos 6 pi t, t in [0, 1],
  // integrated and divided by a0.   Source: Harris 1978, 92 dB window.
  static double cdf(double t) {
    const double x = 2 * kPi * t;
    return t + (-0.48829 * std::sin(x) + 0.14128 / 2 * std::sin(2 * x) - 0.01168 / 3 * std::sin(3 * x)) /
                   (2 * kPi * 0.35875);
  }
  static double invert(double u) {
    double lo = 0, hi = 1;
    for (int i = 0; i < 60; ++i) {
      const double mid = 0.5 * (lo + hi);
      (cdf(mid) < u ? lo : hi) = mid;
    }
    return 0.5 * (lo + hi);
  }

  bool box_;
  const float* window_;
};

}  // namespace splitnerf
