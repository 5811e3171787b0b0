// The operators on the GPU over plain arrays in its memory: launchers that put kernels into a stream and return at once.
// Arguments as in ops_cpu.h. A launch that fails throws std::runtime_error. "Adds atomically": in any order, so that the last
// bits may differ from call to call.
#pragma once

#include <cstdint>

#include "splitnerf/ops_cpu.h"

using cudaStream_t = struct CUstream_st*;

namespace splitnerf::cuda {

// Where kernels are put, and where their work memory comes from: allocate(context, bytes) is usable by them until the
// stream has run what follows in it.
struct Queue {
  cudaStream_t stream;
  void* (*allocate)(void* context, int64_t bytes);
  void* context;

  template <class T> T* scratch(int64_t n) const { return static_cast<T*>(allocate(context, n * sizeof(T))); }
};

// Makes a GPU the current one of this library's own copy of the CUDA runtime.
void use_device(int device);

// A number in the GPU's memory; waits for the stream.
int64_t read_number(const Queue& queue, const int64_t* number);

// ---- hash grid; the backward pass adds atomically ----

template <class T>
void hash_encode(const Queue& queue, const HashGridShape& shape, int n_active, int64_t n, const T* positions,
                 HashTable table, T* features, T* jacobian);
template <class T>
void hash_encode_backward(const Queue& queue, const HashGridShape& shape, int n_active, int64_t n, const T* positions,
                          const T* grad_features, const T* grad_jacobian, T* grad_table);
template <class T>
void hash_encode_backward_positions(const Queue& queue, const HashGridShape& shape, int n_active, int64_t n,
                                    const T* positions, HashTable table, const T* grad_features, const T* grad_jacobian,
                                    T* grad_positions);

// ---- shading ----

template <class T>
void query_direction(const Queue& queue, const float* lut, bool mean, int64_t n, const T* normals, const T* view_dirs,
                     const T* roughness, T* directions);
template <class T>
void query_direction_backward(const Queue& queue, const float* lut, bool mean, int64_t n, const T* normals,
                              const T* view_dirs, const T* roughness, const T* grad_directions, T* grad_normals,
                              T* grad_view_dirs, T* grad_roughness);
template <class T>
void split_sum_shade(const Queue& queue, const float* lut, ShadeOptions options, int64_t n, int n_channels,
                     const ShadeArrays<const T>& in, T* radiance);
template <class T>
void split_sum_shade_backward(const Queue& queue, const float* lut, ShadeOptions options, int64_t n, int n_channels,
                              const ShadeArrays<const T>& in, const T* grad_radiance, const ShadeArrays<T>& grad);

// ---- pre-integrated light; the backward pass of light_lookup adds atomically ----

template <class T>
void prefilter_light(const Queue& queue, int64_t n_queries, const T* query_dirs, const T* roughness, int64_t n_lights,
                     const T* light_dirs, const T* light, T* gbar, T* total);
template <class T>
void prefilter_light_backward(const Queue& queue, int64_t n_queries, const T* query_dirs, const T* roughness,
                              const T* total, const T* grad_gbar, int64_t n_lights, const T* light_dirs, T* grad_light);
template <class T>
void sample_ggx_lobe(const Queue& queue, int64_t n, const T* axes, const T* roughness, int n_samples, uint32_t seed,
                     T* directions);
template <class T>
void sparse_product(const Queue& queue, const SparseRows<T>& matrix, int64_t n_rows, int64_t n_columns, const T* values,
                    T* products);
template <class T>
void light_lookup(const Queue& queue, const LightPyramid<T>& pyramid, int64_t n, const T* directions,
                  const T* roughness, T* radiance);
template <class T>
void light_lookup_backward(const Queue& queue, const LightPyramid<T>& pyramid, int64_t n, const T* directions,
                           const T* roughness, const T* grad_radiance, T* grad_directions, T* grad_roughness,
                           T* grad_levels, T* grad_sh);

// ---- Monte Carlo shading; the backward pass of summed_light adds atomically ----

template <class T>
void sample_bsdf(const Queue& queue, int64_t n, const T* normals, const T* view_dirs, const T* roughness, int n_samples,
                 uint32_t seed, T* directions, T* pdf);
template <class T>
void monte_carlo_light(const Queue& queue, int64_t n, int n_samples, const T* normals, const T* view_dirs,
                       const T* roughness, const T* light_dirs, const T* pdf, const T* radiance, T* sums);
template <class T>
void monte_carlo_light_backward(const Queue& queue, int64_t n, int n_samples, const T* normals, const T* view_dirs,
                                const T* roughness, const T* light_dirs, const T* pdf, const T* radiance,
                                const T* grad_sums, T* grad_normals, T* grad_roughness, T* grad_radiance);
template <class T>
void summed_light(const Queue& queue, int64_t n, const T* normals, const T* view_dirs, const T* roughness,
                  const SharedLight<T>& light, T* sums);
template <class T>
void summed_light_backward(const Queue& queue, int64_t n, const T* normals, const T* view_dirs, const T* roughness,
                           const SharedLight<T>& light, const T* grad_sums, T* grad_normals, T* grad_roughness,
                           T* grad_light);
template <class T>
void shade_sums(const Queue& queue, const float* lut, bool compensate, int64_t n, const SummedArrays<const T>& in,
                T* radiance);
template <class T>
void shade_sums_backward(const Queue& queue, const float* lut, bool compensate, int64_t n,
                         const SummedArrays<const T>& in, const T* grad_radiance, const SummedArrays<T>& grad);

// ---- losses; gradient_losses adds atomically ----

template <class T> void linear_to_srgb(const Queue& queue, int64_t n, const T* linear, T* srgb);
template <class T>
void linear_to_srgb_backward(const Queue& queue, int64_t n, const T* linear, const T* grad_srgb, T* grad_linear);
template <class T> void srgb_to_linear(const Queue& queue, int64_t n, const T* srgb, T* linear);
template <class T>
void pixel_losses(const Queue& queue, int64_t n, const T* mean, const T* opacity, const T* target, const T* background,
                  bool linear, T* losses, T* colour_by_mean, T* colour_by_opacity, T* mask_by_opacity);
template <class T>
void gradient_losses(const Queue& queue, int64_t n, int64_t n_weights, int64_t m, const T* gradients, const T* weights,
                     const int64_t* beside, T* losses, T* eikonal_by, T* smoothness_by);
template <class T>
void quadratic_entropy(const Queue& queue, int64_t n, int64_t n_channels, const T* x, T* entropy, T* gradient);
template <class T>
void material_losses(const Queue& queue, int64_t n, const T* albedo, const T* metallic, const T* shares, bool smooth_l1,
                     T* losses, T* by_metallic);

// ---- rays; the backward pass of interpolate adds atomically. Offsets and positions are not looked at: numbers out of range count as the nearest in it ----

void occupied_blocks(const Queue& queue, const uint8_t* cells, int resolution, uint8_t* blocks);
template <class T>
void march_rays_count(const Queue& queue, const MarchOptions& options, const OccupancyView& grid, int64_t n_rays,
                      const T* rays_o, const T* rays_d, const T* jitter, int64_t* offsets);
template <class T>
void march_rays_fill(const Queue& queue, const MarchOptions& options, const OccupancyView& grid, int64_t n_rays,
                     const T* rays_o, const T* rays_d, const T* jitter, const int64_t* offsets, int64_t* ray_indices,
                     T* t_starts, T* t_ends);
template <class T>
void neus_weights(const Queue& queue, const PackedRays& rays, const T* f_prev, const T* f_next, const T* s,
                  T min_transmittance, T* weights, T* opacity);
template <class T>
void neus_weights_backward(const Queue& queue, const PackedRays& rays, const T* f_prev, const T* f_next, const T* s,
                           T min_transmittance, const T* weights, const T* grad_weights, const T* grad_opacity,
                           T* grad_f_prev, T* grad_f_next, T* grad_s_rays);
template <class T>
void surface_weights(const Queue& queue, const SurfaceSamples<T>& samples, T* normals, T* weights, T* opacity);
template <class T>
void surface_weights_backward(const Queue& queue, const SurfaceSamples<T>& samples, const T* weights,
                              const T* grad_normals, const T* grad_weights, const T* grad_opacity, T* grad_sdf,
                              T* grad_gradient, T* grad_s_rays);
template <class T>
void composite(const Queue& queue, const PackedRays& rays, int64_t n_channels, const T* weights, const T* values,
               T* sums);
template <class T>
void composite_backward(const Queue& queue, const PackedRays& rays, int64_t n_channels, const T* weights,
                        const T* values, const T* grad_sums, T* grad_weights, T* grad_values);
// Waits for the sizes, but where they are fixed.
template <class T>
void spread_samples(const Queue& queue, const PackedRays& rays, const T* weights, const T* t, const T* phase, T gap,
                    int per_ray, int64_t* sizes, int64_t* first, int64_t* second, T* share,
                    const SpreadAllocator& allocator);
template <class T>
void interpolate(const Queue& queue, int64_t n, int64_t m, int64_t n_channels, const int64_t* first,
                 const int64_t* second, const T* share, const T* values, T* interpolated);
template <class T>
void interpolate_backward(const Queue& queue, int64_t n, int64_t m, int64_t n_channels, const int64_t* first,
                          const int64_t* second, const T* share, const T* grad_interpolated, T* grad_values);

// ---- visibility bits; starts and order of the grids are taken on trust ----

template <class T>
void cached_occlusion(const Queue& queue, const VisibilityCache<T>& cache, int64_t n, const T* positions,
                      const T* normals, const T* lobe_dirs, const T* roughness, T* occlusion_d, T* occlusion_s,
                      T* indirect_d, T* indirect_s);
template <class T>
void cached_visibility(const Queue& queue, const VisibilityCache<T>& cache, int64_t n, const T* positions,
                       const T* normals, T* visible, T* arriving);

// ---- the distance field ----

template <class T>
void sdf_values(const Queue& queue, const SdfField<T>& field, int64_t n, const T* positions, T* values);
template <class T>
void sdf_layer(const Queue& queue, const SdfWeights<T>& weights, int64_t n, const T* positions, const T* features,
               const T* jacobian, T* outputs, T* gradient);
template <class T>
void sdf_layer_backward(const Queue& queue, const SdfWeights<T>& weights, int64_t n, const T* positions,
                        const T* features, const T* jacobian, const T* grad_outputs, const T* grad_gradient,
                        T* grad_features, T* grad_jacobian, T* grad_hidden, T* grad_hidden_bias, T* grad_out,
                        T* grad_out_bias);

// Waits for the number of samples; work memory for as many as a ray can have.
template <class T>
void sample_rays(const Queue& queue, const SdfField<T>& field, const MarchOptions& march, const OccupancyView& cells,
                 const SampleRules<T>& rules, int64_t n_rays, const T* rays_o, const T* rays_d, const T* jitter,
                 int64_t* offsets, int64_t* n_evaluated, const SampleAllocator<T>& allocate);

// ---- the optimiser ----

template <class T> void adamw_step(const Queue& queue, const AdamwRule<T>& rule, const AdamwArrays<T>& x);

}  // namespace splitnerf::cuda
