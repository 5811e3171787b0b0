#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"

namespace splitnerf::cpu {
namespace {

constexpr int64_t kGrain = 1024;

// Occlusion factors come as one value for all channels or as three.
template <class T> Vec3<T> load_factor(const T* p, int64_t i, int n_channels) {
  return n_channels == 3 ? load3(p + 3 * i) : Vec3<T>{p[i], p[i], p[i]};
}
template <class T> void store_factor(T* p, int64_t i, int n_channels, Vec3<T> v) {
  if (n_channels == 3) {
    store3(p + 3 * i, v);
  } else {
    p[i] = sum(v);
  }
}

template <class T> ShadePoint<T> load_point(const ShadeArrays<const T>& in, int64_t i, int n_channels) {
  return {load3(in.normals + 3 * i),
          load3(in.view_dirs + 3 * i),
          load3(in.albedo + 3 * i),
          in.roughness[i],
          in.metallic[i],
          load3(in.specular + 3 * i),
          load3(in.diffuse + 3 * i),
          load_factor(in.occlusion_s, i, n_channels),
          load_factor(in.occlusion_d, i, n_channels)};
}

}  // namespace

template <class T>
void query_direction(const float* lut, bool mean, int64_t n, const T* normals, const T* view_dirs, const T* roughness,
                     T* directions) {
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i)
      store3(directions + 3 * i,
             splitnerf::query_direction(lut, mean, load3(normals + 3 * i), load3(view_dirs + 3 * i), roughness[i]));
  });
}

template <class T>
void query_direction_backward(const float* lut, bool mean, int64_t n, const T* normals, const T* view_dirs,
                              const T* roughness, const T* grad_directions, T* grad_normals, T* grad_view_dirs,
                              T* grad_roughness) {
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const QueryDirectionGrad<T> g = splitnerf::query_direction_backward(
          lut, mean, load3(normals + 3 * i), load3(view_dirs + 3 * i), roughness[i], load3(grad_directions + 3 * i));
      store3(grad_normals + 3 * i, g.normal);
      store3(grad_view_dirs + 3 * i, g.view);
      grad_roughness[i] = g.roughness;
    }
  });
}

template <class T>
void split_sum_shade(const float* lut, ShadeOptions options, int64_t n, int n_channels, const ShadeArrays<const T>& in,
                     T* radiance) {
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i)
      store3(radiance + 3 * i, splitnerf::split_sum_shade(lut, options, load_point(in, i, n_channels)));
  });
}

template <class T>
void split_sum_shade_backward(const float* lut, ShadeOptions options, int64_t n, int n_channels,
                              const ShadeArrays<const T>& in, const T* grad_radiance, const ShadeArrays<T>& grad) {
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const ShadePoint<T> g = splitnerf::split_sum_shade_backward(lut, options, load_point(in, i, n_channels),
                                                                  load3(grad_radiance + 3 * i));
      store3(grad.normals + 3 * i, g.normal);
      store3(grad.view_dirs + 3 * i, g.view);
      store3(grad.albedo + 3 * i, g.albedo);
      grad.roughness[i] = g.roughness;
      grad.metallic[i] = g.metallic;
      store3(grad.specular + 3 * i, g.specular);
      store3(grad.diffuse + 3 * i, g.diffuse);
      store_factor(grad.occlusion_s, i, n_channels, g.occlusion_s);
      store_factor(grad.occlusion_d, i, n_channels, g.occlusion_d);
    }
  });
}

#define SPLITNERF_INSTANTIATE(T)                                                                                     \
  template void query_direction<T>(const float*, bool, int64_t, const T*, const T*, const T*, T*);                   \
  template void query_direction_backward<T>(const float*, bool, int64_t, const T*, const T*, const T*, const T*, T*, \
                                            T*, T*);                                                                 \
  template void split_sum_shade<T>(const float*, ShadeOptions, int64_t, int, const ShadeArrays<const T>&, T*);       \
  template void split_sum_shade_backward<T>(const float*, ShadeOptions, int64_t, int, const ShadeArrays<const T>&,   \
                                            const T*, const ShadeArrays<T>&);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cpu
