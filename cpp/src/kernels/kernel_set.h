// Declares the kernels inside the namespace of the instruction set that this file is compiled for.
#pragma once

#include "splitnerf/kernels.h"

#ifndef SPLITNERF_ISA
#define SPLITNERF_ISA base
#endif

namespace splitnerf::SPLITNERF_ISA {

template <class T> void hash_encode(const HashEncodeArgs<T>&, int64_t, int64_t, T*, T*);
template <class T> void hash_scatter(const HashEncodeArgs<T>&, int, const T*, T*);
template <class T> void hash_scatter_along(const HashEncodeArgs<T>&, int, const LevelPlanes<const T>&, const T*, T*);
template <class T> void sdf_values(const SdfNetwork<T>&, int64_t, const T*, T*, T*);
template <class T> void sdf_layer(const SdfLayer<T>&, const SdfPoints<T>&, T*, T*, T*);
template <class T>
void sdf_layer_backward(const SdfLayer<T>&, const SdfPoints<T>&, const SdfOutputs<const T>&, T*, const LevelPlanes<T>&,
                        const SdfLayerGrad<T>&);
template <class T> void pair_likeness(int64_t, int64_t, const T*, int64_t, T*, T*);
template <class T> void lobe_gather(const LobeSide<T>&, const LobeSide<T>&, int64_t, int64_t, T*);
template <class T> void lobe_scatter(const LobeSide<T>&, const LobeSide<T>&, int64_t, int64_t, T*);
template <class T> void visibility_horizon(const LobeSide<T>&, const T*, T*, uint32_t*);
template <class T> void visibility_shares(int64_t, const VisibilityPoint<T>&, T*, T*);
template <class T> void visibility_sums(const LobeSide<T>&, const VisibilityLobe<T>&, const T*, T*, T*);
template <class T> void fan_directions(const RayFan<T>&, float*, float*, float*, int32_t*);
template <class T>
void fan_light(const T*, int, int, int64_t, const float*, const float*, const float*, const int32_t*, const int32_t*,
               T*);
template <class T>
void split_sum_shade(const float*, ShadeOptions, int64_t, int64_t, int, const ShadeArrays<const T>&, T*);
template <class T>
void split_sum_shade_backward(const float*, ShadeOptions, int64_t, int64_t, int, const ShadeArrays<const T>&, const T*,
                              const ShadeArrays<T>&);
template <class T> void light_lookup(const LightPyramid<T>&, int64_t, int64_t, const T*, const T*, T*);
template <class T>
void light_lookup_backward(const LightPyramid<T>&, int64_t, int64_t, const T*, const T*, const T*, T*, T*, T*, T*);
template <class T> bool sparse_product(const SparseRows<T>&, const T*, int64_t, int64_t, T*);
template <class T> void adamw_step(const AdamwRule<T>&, const AdamwArrays<T>&, int64_t, int64_t);

Kernels<float> kernels_float32();
Kernels<double> kernels_float64();

}  // namespace splitnerf::SPLITNERF_ISA
