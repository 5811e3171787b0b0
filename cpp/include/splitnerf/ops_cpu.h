// The operators on the CPU over plain arrays: what the torch glue, gtest and other programs call.
// All arrays are dense and row-major; T is float or double. Threads come from parallel.h.
#pragma once

#include <cstdint>

#include "splitnerf/hash_grid.h"
#include "splitnerf/kernels.h"
#include "splitnerf/light_pyramid.h"
#include "splitnerf/march.h"
#include "splitnerf/monte_carlo.h"
#include "splitnerf/occlusion.h"
#include "splitnerf/ray_walk.h"
#include "splitnerf/scene.h"
#include "splitnerf/sdf_layer.h"
#include "splitnerf/split_sum.h"
#include "splitnerf/varying_outputs.h"
#include "splitnerf/visibility_cache.h"

namespace splitnerf::cpu {

// ---- hash grid. C = n_levels * n_features; columns of closed levels are written as 0. ----

// positions [n, 3], table [n_entries, n_features] of T or of 16 bits -> features [n, C], jacobian [n, 3, C] or null.
template <class T>
SPLITNERF_API void hash_encode(const HashGridShape& shape, int n_active, int64_t n, const T* positions, HashTable table,
                               T* features, T* jacobian);
// grad_features [n, C] and grad_jacobian [n, 3, C] (either may be null) -> grad_table, overwritten.
// Levels are spread over the threads, so that no two threads write one entry: no atomics, and the same bits each time.
template <class T>
SPLITNERF_API void hash_encode_backward(const HashGridShape& shape, int n_active, int64_t n, const T* positions,
                                        const T* grad_features, const T* grad_jacobian, T* grad_table);
template <class T>
SPLITNERF_API void hash_encode_backward_positions(const HashGridShape& shape, int n_active, int64_t n,
                                                  const T* positions, HashTable table, const T* grad_features,
                                                  const T* grad_jacobian, T* grad_positions);

// ---- shading; lut: brdf_lut()'s layout ----

template <class T>
SPLITNERF_API void query_direction(const float* lut, bool mean, int64_t n, const T* normals, const T* view_dirs,
                                   const T* roughness, T* directions);
template <class T>
SPLITNERF_API void query_direction_backward(const float* lut, bool mean, int64_t n, const T* normals,
                                            const T* view_dirs, const T* roughness, const T* grad_directions,
                                            T* grad_normals, T* grad_view_dirs, T* grad_roughness);

// The fields of ShadePoint as arrays; occlusion factors are [n, n_channels] with n_channels 1 or 3.
template <class T>
SPLITNERF_API void split_sum_shade(const float* lut, ShadeOptions options, int64_t n, int n_channels,
                                   const ShadeArrays<const T>& in, T* radiance);
template <class T>
SPLITNERF_API void split_sum_shade_backward(const float* lut, ShadeOptions options, int64_t n, int n_channels,
                                            const ShadeArrays<const T>& in, const T* grad_radiance,
                                            const ShadeArrays<T>& grad);

// ---- pre-integrated light ----

// query_dirs [s, 3], roughness [s], light_dirs [n, 3], light [n, 3] -> gbar [s, 3], total [s] (sum of
// the weights, for the backward pass). Memory O(s + n).
template <class T>
SPLITNERF_API void prefilter_light(int64_t n_queries, const T* query_dirs, const T* roughness, int64_t n_lights,
                                   const T* light_dirs, const T* light, T* gbar, T* total);
template <class T>
SPLITNERF_API void prefilter_light_backward(int64_t n_queries, const T* query_dirs, const T* roughness, const T* total,
                                            const T* grad_gbar, int64_t n_lights, const T* light_dirs, T* grad_light);

// axes [n, 3], roughness [n] -> directions [n, n_samples, 3] with density proportional to D(w)(w.axis)+: the
// mean of the light over them is gbar without weights. A shifted Fibonacci lattice for each axis.
template <class T>
SPLITNERF_API void sample_ggx_lobe(int64_t n, const T* axes, const T* roughness, int n_samples, uint32_t seed,
                                   T* directions);

// products [n_rows, 3] = matrix . values [n_columns, 3].
template <class T>
SPLITNERF_API void sparse_product(const SparseRows<T>& matrix, int64_t n_rows, int64_t n_columns, const T* values,
                                  T* products);

// directions [n, 3], roughness [n] -> radiance [n, 3].
template <class T>
SPLITNERF_API void light_lookup(const LightPyramid<T>& pyramid, int64_t n, const T* directions, const T* roughness,
                                T* radiance);
// grad_levels and grad_sh are overwritten. Points are summed in chunks that depend on n alone, each
// into a copy of the two: at most kLightChunks copies, and the same bits on any number of threads.
inline constexpr int kLightChunks = 8;
template <class T>
SPLITNERF_API void light_lookup_backward(const LightPyramid<T>& pyramid, int64_t n, const T* directions,
                                         const T* roughness, const T* grad_radiance, T* grad_directions,
                                         T* grad_roughness, T* grad_levels, T* grad_sh);

// ---- Monte Carlo shading, k = n_samples directions a point ----

// normals, view_dirs [n, 3], roughness [n] -> directions [n, k, 3], pdf [n, k], 0 below the horizon.
template <class T>
SPLITNERF_API void sample_bsdf(int64_t n, const T* normals, const T* view_dirs, const T* roughness, int n_samples,
                               uint32_t seed, T* directions, T* pdf);
// light_dirs [n, k, 3], pdf [n, k], radiance [n, k, 3] -> sums [n, 3 (all, grazing, diffuse), 3].
template <class T>
SPLITNERF_API void monte_carlo_light(int64_t n, int n_samples, const T* normals, const T* view_dirs, const T* roughness,
                                     const T* light_dirs, const T* pdf, const T* radiance, T* sums);
template <class T>
SPLITNERF_API void monte_carlo_light_backward(int64_t n, int n_samples, const T* normals, const T* view_dirs,
                                              const T* roughness, const T* light_dirs, const T* pdf, const T* radiance,
                                              const T* grad_sums, T* grad_normals, T* grad_roughness, T* grad_radiance);

template <class T>
SPLITNERF_API void summed_light(int64_t n, const T* normals, const T* view_dirs, const T* roughness,
                                const SharedLight<T>& light, T* sums);
template <class T>
SPLITNERF_API void summed_light_backward(int64_t n, const T* normals, const T* view_dirs, const T* roughness,
                                         const SharedLight<T>& light, const T* grad_sums, T* grad_normals,
                                         T* grad_roughness, T* grad_light);

template <class T>
SPLITNERF_API void shade_sums(const float* lut, bool compensate, int64_t n, const SummedArrays<const T>& in,
                              T* radiance);
template <class T>
SPLITNERF_API void shade_sums_backward(const float* lut, bool compensate, int64_t n, const SummedArrays<const T>& in,
                                       const T* grad_radiance, const SummedArrays<T>& grad);

// ---- losses, with their gradients ----

// The sRGB curve, elementwise.
template <class T> SPLITNERF_API void linear_to_srgb(int64_t n, const T* linear, T* srgb);
template <class T>
SPLITNERF_API void linear_to_srgb_backward(int64_t n, const T* linear, const T* grad_srgb, T* grad_linear);
template <class T> SPLITNERF_API void srgb_to_linear(int64_t n, const T* srgb, T* linear);

// mean, background [n, 3], opacity [n], target [n, 4] -> losses [2]: colour and mask, means over the values and the rays.
template <class T>
SPLITNERF_API void pixel_losses(int64_t n, const T* mean, const T* opacity, const T* target, const T* background,
                                bool linear, T* losses, T* colour_by_mean, T* colour_by_opacity, T* mask_by_opacity);
// gradients [n, 3], the last m of which stand beside those at beside [m], weights [n_weights] of the first ones -> losses [2]: eikonal,
// smoothness; their gradients [n, 3] each.
template <class T>
SPLITNERF_API void gradient_losses(int64_t n, int64_t n_weights, int64_t m, const T* gradients, const T* weights,
                                   const int64_t* beside, T* losses, T* eikonal_by, T* smoothness_by);
// albedo [n, 3], metallic, shares [n] -> losses [3]: metal, binary, dark, means by the shares; by_metallic [3, n].
template <class T>
SPLITNERF_API void material_losses(int64_t n, const T* albedo, const T* metallic, const T* shares, bool smooth_l1,
                                   T* losses, T* by_metallic);

// x [n, n_channels], n > 0 -> its quadratic entropy and the gradient [n, n_channels] of that.
template <class T>
SPLITNERF_API void quadratic_entropy(int64_t n, int64_t n_channels, const T* x, T* entropy, T* gradient);

// ---- rays ----

// blocks [blocks_along(resolution)^3]: those of the cells [resolution^3] that hold one that is not empty.
SPLITNERF_API void occupied_blocks(const uint8_t* cells, int resolution, uint8_t* blocks);
// jitter [n_rays] in [0, 1). offsets [n_rays + 1] is filled with the exclusive sum of the counts.
template <class T>
SPLITNERF_API void march_rays_count(const MarchOptions& options, const OccupancyView& grid, int64_t n_rays,
                                    const T* rays_o, const T* rays_d, const T* jitter, int64_t* offsets);
template <class T>
SPLITNERF_API void march_rays_fill(const MarchOptions& options, const OccupancyView& grid, int64_t n_rays,
                                   const T* rays_o, const T* rays_d, const T* jitter, const int64_t* offsets,
                                   int64_t* ray_indices, T* t_starts, T* t_ends);

// positions [n, 3] -> values [n], scene units.
template <class T> SPLITNERF_API void sdf_values(const SdfField<T>& field, int64_t n, const T* positions, T* values);

// positions [n, 3], features [n, C], jacobian [n, 3, C] of the hash grid -> outputs [n, n_outputs], gradient [n, 3].
template <class T>
SPLITNERF_API void sdf_layer(const SdfWeights<T>& weights, int64_t n, const T* positions, const T* features,
                             const T* jacobian, T* outputs, T* gradient);
// grads of the weights in their own shapes, all overwritten.
template <class T>
SPLITNERF_API void sdf_layer_backward(const SdfWeights<T>& weights, int64_t n, const T* positions, const T* features,
                                      const T* jacobian, const T* grad_outputs, const T* grad_gradient,
                                      T* grad_features, T* grad_jacobian, T* grad_hidden, T* grad_hidden_bias,
                                      T* grad_out, T* grad_out_bias);

// Follows each ray through the occupied cells and asks for the distance on the way, see ray_walk.h. offsets [n_rays + 1];
// n_evaluated [n_rays]: points at which the distance was asked for; allocate(n) makes room for the n samples that are kept.
template <class T>
SPLITNERF_API void sample_rays(const SdfField<T>& field, const MarchOptions& march, const OccupancyView& grid,
                               const SampleRules<T>& rules, int64_t n_rays, const T* rays_o, const T* rays_d,
                               const T* jitter, int64_t* offsets, int64_t* n_evaluated,
                               const SampleAllocator<T>& allocate);

// normals [n, 3], weights [n], opacity [n_rays].
template <class T>
SPLITNERF_API void surface_weights(const SurfaceSamples<T>& samples, T* normals, T* weights, T* opacity);
// grad_sdf [n], grad_gradient [n, 3], grad_s_rays [n_rays]: each ray's share of the gradient to s.
template <class T>
SPLITNERF_API void surface_weights_backward(const SurfaceSamples<T>& samples, const T* weights, const T* grad_normals,
                                            const T* grad_weights, const T* grad_opacity, T* grad_sdf, T* grad_gradient,
                                            T* grad_s_rays);

// Which samples are shaded, `per_ray` of each ray spread by weight (0: all), and where the others lie between them. What is
// more than `gap` apart along the ray is drawn for and interpolated on its own.
// weights [n], t [n] along the ray, phase [n_rays] -> sizes [3] of SpreadSizes as counted, first, second, share [n] and what
// the allocator makes room for, see Spread; where there is more room, entries in range that count for nothing. With too little
// of it sizes tells, and the rest means nothing, but is in range.
template <class T>
SPLITNERF_API void spread_samples(const PackedRays& rays, const T* weights, const T* t, const T* phase, T gap,
                                  int per_ray, int64_t* sizes, int64_t* first, int64_t* second, T* share,
                                  const SpreadAllocator& allocator);
// values [m, c] -> [n, c], between the first and the second neighbour.
template <class T>
SPLITNERF_API void interpolate(int64_t n, int64_t m, int64_t n_channels, const int64_t* first, const int64_t* second,
                               const T* share, const T* values, T* interpolated);
// grad_interpolated [n, c] -> grad_values [m, c], overwritten.
template <class T>
SPLITNERF_API void interpolate_backward(int64_t n, int64_t m, int64_t n_channels, const int64_t* first,
                                        const int64_t* second, const T* share, const T* grad_interpolated,
                                        T* grad_values);

// f_prev, f_next [n], s one number -> weights [n], opacity [n_rays].
template <class T>
SPLITNERF_API void neus_weights(const PackedRays& rays, const T* f_prev, const T* f_next, const T* s,
                                T min_transmittance, T* weights, T* opacity);
// grad_s_rays [n_rays]: each ray's share of the gradient to s.
template <class T>
SPLITNERF_API void neus_weights_backward(const PackedRays& rays, const T* f_prev, const T* f_next, const T* s,
                                         T min_transmittance, const T* weights, const T* grad_weights,
                                         const T* grad_opacity, T* grad_f_prev, T* grad_f_next, T* grad_s_rays);

// weights [n], values [n, c] -> sums [n_rays, c].
template <class T>
SPLITNERF_API void composite(const PackedRays& rays, int64_t n_channels, const T* weights, const T* values, T* sums);
template <class T>
SPLITNERF_API void composite_backward(const PackedRays& rays, int64_t n_channels, const T* weights, const T* values,
                                      const T* grad_sums, T* grad_weights, T* grad_values);

// ---- occlusion ----

// positions, normals, lobe_dirs [n, 3], roughness [n], environment [height, width, 3] (radiance at
// rho = 0, equirectangular) -> occlusion_d, occlusion_s [n, 3]. Each thread holds one point's rays.
template <class T>
SPLITNERF_API void occlusion_factors(const Scene& scene, const OcclusionOptions& options, int64_t n, const T* positions,
                                     const T* normals, const T* lobe_dirs, const T* roughness, int height, int width,
                                     const T* environment, T* occlusion_d, T* occlusion_s);

// ---- visibility bits cached on a mesh ----

// positions (vertices of the scene's mesh), normals [n, 3], directions [n_directions, 3], n_directions a multiple of 32
// -> bits [n, 2, n_directions / 32] of the rays above each vertex's horizon that start `offset` along its normal: a
// bit in the first row for an open direction, in the second for a blocked one, in neither below the horizon; hits
// [n, n_directions] (may be null): the vertex with the largest barycentric weight of the triangle hit, -1 where the
// direction is not blocked.
SPLITNERF_API void visibility_bits(const Scene& scene, int64_t n, const float* positions, const float* normals,
                                   int64_t n_directions, const float* directions, float offset, uint32_t* bits,
                                   int32_t* hits);

// Fills starts and order of the grids, see VertexGrids.
template <class T>
SPLITNERF_API void build_vertex_grids(int64_t n_vertices, const T* vertices, T radius, int n_levels, int64_t n_buckets,
                                      int32_t* starts, int32_t* order);

// positions, normals, lobe_dirs [n, 3], roughness [n] -> occlusion_d, occlusion_s, and with hits indirect_d and
// indirect_s, [n, 3] each. Numbers that are not finite make NaN.
template <class T>
SPLITNERF_API void cached_occlusion(const VisibilityCache<T>& cache, int64_t n, const T* positions, const T* normals,
                                    const T* lobe_dirs, const T* roughness, T* occlusion_d, T* occlusion_s,
                                    T* indirect_d, T* indirect_s);

// positions, normals [n, 3] -> visible [n, n_directions], and with hits arriving [n, n_directions, 3], what comes from
// the mesh itself. The cache's light is not read. Numbers that are not finite make NaN.
template <class T>
SPLITNERF_API void cached_visibility(const VisibilityCache<T>& cache, int64_t n, const T* positions, const T* normals,
                                     T* visible, T* arriving);

// ---- the optimiser ----

template <class T> SPLITNERF_API void adamw_step(const AdamwRule<T>& rule, const AdamwArrays<T>& x);

}  // namespace splitnerf::cpu
