// Importance sampling of an environment map in proportion to luminance x solid angle.
#pragma once

#include <algorithm>
#include <vector>

#include "splitnerf/environment.h"

namespace splitnerf {

class EnvironmentSampler {
 public:
  EnvironmentSampler(const float* map, int height, int width)
      : map_(map), height_(height), width_(width), row_cdf_(height + 1, 0.), row_density_(height),
        row_cosine_(height + 1), cdf_(size_t(height) * (width + 1), 0.f) {
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
    for (int row = 0; row <= height; ++row) row_cosine_[row] = std::cos(kPi * row / height);
    for (int row = 0; row < height; ++row) {
      row_density_[row] = (row_cdf_[row + 1] - row_cdf_[row]) / texel_solid_angle<double>(row, height, width);
    }
    row_guide_ = make_guide(row_cdf_.data(), height);
    for (int row = 0; row < height; ++row) {
      const std::vector<int> guide = make_guide(row_cdf(row), width);
      guide_.insert(guide_.end(), guide.begin(), guide.end());
    }
  }

  bool black() const { return !(total_ > 0); }
  Vec3<float> radiance(Vec3<float> direction) const { return lookup_environment(map_, height_, width_, direction); }

  // Density per steradian of sample() at a direction.
  float pdf(Vec3<float> direction) const {
    const Vec2<float> uv = direction_to_equirect(direction);
    return texel_pdf(std::min(static_cast<int>(uv.y * height_), height_ - 1),
                     std::min(static_cast<int>(uv.x * width_), width_ - 1));
  }

  // A direction and its density: a row by the marginal distribution, a column by the row's own,
  // then uniform in solid angle within the texel (uniform in u and in cos theta).
  Vec3<float> sample(Vec2<float> u, float* pdf) const {
    const int row = find(row_cdf_.data(), row_guide_.data(), height_, double(u.x));
    const double v = (u.x - row_cdf_[row]) / (row_cdf_[row + 1] - row_cdf_[row]);
    const float* cdf = row_cdf(row);
    const int column = find(cdf, guide_.data() + size_t(row) * width_, width_, u.y);
    const float x = (u.y - cdf[column]) / (cdf[column + 1] - cdf[column]);
    *pdf = texel_pdf(row, column);
    const float z = static_cast<float>(clamp(lerp(row_cosine_[row], row_cosine_[row + 1], v), -1., 1.));
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

  // guide[k] is the interval that holds k / n: a search starts there and rarely moves on.
  template <class T> static std::vector<int> make_guide(const T* cdf, int n) {
    std::vector<int> guide(n);
    for (int k = 0, i = 0; k < n; ++k) {
      while (i + 1 < n && cdf[i + 1] <= T(k) / n) ++i;
      guide[k] = i;
    }
    return guide;
  }

  // The interval [cdf[i], cdf[i + 1]) that holds u; empty intervals are never chosen.
  template <class T> static int find(const T* cdf, const int* guide, int n, T u) {
    int i = guide[std::min(static_cast<int>(u * n), n - 1)];
    while (i > 0 && cdf[i] > u) --i;  // u n may round up
    while (i + 1 < n && cdf[i + 1] <= u) ++i;
    return i;
  }

  float texel_pdf(int row, int column) const {
    const float* cdf = row_cdf(row);
    return static_cast<float>(row_density_[row] * (cdf[column + 1] - cdf[column]));
  }

  float* row_cdf(int row) { return cdf_.data() + size_t(row) * (width_ + 1); }
  const float* row_cdf(int row) const { return cdf_.data() + size_t(row) * (width_ + 1); }

  const float* map_;
  int height_, width_;
  std::vector<double> row_cdf_;      // marginal over rows
  std::vector<double> row_density_;  // a row's share over its texels' solid angle
  std::vector<double> row_cosine_;   // cos theta of the rows' edges
  std::vector<float> cdf_;           // [height, width + 1] conditional over columns
  std::vector<int> row_guide_, guide_;
  double total_ = 0;
};

}  // namespace splitnerf
