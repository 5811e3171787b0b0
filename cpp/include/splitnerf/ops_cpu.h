// What the CPU has code of its own for, over plain arrays: operators that are more than one body, and bodies for which it has
// something faster than their plain loop (run.h). All other operators are bodies and nothing else.
// All arrays are dense and row-major; T is float or double. Threads come from parallel.h.
#pragma once

#include <cstdint>

#include "splitnerf/bodies/adamw.h"
#include "splitnerf/bodies/light_pyramid.h"
#include "splitnerf/bodies/losses.h"
#include "splitnerf/bodies/monte_carlo.h"
#include "splitnerf/bodies/rays.h"
#include "splitnerf/bodies/shading.h"
#include "splitnerf/bodies/visibility_cache.h"
#include "splitnerf/hash_grid.h"
#include "splitnerf/occlusion.h"
#include "splitnerf/ray_walk.h"
#include "splitnerf/run.h"
#include "splitnerf/scene.h"
#include "splitnerf/sdf_layer.h"
#include "splitnerf/varying_outputs.h"

namespace splitnerf::cpu {

// ---- hash grid. C = n_levels * n_features; columns of closed levels are written as 0. ----

// positions [n, 3], table [n_entries, n_features] of T or of 16 bits -> features [n, C].
template <class T>
SPLITNERF_API void hash_encode(const HashGridShape& shape, int n_active, int64_t n, const T* positions, HashTable table,
                               T* features);
// grad_features [n, C] -> grad_table, overwritten.
// Levels are spread over the threads, so that no two threads write one entry: no atomics, and the same bits each time.
template <class T>
SPLITNERF_API void hash_encode_backward(const HashGridShape& shape, int n_active, int64_t n, const T* positions,
                                        const T* grad_features, T* grad_table);
template <class T>
SPLITNERF_API void hash_encode_backward_positions(const HashGridShape& shape, int n_active, int64_t n,
                                                  const T* positions, HashTable table, const T* grad_features,
                                                  T* grad_positions);

// ---- pre-integrated light ----

// query_dirs [s, 3], roughness [s], light_dirs [n, 3], light [n, 3] -> gbar [s, 3], total [s] (sum of
// the weights, for the backward pass). Memory O(s + n).
template <class T>
SPLITNERF_API void prefilter_light(int64_t n_queries, const T* query_dirs, const T* roughness, int64_t n_lights,
                                   const T* light_dirs, const T* light, T* gbar, T* total);
template <class T>
SPLITNERF_API void prefilter_light_backward(int64_t n_queries, const T* query_dirs, const T* roughness, const T* total,
                                            const T* grad_gbar, int64_t n_lights, const T* light_dirs, T* grad_light);

// directions [n, 3], roughness [n]: the adjoint of LightLookupBody. grad_levels and grad_sh are overwritten. Points are summed
// in chunks that depend on n alone, each into a copy of the two: at most kLightChunks copies, and the same bits on any number of
// threads.
inline constexpr int kLightChunks = 8;
template <class T>
SPLITNERF_API void light_lookup_backward(const LightPyramid<T>& pyramid, int64_t n, const T* directions,
                                         const T* roughness, const T* grad_radiance, T* grad_directions,
                                         T* grad_roughness, T* grad_levels, T* grad_sh);

// ---- rays ----

// positions [n, 3] -> values [n], scene units.
template <class T> SPLITNERF_API void sdf_values(const SdfField<T>& field, int64_t n, const T* positions, T* values);

// The field at positions [n, 3], scene units.
template <class T>
SPLITNERF_API void sdf_field(const SdfField<T>& field, int64_t n, const T* positions, const SdfOutputs<T>& to);
// Its adjoint, which evaluates the field again; overwrites all of grad. Work memory 2 n C numbers. Points are summed in an order
// that depends on n alone: the same bits on any number of threads.
template <class T>
SPLITNERF_API void sdf_field_backward(const SdfField<T>& field, int64_t n, const T* positions,
                                      const SdfOutputs<const T>& given, const SdfFieldGrad<T>& grad);

// Follows each ray through the occupied cells and asks for the distance on the way, see ray_walk.h. offsets [n_rays + 1];
// n_evaluated [n_rays]: points at which the distance was asked for; allocate(n) returns arrays for the n samples that are kept.
template <class T>
SPLITNERF_API void sample_rays(const SdfField<T>& field, const MarchOptions& march, const OccupancyView& grid,
                               const SampleRules<T>& rules, int64_t n_rays, const T* rays_o, const T* rays_d,
                               const T* jitter, int64_t capacity, int64_t* offsets, int64_t* n_evaluated,
                               int64_t* n_found, const SampleAllocator<T>& allocate);

// Which samples are shaded, `per_ray` of each ray spread by weight (0: all), and where the others lie between them. What is
// more than `gap` apart along the ray is drawn for and interpolated on its own.
// in: weights [n], t [n] along the ray, phase [n_rays] -> sizes [3] of SpreadSizes as counted, first, second, share [n] and what
// the allocator provides, see Spread; with more capacity, entries in range that count for nothing. With too little
// of it sizes tells, and the rest means nothing, but is in range.
template <class T>
SPLITNERF_API void spread_samples(const SpreadArrays<T>& in, int64_t* sizes, int64_t* first, int64_t* second, T* share,
                                  const SpreadAllocator& allocator);

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

// The body for n points; overwrites receive.grad_light with the sum over all of them. Points are summed in chunks that depend on
// n alone: the same bits on any number of threads.
template <class T> SPLITNERF_API void shared_light_backward(int64_t n, const SharedLightBackwardBody<T>& body);

// ---- bodies that run faster here than by their plain loop; the ratio stands in the file of each ----

template <class T> SPLITNERF_API void run(int64_t n, const AdamwListBody<T>& body);
template <class T> SPLITNERF_API void run(int64_t n, const CachedOcclusionBody<T>& body);
template <class T> SPLITNERF_API void run(int64_t n, const CachedVisibilityBody<T>& body);
template <class T> SPLITNERF_API void run(int64_t n, const LightLookupBody<T>& body);
template <class T> SPLITNERF_API void run(int64_t n, const PairLikenessBody<T>& body);
// Throws std::invalid_argument where a column is out of range.
template <class T> SPLITNERF_API void run(int64_t n, const SparseProductBody<T>& body);
template <class T> SPLITNERF_API void run(int64_t n, const ShadeBody<T>& body);
template <class T> SPLITNERF_API void run(int64_t n, const ShadeBackwardBody<T>& body);
// The cells in the order of memory: 22 x the body block by block (64^3 cells; one thread of an AMD EPYC of family 25).
inline void run(int64_t, const OccupiedBlocksBody& body) {
  find_occupied_blocks(body.cells, body.resolution, body.blocks);
}

}  // namespace splitnerf::cpu
