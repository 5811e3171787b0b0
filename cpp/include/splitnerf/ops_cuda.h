// What the GPU has kernels of its own for, over plain arrays in its memory: launchers that put kernels into a stream and return
// at once. Arguments as in ops_cpu.h. A launch that fails throws std::runtime_error. "Adds atomically": in any order, so that the
// last bits may differ from call to call.
#pragma once

#include "splitnerf/bodies/monte_carlo.h"
#include "splitnerf/bodies/rays.h"
#include "splitnerf/light_pyramid.h"
#include "splitnerf/hash_grid.h"
#include "splitnerf/neus.h"
#include "splitnerf/ray_walk.h"
#include "splitnerf/run_cuda.h"
#include "splitnerf/sdf_layer.h"
#include "splitnerf/varying_outputs.h"

namespace splitnerf::cuda {

// ---- hash grid; the backward pass adds atomically ----

template <class T>
void hash_encode(const Queue& queue, const HashGridShape& shape, int n_active, int64_t n, const T* positions,
                 HashTable table, T* features);
template <class T>
void hash_encode_backward(const Queue& queue, const HashGridShape& shape, int n_active, int64_t n, const T* positions,
                          const T* grad_features, T* grad_table);
template <class T>
void hash_encode_backward_positions(const Queue& queue, const HashGridShape& shape, int n_active, int64_t n,
                                    const T* positions, HashTable table, const T* grad_features, T* grad_positions);

// ---- pre-integrated light; the backward pass of light_lookup adds atomically ----

template <class T>
void prefilter_light(const Queue& queue, int64_t n_queries, const T* query_dirs, const T* roughness, int64_t n_lights,
                     const T* light_dirs, const T* light, T* gbar, T* total);
template <class T>
void prefilter_light_backward(const Queue& queue, int64_t n_queries, const T* query_dirs, const T* roughness,
                              const T* total, const T* grad_gbar, int64_t n_lights, const T* light_dirs, T* grad_light);
template <class T>
void light_lookup_backward(const Queue& queue, const LightPyramid<T>& pyramid, int64_t n, const T* directions,
                           const T* roughness, const T* grad_radiance, T* grad_directions, T* grad_roughness,
                           T* grad_levels, T* grad_sh);

// ---- light that all points share ----

// The body for n points; overwrites receive.grad_light with the sum over all of them, in an order that depends on n alone.
// Throws std::invalid_argument where a copy of it does not fit into a block's shared memory.
template <class T> void shared_light_backward(const Queue& queue, int64_t n, const SharedLightBackwardBody<T>& body);

// ---- rays. Offsets are not looked at: numbers out of range count as the nearest in it ----

// Waits for the sizes, but where they are fixed.
template <class T>
void spread_samples(const Queue& queue, const SpreadArrays<T>& in, int64_t* sizes, int64_t* first, int64_t* second,
                    T* share, const SpreadAllocator& allocator);

// ---- the distance field ----

template <class T>
void sdf_values(const Queue& queue, const SdfField<T>& field, int64_t n, const T* positions, T* values);
template <class T>
void sdf_field(const Queue& queue, const SdfField<T>& field, int64_t n, const T* positions, const SdfOutputs<T>& to);
// The gradient to the table is added atomically.
template <class T>
void sdf_field_backward(const Queue& queue, const SdfField<T>& field, int64_t n, const T* positions,
                        const SdfOutputs<const T>& given, const SdfFieldGrad<T>& grad);

// ---- samples of rays through the distance field ----

// Waits for the number of samples; work memory for as many as a ray can have.
template <class T>
void sample_rays(const Queue& queue, const SdfField<T>& field, const MarchOptions& march, const OccupancyView& cells,
                 const SampleRules<T>& rules, int64_t n_rays, const T* rays_o, const T* rays_d, const T* jitter,
                 int64_t capacity, int64_t* offsets, int64_t* n_evaluated, int64_t* n_found,
                 const SampleAllocator<T>& allocate);

}  // namespace splitnerf::cuda
