// The fixed linear maps between the light's parameters, its texels, their averages and the filtered
// levels. Computed once, in double precision.
#pragma once

#include <cstdint>
#include <vector>

#include "splitnerf/config.h"

namespace splitnerf {

// A sparse matrix by rows: row r holds entries [offsets[r], offsets[r + 1]).
struct SparseMatrix {
  int64_t n_columns = 0;
  std::vector<int64_t> offsets{0};
  std::vector<int32_t> columns;
  std::vector<double> weights;
};

inline constexpr int kCoarsestLight = 4;    // texels along the edge of the coarsest parameters
inline constexpr int kCoarsestAverage = 8;  // and of the coarsest averages

// Solid angle of each texel of an n x n octahedral map, [n^2]; they sum to 4 pi.
SPLITNERF_API std::vector<double> octahedral_solid_angles(int n);

// Sum of the levels 4^2, 8^2, ..., n^2 (columns, coarse to fine), each read bilinearly at the n^2 texels (rows).
SPLITNERF_API SparseMatrix light_sum_of_levels(int n);

// The n^2 texels themselves and their averages by solid angle over (n/2)^2, ..., 8^2 cells (rows).
SPLITNERF_API SparseMatrix light_averages(int n);

// gbar(w_s, roughness) at the m^2 texel centres w_s (rows) of the light over the rows of light_averages(n).
// Cells near the lobe's centre are small and the light in them bilinear between the n^2 texels; where the
// lobe varies slowly they grow and the light in them is its average. Rows sum to 1. m is even; the rows are those of the quarter
// i, j < m / 2, as the others are its mirror images.
SPLITNERF_API SparseMatrix light_filter(int n, int m, double roughness);

// Coefficients [169, n^2] of the light that is bilinear between n^2 texels (or, `cells`, constant in
// each); a constant light has the constant's alone.
SPLITNERF_API std::vector<double> sh_projection(int n, bool cells);

// [n_rows, 13] factors of the lobe D cos+ by degree, at n_rows roughnesses from `start` to 1:
// int D(w) w.z P_l(w.z) dw / int D w.z dw. Source: Funk-Hecke; Ramamoorthi and Hanrahan 2001.
SPLITNERF_API std::vector<double> zonal_factors(double start, int n_rows);

}  // namespace splitnerf
