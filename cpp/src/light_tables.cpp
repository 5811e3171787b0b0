#include "splitnerf/light_tables.h"

#include <algorithm>
#include <array>
#include <utility>

#include "splitnerf/octahedral.h"
#include "splitnerf/parallel.h"
#include "splitnerf/prefilter.h"
#include "splitnerf/spherical_harmonics.h"

namespace splitnerf {
namespace {

// Where a cell of the light is taken as one: its edge is at most kCellSize ggx_alpha near the lobe's centre, and
// grows with the squared distance further out, as the lobe's share falls with it.
constexpr double kCellSize = 0.8, kLargestCell = 0.6;

struct Entry {
  int32_t column;
  double weight;
};

void append_row(SparseMatrix& matrix, const std::vector<Entry>& row) {
  for (const Entry& e : row) matrix.columns.push_back(e.column), matrix.weights.push_back(e.weight);
  matrix.offsets.push_back(static_cast<int64_t>(matrix.columns.size()));
}

Vec3<double> direction_of(Vec2<double> uv) { return normalize(octahedral_point(uv)); }

double triangle_solid_angle(Vec3<double> a, Vec3<double> b, Vec3<double> c) {
  // Source: Van Oosterom and Strackee 1983.
  return 2 * std::atan2(std::fabs(dot(a, cross(b, c))), 1 + dot(a, b) + dot(b, c) + dot(c, a));
}

// A quadrature point of a cell: a direction, where it lies on the square, and its share of the solid angle.
struct Sample {
  Vec3<double> w;
  Vec2<double> uv;
  double solid_angle;
};

// Gauss-Legendre, two by two.
std::array<Sample, 4> cell_samples(int n, int i, int j) {
  const Vec2<double> centre = octahedral_texel_centre<double>(n, i, j);
  std::array<Sample, 4> samples;
  for (int k = 0; k < 4; ++k) {
    const double step = 1 / (std::sqrt(3.0) * n);
    const Vec2<double> uv{centre.x + (k & 1 ? step : -step), centre.y + (k & 2 ? step : -step)};
    const Vec3<double> p = octahedral_point(uv);
    const double r2 = dot(p, p);
    samples[k] = {p / std::sqrt(r2), uv, 1 / (double(n) * n * r2 * std::sqrt(r2))};
  }
  return samples;
}

// A weighted sum over columns, gathered densely and read out in order.
class Row {
 public:
  explicit Row(int64_t n_columns) : dense_(n_columns, 0.0) {}

  void add(int32_t column, double weight) {
    if (dense_[column] == 0) touched_.push_back(column);
    dense_[column] += weight;
  }
  // The entries divided by their sum; the row is empty afterwards.
  std::vector<Entry> take_normalised() {
    std::sort(touched_.begin(), touched_.end());
    touched_.erase(std::unique(touched_.begin(), touched_.end()), touched_.end());
    double total = 0;
    for (int32_t c : touched_) total += dense_[c];
    std::vector<Entry> entries;
    for (int32_t c : touched_) {
      if (dense_[c] > 0) entries.push_back({c, dense_[c] / total});
      dense_[c] = 0;
    }
    touched_.clear();
    return entries;
  }

 private:
  std::vector<double> dense_;
  std::vector<int32_t> touched_;
};

// One lobe over the tree of averages. Beyond the texels the tree goes on with parts of them.
class LobeRow {
 public:
  LobeRow(int n, double roughness) : n_(n), alpha_(ggx_alpha_from_roughness(roughness)) {}

  void fill(Vec3<double> axis, Row& row) const {
    for (int j = 0; j < kCoarsestAverage; ++j)
      for (int i = 0; i < kCoarsestAverage; ++i) visit(axis, kCoarsestAverage, i, j, row);
  }

 private:
  void visit(Vec3<double> axis, int side, int i, int j, Row& row) const {
    const Vec3<double> p = octahedral_point(octahedral_texel_centre<double>(side, i, j));
    const double r2 = dot(p, p), edge = 2 / (side * std::sqrt(r2 * std::sqrt(r2)));
    const double cosine = dot(p, axis) / std::sqrt(r2), angle = std::acos(clamp(cosine, -1.0, 1.0));
    const double nearest = max_of(angle - 0.5 * edge, 0.0);
    if (nearest > 0.5 * kPi) return;
    const double s = std::sin(0.5 * nearest), ratio = max_of(s / alpha_, 1.0);
    if (edge > min_of(kCellSize * alpha_ * ratio * ratio, kLargestCell)) {
      for (int k = 0; k < 4; ++k) visit(axis, 2 * side, 2 * i + (k & 1), 2 * j + (k >> 1), row);
      return;
    }
    for (const Sample& sample : cell_samples(side, i, j)) {
      const Vec3<double> d = sample.w - axis;
      const double weight = prefilter_weight(d.x, d.y, d.z, alpha_ * alpha_) * sample.solid_angle;
      if (weight <= 0) continue;
      if (side < n_) {
        row.add(average_offset(side) + j * side + i, weight);
      } else {
        const OctahedralFootprint<double> f = octahedral_footprint(n_, sample.uv);
        for (int k = 0; k < 4; ++k) row.add(f.texel[k], weight * f.weight(k));
      }
    }
  }
  int32_t average_offset(int side) const {
    int32_t offset = 0;
    for (int finer = n_; finer > side; finer /= 2) offset += finer * finer;
    return offset;
  }

  int n_;
  double alpha_;
};

}  // namespace

template <class T> const ShRecurrence<T>& sh_recurrence() {
  static const ShRecurrence<T> table = [] {
    ShRecurrence<T> r{};
    double diagonal = kShConstant;
    for (int m = 0; m <= kShDegree; ++m) {
      if (m > 0) diagonal *= std::sqrt((2 * m + 1) / (2.0 * m)) * (m == 1 ? std::sqrt(2.0) : 1.0);
      r.diagonal[m] = T(diagonal);
      for (int l = m; l <= kShDegree; ++l) {
        const double above = l + 1, m2 = double(m) * m;
        const double raise = std::sqrt((4 * above * above - 1) / (above * above - m2));
        r.raise[l][m] = T(raise);
        r.lower[l][m] = l > m ? T(raise * std::sqrt((double(l) * l - m2) / (4.0 * l * l - 1))) : T(0);
      }
    }
    return r;
  }();
  return table;
}
template const ShRecurrence<float>& sh_recurrence<float>();
template const ShRecurrence<double>& sh_recurrence<double>();

std::vector<double> octahedral_solid_angles(int n) {
  std::vector<double> out(int64_t(n) * n);
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      Vec3<double> corner[4];
      for (int k = 0; k < 4; ++k) corner[k] = direction_of({2.0 * (i + (k & 1)) / n - 1, 2.0 * (j + (k >> 1)) / n - 1});
      // Great-circle sides: either diagonal divides the texel into two triangles.
      out[int64_t(j) * n + i] =
          triangle_solid_angle(corner[0], corner[1], corner[2]) + triangle_solid_angle(corner[3], corner[2], corner[1]);
    }
  return out;
}

SparseMatrix light_sum_of_levels(int n) {
  SparseMatrix matrix;
  for (int side = kCoarsestLight; side <= n; side *= 2) matrix.n_columns += int64_t(side) * side;
  std::vector<Entry> row;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      row.clear();
      int32_t offset = 0;
      for (int side = kCoarsestLight; side < n; side *= 2) {
        const auto f = octahedral_footprint(side, octahedral_texel_centre<double>(n, i, j));
        for (int k = 0; k < 4; ++k) row.push_back({offset + f.texel[k], f.weight(k)});
        offset += side * side;
      }
      row.push_back({offset + j * n + i, 1.0});
      append_row(matrix, row);
    }
  return matrix;
}

SparseMatrix light_averages(int n) {
  const std::vector<double> solid_angle = octahedral_solid_angles(n);
  SparseMatrix matrix;
  matrix.n_columns = int64_t(n) * n;
  Row row(matrix.n_columns);
  for (int side = n, block = 1; side >= kCoarsestAverage || block == 1; side /= 2, block *= 2)
    for (int j = 0; j < side; ++j)
      for (int i = 0; i < side; ++i) {
        for (int y = j * block; y < (j + 1) * block; ++y)
          for (int x = i * block; x < (i + 1) * block; ++x) row.add(y * n + x, solid_angle[int64_t(y) * n + x]);
        append_row(matrix, row.take_normalised());
      }
  return matrix;
}

SparseMatrix light_filter(int n, int m, double roughness) {
  SparseMatrix matrix;
  for (int side = n; side >= kCoarsestAverage; side /= 2) matrix.n_columns += int64_t(side) * side;
  const LobeRow lobe(n, roughness);
  const int half = m / 2;
  std::vector<std::vector<Entry>> rows(int64_t(half) * half);
  parallel_for(half, 1, [&](int64_t begin, int64_t end) {
    Row row(matrix.n_columns);
    for (int64_t r = begin * half; r < end * half; ++r) {
      lobe.fill(direction_of(octahedral_texel_centre<double>(m, int(r % half), int(r / half))), row);
      rows[r] = row.take_normalised();
    }
  });
  for (const std::vector<Entry>& row : rows) append_row(matrix, row);
  return matrix;
}

std::vector<double> sh_projection(int n, bool cells) {
  const int64_t n_texels = int64_t(n) * n;
  const ShRecurrence<double>& recurrence = sh_recurrence<double>();
  std::vector<double> out(kShCoefficients * n_texels), share(n_texels);
  double total = 0;
  for (int j = 0; j < 2 * n; ++j)
    for (int i = 0; i < 2 * n; ++i)
      for (const Sample& s : cell_samples(2 * n, i, j)) {
        OctahedralFootprint<double> f = octahedral_footprint(n, s.uv);
        if (cells) f.texel[0] = (j / 2) * n + i / 2, f.fx = f.fy = 0;
        total += s.solid_angle;
        for (int k = 0; k < 4; ++k) share[f.texel[k]] += s.solid_angle * f.weight(k);
        double c = 1, si = 0;
        for (int m = 0; m <= kShDegree; ++m) {
          double before = 0, p = recurrence.diagonal[m];
          for (int l = m; l <= kShDegree; ++l) {
            for (int k = 0; k < (cells ? 1 : 4); ++k) {
              const double weight = s.solid_angle * f.weight(k) * p;
              out[sh_index(l, m) * n_texels + f.texel[k]] += weight * c;
              if (m > 0) out[sh_index(l, -m) * n_texels + f.texel[k]] += weight * si;
            }
            const double next = s.w.z * p * recurrence.raise[l][m] - before * recurrence.lower[l][m];
            before = p, p = next;
          }
          const double turned = c * s.w.x - si * s.w.y;
          si = si * s.w.x + c * s.w.y, c = turned;
        }
      }
  // What the quadrature leaves of a constant is taken out of every coefficient but the first.
  for (int64_t b = 0; b < kShCoefficients; ++b) {
    double sum = 0;
    for (int64_t t = 0; t < n_texels; ++t) sum += out[b * n_texels + t];
    for (int64_t t = 0; t < n_texels; ++t) {
      double& weight = out[b * n_texels + t];
      weight = b == 0 ? share[t] / total * (4 * kPi * kShConstant) : weight - sum * share[t] / total;
    }
  }
  return out;
}

std::vector<double> zonal_factors(double start, int n_rows) {
  constexpr int kIntervals = 4096;  // of Simpson's rule in the cosine
  std::vector<double> out(int64_t(n_rows) * kShBands, 0.0);
  for (int r = 0; r < n_rows; ++r) {
    const double a2 = square(ggx_alpha_from_roughness(start + (1 - start) * r / (n_rows - 1)));
    double* factors = &out[int64_t(r) * kShBands];
    for (int k = 0; k <= kIntervals; ++k) {
      const double c = double(k) / kIntervals, simpson = k == 0 || k == kIntervals ? 1 : k & 1 ? 4 : 2;
      const double weight = simpson * prefilter_weight(std::sqrt(2 - 2 * c), 0.0, 0.0, a2);
      double before = 0, p = 1;
      for (int l = 0; l < kShBands; ++l) {
        factors[l] += weight * p;
        const double next = ((2 * l + 1) * c * p - l * before) / (l + 1);
        before = p, p = next;
      }
    }
    for (int l = kShBands - 1; l >= 0; --l) factors[l] /= factors[0];
  }
  return out;
}

}  // namespace splitnerf
