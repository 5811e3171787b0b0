// Importance sampling of an environment map in proportion to luminance x solid angle.
#pragma once

#include <algorithm>
#include <vector>

#include "splitnerf/environment.h"

namespace splitnerf {

class EnvironmentSampler {
 public:
  EnvironmentSampler(const float* map, int height, int width)
      : map_(map),
        height_(height),
        width_(width),
        row_cdf_(height + 1, 0.),
        cdf_(size_t(height) * (width + 1), 0.f) {
    // The mean of the bilinear map over texel i is (L[i-1] + 6 L[i] + L[i+1]) / 8 on either axis,
    // so the density follows what a lookup returns, and is positive wherever that is.
    std::vector<double> weights(width);
    for (int row = 0; row < height; ++row) {
      const double solid_angle = texel_solid_angle<double>(row, height, width);
      double total = 0;
      for (int column = 0; column < width; ++column) {
        double mean = 0;
        for (int i = -1; i <= 1; ++i) {
          for (int j = -1; j <= 1; ++j) mean += (i ? 1 : 6) * (j ? 1 : 6) / 64. * luminance(row + i, column + j);
        }
        weights[column] = mean * solid_angle;
        total += weights[column];
      }
      row_cdf_[row + 1] = row_cdf_[row] + total;
      double running = 0;
      float* cdf = row_cdf(row);
      for (int column = 0; column < width && total > 0; ++column) {
        running += weights[column];
        cdf[column + 1] = static_cast<float>(running / total);
      }
      if (total > 0) cdf[width] = 1.f;
    }
    total_ = row_cdf_[height];
    for (double& value : row_cdf_) value = total_ > 0 ? value / total_ : 0;
    if (total_ > 0) row_cdf_[height] = 1;
  }

  bool black() const { return !(total_ > 0); }
  Vec3<float> radiance(Vec3<float> direction) const {
    return lookup_environment(map_, height_, width_, direction);
  }

  // Density per steradian of sample() at a direction.
  float pdf(Vec3<float> direction) const {
    const Vec2<float> uv = direction_to_equirect(direction);
    return texel_pdf(std::min(static_cast<int>(uv.y * height_), height_ - 1),
                     std::min(static_cast<int>(uv.x * width_), width_ - 1));
  }

  // A direction and its density: a row by the marginal distribution, a column by the row's own,
  // then uniform in solid angle within the texel (uniform in u and in cos theta).
  Vec3<float> sample(Vec2<float> u, float* pdf) const {
    const int row = find(row_cdf_.data(), height_, double(u.x));
    const double v = (u.x - row_cdf_[row]) / (row_cdf_[row + 1] - row_cdf_[row]);
    const float* cdf = row_cdf(row);
    const int column = find(cdf, width_, u.y);
    const float x = (u.y - cdf[column]) / (cdf[column + 1] - cdf[column]);
    *pdf = texel_pdf(row, column);
    const double top = std::cos(kPi * row / height_), bottom = std::cos(kPi * (row + 1) / height_);
    const float z = static_cast<float>(clamp(lerp(top, bottom, v), -1., 1.));
    const float phi = static_cast<float>(2 * kPi) * (0.5f - (column + x) / width_);
    const float s = std::sqrt(1.f - z * z);
    return {s * std::cos(phi), s * std::sin(phi), z};
  }

 private:
  double luminance(int row, int column) const {
    row = clamp(row, 0, height_ - 1);
    column = (column + width_) % width_;
    const float* p = map_ + (int64_t(row) * width_ + column) * 3;
    return 0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2];
  }

  // The interval [cdf[i], cdf[i + 1]) that holds u; empty intervals are never chosen.
  template <class T>
  static int find(const T* cdf, int n, T u) {
    return static_cast<int>(clamp<int64_t>(std::upper_bound(cdf, cdf + n + 1, u) - cdf - 1, 0, n - 1));
  }

  float texel_pdf(int row, int column) const {
    const float* cdf = row_cdf(row);
    return static_cast<float>((row_cdf_[row + 1] - row_cdf_[row]) * (cdf[column + 1] - cdf[column]) /
                              texel_solid_angle<double>(row, height_, width_));
  }

  float* row_cdf(int row) { return cdf_.data() + size_t(row) * (width_ + 1); }
  const float* row_cdf(int row) const { return cdf_.data() + size_t(row) * (width_ + 1); }

  const float* map_;
  int height_, width_;
  std::vector<double> row_cdf_;  // marginal over rows
  std::vector<float> cdf_;       // [height, width + 1] conditional over columns
  double total_ = 0;
};

}  // namespace splitnerf
