#include <algorithm>
#include <vector>

#include "for_each.h"
#include "splitnerf/bodies/rays.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"
#include "splitnerf/spread.h"

namespace splitnerf::cpu {
namespace {

constexpr int64_t kGrain = 64;  // rays

// The distances at both ends of a ray's samples and their difference, [0, n) of the arrays.
template <class T>
void interval_ends(const SurfaceSamples<T>& in, int64_t ray, const Vec3<T>* normals, T* f_prev, T* f_next, T* apart) {
  const Vec3<T> direction = load3(in.directions + 3 * ray);
  const int64_t first = in.rays.offsets[ray], n = in.rays.offsets[ray + 1] - first;
  for (int64_t i = 0; i < n; ++i) {
    const NeusInterval<T> ends = surface_interval(in.sdf[first + i], dot(direction, normals[i]), *in.step, *in.anneal);
    f_prev[i] = ends.f_prev, f_next[i] = ends.f_next, apart[i] = ends.apart;
  }
}

// Work memory of one ray.
template <class T> struct RayWork {
  std::vector<Vec3<T>> normals;
  std::vector<T> f_prev, f_next, apart, depths;

  void load(const SurfaceSamples<T>& in, int64_t ray) {
    const int64_t first = in.rays.offsets[ray], n = in.rays.offsets[ray + 1] - first;
    normals.resize(n), f_prev.resize(n), f_next.resize(n), apart.resize(n), depths.resize(n);
    for (int64_t i = 0; i < n; ++i) normals[i] = unit_normal(load3(in.gradient + 3 * (first + i)));
    interval_ends(in, ray, normals.data(), f_prev.data(), f_next.data(), apart.data());
  }
  NeusEnds<T> ends() const { return {f_prev.data(), f_next.data(), apart.data()}; }
};

}  // namespace

void occupied_blocks(const uint8_t* cells, int resolution, uint8_t* blocks) {
  find_occupied_blocks(cells, resolution, blocks);
}

template <class T>
void march_rays_count(const MarchOptions& options, const OccupancyView& grid, int64_t n_rays, const T* rays_o,
                      const T* rays_d, const T* jitter, int64_t* offsets) {
  for_each_alone(n_rays, kGrain, MarchCountBody<T>{options, grid, rays_o, rays_d, jitter, offsets + 1});
  offsets[0] = 0;
  for (int64_t r = 0; r < n_rays; ++r) offsets[r + 1] += offsets[r];
}

template <class T>
void march_rays_fill(const MarchOptions& options, const OccupancyView& grid, int64_t n_rays, const T* rays_o,
                     const T* rays_d, const T* jitter, const int64_t* offsets, int64_t* ray_indices, T* t_starts,
                     T* t_ends) {
  for_each_alone(n_rays, kGrain,
                 MarchFillBody<T>{options, grid, rays_o, rays_d, jitter, offsets, ray_indices, t_starts, t_ends});
}

template <class T>
void neus_weights(const PackedRays& rays, const T* f_prev, const T* f_next, const T* s, T min_transmittance, T* weights,
                  T* opacity) {
  for_each_alone(rays.n_rays, kGrain, NeusWeightsBody<T>{rays, f_prev, f_next, s, min_transmittance, weights, opacity});
}

template <class T>
void neus_weights_backward(const PackedRays& rays, const T* f_prev, const T* f_next, const T* s, T min_transmittance,
                           const T* weights, const T* grad_weights, const T* grad_opacity, T* grad_f_prev,
                           T* grad_f_next, T* grad_s_rays) {
  for_each_alone(rays.n_rays, kGrain,
                 NeusWeightsBackwardBody<T>{rays, f_prev, f_next, s, min_transmittance, weights, grad_weights,
                                            grad_opacity, grad_f_prev, grad_f_next, grad_s_rays});
}

template <class T>
void composite(const PackedRays& rays, int64_t n_channels, const T* weights, const T* values, T* sums) {
  parallel_for(rays.n_rays, kGrain, [&](int64_t begin, int64_t end) {
    std::vector<double> totals(n_channels);  // the roundings of thousands of samples would add up
    for (int64_t r = begin; r < end; ++r) {
      std::fill(totals.begin(), totals.end(), 0.0);
      for (int64_t i = rays.offsets[r]; i < rays.offsets[r + 1]; ++i)
        for (int64_t c = 0; c < n_channels; ++c) totals[c] += double(weights[i]) * double(values[i * n_channels + c]);
      for (int64_t c = 0; c < n_channels; ++c) sums[r * n_channels + c] = T(totals[c]);
    }
  });
}

template <class T>
void composite_backward(const PackedRays& rays, int64_t n_channels, const T* weights, const T* values,
                        const T* grad_sums, T* grad_weights, T* grad_values) {
  for_each_alone(rays.n_rays, kGrain,
                 CompositeBackwardBody<T>{rays, n_channels, weights, values, grad_sums, grad_weights, grad_values});
}

template <class T> void surface_weights(const SurfaceSamples<T>& in, T* normals, T* weights, T* opacity) {
  parallel_for(in.rays.n_rays, kGrain, [&](int64_t begin, int64_t end) {
    RayWork<T> work;
    for (int64_t r = begin; r < end; ++r) {
      const int64_t first = in.rays.offsets[r], n = in.rays.offsets[r + 1] - first;
      work.load(in, r);
      for (int64_t i = 0; i < n; ++i) store3(normals + 3 * (first + i), work.normals[i]);
      opacity[r] = neus_ray_weights(OneThread{}, work.ends(), *in.s, n, in.min_transmittance, weights + first);
      in.rays.for_each_unowned(OneThread{}, r, [&](int64_t i) {
        weights[i] = T(0);
        store3(normals + 3 * i, Vec3<T>{T(0), T(0), T(0)});
      });
    }
  });
}

template <class T>
void surface_weights_backward(const SurfaceSamples<T>& in, const T* weights, const T* grad_normals,
                              const T* grad_weights, const T* grad_opacity, T* grad_sdf, T* grad_gradient,
                              T* grad_s_rays) {
  parallel_for(in.rays.n_rays, kGrain, [&](int64_t begin, int64_t end) {
    RayWork<T> work;
    for (int64_t r = begin; r < end; ++r) {
      const int64_t first = in.rays.offsets[r], n = in.rays.offsets[r + 1] - first;
      const Vec3<T> direction = load3(in.directions + 3 * r);
      work.load(in, r);
      const auto keep = [&](int64_t i, const OpticalDepthGrad<T>& g) {
        const T grad_cosine = surface_interval_backward(g, dot(direction, work.normals[i]), *in.step, *in.anneal);
        grad_sdf[first + i] = g.both;
        const Vec3<T> grad_normal = load3(grad_normals + 3 * (first + i)) + direction * grad_cosine;
        store3(grad_gradient + 3 * (first + i),
               unit_normal_backward(load3(in.gradient + 3 * (first + i)), grad_normal));
      };
      grad_s_rays[r] =
          neus_ray_weights_backward(OneThread{}, work.ends(), *in.s, n, in.min_transmittance, weights + first,
                                    grad_weights + first, grad_opacity[r], work.depths.data(), keep);
      in.rays.for_each_unowned(OneThread{}, r, [&](int64_t i) {
        grad_sdf[i] = T(0);
        store3(grad_gradient + 3 * i, Vec3<T>{T(0), T(0), T(0)});
      });
    }
  });
}

template <class T>
void spread_samples(const PackedRays& rays, const T* weights, const T* t, const T* phase, T gap, int per_ray,
                    int64_t* sizes, int64_t* first, int64_t* second, T* share, const SpreadAllocator& allocator) {
  std::vector<int64_t> shaded, heaviest, leaders, stretch;
  for (int64_t r = 0; r < rays.n_rays; ++r) {
    const int64_t begin = rays.offsets[r], end = rays.offsets[r + 1], at = static_cast<int64_t>(shaded.size());
    spread_by_weight(weights + begin, t + begin, end - begin, gap, per_ray, double(phase[r]),
                     [&](int64_t i) { shaded.push_back(begin + i); });
    const int64_t drawn = static_cast<int64_t>(shaded.size()) - at;
    if (drawn == 0) continue;
    const SpreadRay<T> ray{weights, t, begin, end, shaded.data(), at, drawn};
    const auto n_before = static_cast<int64_t>(leaders.size());
    leaders.resize(n_before + drawn), stretch.resize(shaded.size());
    const int64_t n_stretches =
        arrange_spread(ray, gap, n_before, first, second, share, leaders.data() + n_before, stretch.data());
    leaders.resize(n_before + n_stretches);
    heaviest.push_back(heaviest_drawn(ray));
  }
  const SpreadSizes counted{static_cast<int64_t>(shaded.size()), static_cast<int64_t>(heaviest.size()),
                            static_cast<int64_t>(leaders.size())};
  sizes[0] = counted.shaded, sizes[1] = counted.heaviest, sizes[2] = counted.leaders;
  const Spread to = allocator.allocate(allocator.fixed ? *allocator.fixed : counted);
  const bool fits = to.has_room(counted.shaded, counted.leaders);
  const SpreadUnusedBody<T> unused{rays, fits ? rays.n_owned() : 0, to, first, second, share};
  if (allocator.fixed || rays.n_owned() < rays.n_samples)
    for (int64_t i = 0; i < unused.count(); ++i) unused(i);
  if (!fits) return;
  std::copy(shaded.begin(), shaded.end(), to.shaded), std::copy(stretch.begin(), stretch.end(), to.stretch);
  std::copy(heaviest.begin(), heaviest.end(), to.heaviest), std::copy(leaders.begin(), leaders.end(), to.leaders);
}

template <class T>
void interpolate(int64_t n, int64_t m, int64_t n_channels, const int64_t* first, const int64_t* second, const T* share,
                 const T* values, T* interpolated) {
  const InterpolateBody<T> body{m, n_channels, first, second, share, values, interpolated};
  for (int64_t at = 0; at < n * n_channels; ++at) body(at);
}

template <class T>
void interpolate_backward(int64_t n, int64_t m, int64_t n_channels, const int64_t* first, const int64_t* second,
                          const T* share, const T* grad_interpolated, T* grad_values) {
  std::fill(grad_values, grad_values + m * n_channels, T(0));
  const InterpolateBackwardBody<T> body{m, n_channels, first, second, share, grad_interpolated, grad_values};
  for (int64_t at = 0; at < n * n_channels; ++at) body(at);
}

#define SPLITNERF_INSTANTIATE(T)                                                                                       \
  template void march_rays_count<T>(const MarchOptions&, const OccupancyView&, int64_t, const T*, const T*, const T*,  \
                                    int64_t*);                                                                         \
  template void march_rays_fill<T>(const MarchOptions&, const OccupancyView&, int64_t, const T*, const T*, const T*,   \
                                   const int64_t*, int64_t*, T*, T*);                                                  \
  template void neus_weights<T>(const PackedRays&, const T*, const T*, const T*, T, T*, T*);                           \
  template void neus_weights_backward<T>(const PackedRays&, const T*, const T*, const T*, T, const T*, const T*,       \
                                         const T*, T*, T*, T*);                                                        \
  template void composite<T>(const PackedRays&, int64_t, const T*, const T*, T*);                                      \
  template void composite_backward<T>(const PackedRays&, int64_t, const T*, const T*, const T*, T*, T*);               \
  template void surface_weights<T>(const SurfaceSamples<T>&, T*, T*, T*);                                              \
  template void surface_weights_backward<T>(const SurfaceSamples<T>&, const T*, const T*, const T*, const T*, T*, T*,  \
                                            T*);                                                                       \
  template void spread_samples<T>(const PackedRays&, const T*, const T*, const T*, T, int, int64_t*, int64_t*,         \
                                  int64_t*, T*, const SpreadAllocator&);                                               \
  template void interpolate<T>(int64_t, int64_t, int64_t, const int64_t*, const int64_t*, const T*, const T*, T*);     \
  template void interpolate_backward<T>(int64_t, int64_t, int64_t, const int64_t*, const int64_t*, const T*, const T*, \
                                        T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cpu
