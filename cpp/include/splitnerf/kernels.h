// The inner loops that are compiled once per instruction set and chosen when first used.
#pragma once

#include <cstdint>
#include <vector>

#include "splitnerf/bodies/adamw.h"
#include "splitnerf/config.h"
#include "splitnerf/hash_grid.h"
#include "splitnerf/light_pyramid.h"
#include "splitnerf/occlusion.h"
#include "splitnerf/sdf_layer.h"
#include "splitnerf/split_sum.h"

namespace splitnerf {

template <class T> struct HashEncodeArgs {
  const HashLevel* levels;
  int n_features;  // of one level
  int n_levels;    // all levels: columns of the output = n_levels * n_features
  int n_active;    // levels [0, n_active) are open
  int64_t n_points;
  const T* positions;  // [n, 3] in the unit cube
  HashTable table;     // [n_entries, n_features]
};

// The distance field: hash-grid features and a layer over them.
template <class T> struct SdfNetwork {
  HashEncodeArgs<T> grid;  // without points
  SdfLayer<T> layer;
};

// Gradients to a field's grid, level after level: to feature f of open level l at point p, [l stride + p F + f]; and the number that
// the gradient to its derivative by a coordinate has as a factor, beside the gradient to that coordinate's part of the field's.
template <class T> struct LevelPlanes {
  T *features, *slopes;
  int64_t stride;  // n F
  int n_levels, n_features;
};

// Weights of all (query, source) pairs of the pre-integration lobe, structure of arrays.
template <class T> struct LobeSide {
  const T *x, *y, *z;      // unit directions
  const T* alpha_squared;  // ggx_alpha^2 on the query side, null on the light side
  const T *r, *g, *b;      // what is summed over this side
  int64_t n;
};

// A point that reads visibility bits from nearby vertices.
template <class T> struct VisibilityPoint {
  const uint32_t* const* bits;  // [n_neighbours] each neighbour's words, open then blocked, see visibility_bits
  const T* weights;             // [n_neighbours], sum 1
  int n_neighbours;
};

// The two kernels that visibility_sums weighs the light with at a point.
template <class T> struct VisibilityLobe {
  const T* cosine;    // [n directions], from visibility_horizon
  const T* lobe_dir;  // [3]
  T alpha_squared;    // of the lobe, ggx_alpha^2
};

template <class T> struct Kernels {
  const char* name;

  // features [n, C]; jacobian [n, 3, C] or null; columns of closed levels become 0. Points [begin, end).
  void (*hash_encode)(const HashEncodeArgs<T>&, int64_t begin, int64_t end, T* features, T* jacobian);
  // Adds to grad_table. Level `level`, all points.
  void (*hash_scatter)(const HashEncodeArgs<T>&, int level, const T* grad_features, T* grad_table);
  // The same with a gradient to the derivative by each axis: slopes times along [n, 3].
  void (*hash_scatter_along)(const HashEncodeArgs<T>&, int level, const LevelPlanes<const T>& grad, const T* along,
                             T* grad_table);
  // values [n] at positions [n, 3], scene units; n <= kSdfBlock, work [sdf_work_size].
  void (*sdf_values)(const SdfNetwork<T>&, int64_t n, const T* positions, T* work, T* values);
  // outputs [n, M], gradient [n, 3] d distance / d position.
  void (*sdf_layer)(const SdfLayer<T>&, const SdfPoints<T>&, T* work, T* outputs, T* gradient);
  // Overwrites the block's part of the planes, whose pointers are at its first point; adds to the weights' gradients.
  void (*sdf_layer_backward)(const SdfLayer<T>&, const SdfPoints<T>&, const SdfOutputs<const T>& grad, T* work,
                             const LevelPlanes<T>& grad_levels, const SdfLayerGrad<T>&);
  // likeness[j] = k_ij = exp(-|x_i - x_j|^2 / 4), i = point, work memory of n; sums = {sum_j k_ij (x_i - x_j) for each
  // channel, sum_j k_ij}. planes [n_channels, n] hold x.
  void (*pair_likeness)(int64_t n, int64_t n_channels, const T* planes, int64_t point, T* likeness, T* sums);
  // sums[i - begin] = {sum K r, sum K g, sum K b, sum K} over the sources, for queries [begin, end).
  void (*lobe_gather)(const LobeSide<T>& queries, const LobeSide<T>& lights, int64_t begin, int64_t end, T* sums);
  // sums[i - begin] = {sum K r, sum K g, sum K b} over the queries, for lights [begin, end).
  void (*lobe_scatter)(const LobeSide<T>& queries, const LobeSide<T>& lights, int64_t begin, int64_t end, T* sums);
  // cosine[i] = (w_i.n)+ and, bit by bit, whether it is positive. The number of directions is a multiple of 32.
  void (*visibility_horizon)(const LobeSide<T>& directions, const T* normal, T* cosine, uint32_t* above);
  // known[i] = weight of the neighbours that know direction i, visible[i] = the open share of it, 1 where none knows.
  void (*visibility_shares)(int64_t n_directions, const VisibilityPoint<T>& point, T* known, T* visible);
  // lobe[i] = D(w_i, d)(w_i.d)+ [w_i.n > 0] up to a factor; light in the directions' r, g, b. With c = cosine,
  // sums = {sum V L c, sum L c (three channels each), sum c; the same with lobe for c}: 14 numbers.
  void (*visibility_sums)(const LobeSide<T>& directions, const VisibilityLobe<T>& lobes, const T* visible, T* lobe,
                          T* sums);
  // Directions [padded_fan(n)] of a fan's rays, and -1 for those that count, 0 for others.
  void (*fan_directions)(const RayFan<T>&, float* x, float* y, float* z, int32_t* active);
  // sums = {sum V (L + eps), sum (L + eps)}, three channels each, over the active ones of n directions, a multiple of 16;
  // map [height, width, 3], less than 2^31 numbers; visible is 0 where something is in the way, else -1.
  void (*fan_light)(const T* map, int height, int width, int64_t n, const float* x, const float* y, const float* z,
                    const int32_t* active, const int32_t* visible, T* sums);
  // radiance [n, 3], see splitnerf::split_sum_shade. Points [begin, end); n_channels 1 or 3 of the occlusion factors.
  void (*split_sum_shade)(const float* lut, ShadeOptions, int64_t begin, int64_t end, int n_channels,
                          const ShadeArrays<const T>&, T* radiance);
  // Overwrites all of grad.
  void (*split_sum_shade_backward)(const float* lut, ShadeOptions, int64_t begin, int64_t end, int n_channels,
                                   const ShadeArrays<const T>&, const T* grad_radiance, const ShadeArrays<T>& grad);

  // radiance [n, 3] of directions [n, 3] and roughness [n]. Points [begin, end).
  void (*light_lookup)(const LightPyramid<T>&, int64_t begin, int64_t end, const T* directions, const T* roughness,
                       T* radiance);
  // Adds to grad_levels and grad_sh, overwrites the others. Points [begin, end).
  void (*light_lookup_backward)(const LightPyramid<T>&, int64_t begin, int64_t end, const T* directions,
                                const T* roughness, const T* grad_radiance, T* grad_directions, T* grad_roughness,
                                T* grad_levels, T* grad_sh);
  // products [n_rows, 3] = matrix . values, of values [n_columns, 4] whose last column is padding. Rows [begin, end). False where a
  // column of the matrix is out of range.
  bool (*sparse_product)(const SparseRows<T>&, const T* padded, int64_t begin, int64_t end, T* products);
  // Rows [begin, end) of columns > 0.
  void (*adamw_step)(const AdamwRule<T>&, const AdamwArrays<T>&, int64_t begin, int64_t end);
};

// Those for this processor. SPLITNERF_ISA = base | avx2 | avx512 in the environment picks a lower
// set (a set that the processor lacks is refused with std::runtime_error).
template <class T> SPLITNERF_API const Kernels<T>& kernels();

// Every set that this build and processor can run, base first: for tests that hold one against another.
template <class T> SPLITNERF_API std::vector<Kernels<T>> usable_kernels();

}  // namespace splitnerf
