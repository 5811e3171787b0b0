#include <algorithm>
#include <vector>

#include "splitnerf/neus.h"
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
  const int64_t first = in.offsets[ray], n = in.offsets[ray + 1] - first;
  for (int64_t i = 0; i < n; ++i) {
    const T half = T(0.5) * in.step * annealed_cosine(dot(direction, normals[i]), in.anneal).value;
    f_prev[i] = in.sdf[first + i] - half;
    f_next[i] = in.sdf[first + i] + half;
    apart[i] = T(-2) * half;  // seen grazing it is less than the roundings of both ends
  }
}

// Work memory of one ray.
template <class T> struct RayWork {
  std::vector<Vec3<T>> normals;
  std::vector<T> f_prev, f_next, apart, depths;

  void load(const SurfaceSamples<T>& in, int64_t ray) {
    const int64_t first = in.offsets[ray], n = in.offsets[ray + 1] - first;
    normals.resize(n), f_prev.resize(n), f_next.resize(n), apart.resize(n), depths.resize(n);
    for (int64_t i = 0; i < n; ++i) normals[i] = unit_normal(load3(in.gradient + 3 * (first + i)));
    interval_ends(in, ray, normals.data(), f_prev.data(), f_next.data(), apart.data());
  }
};

}  // namespace

template <class T>
void march_rays_count(const MarchOptions& options, const OccupancyView& grid, int64_t n_rays, const T* rays_o,
                      const T* rays_d, const T* jitter, int64_t* offsets) {
  parallel_for(n_rays, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t r = begin; r < end; ++r)
      offsets[r + 1] = march_ray(load3(rays_o + 3 * r), load3(rays_d + 3 * r), jitter[r], grid, options, [](T, T) {});
  });
  offsets[0] = 0;
  for (int64_t r = 0; r < n_rays; ++r) offsets[r + 1] += offsets[r];
}

template <class T>
void march_rays_fill(const MarchOptions& options, const OccupancyView& grid, int64_t n_rays, const T* rays_o,
                     const T* rays_d, const T* jitter, const int64_t* offsets, int64_t* ray_indices, T* t_starts,
                     T* t_ends) {
  parallel_for(n_rays, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t r = begin; r < end; ++r) {
      int64_t i = offsets[r];
      march_ray(load3(rays_o + 3 * r), load3(rays_d + 3 * r), jitter[r], grid, options, [&](T t_start, T t_end) {
        ray_indices[i] = r;
        t_starts[i] = t_start;
        t_ends[i] = t_end;
        ++i;
      });
    }
  });
}

template <class T>
void neus_weights(int64_t n_rays, const int64_t* offsets, const T* f_prev, const T* f_next, T s, T min_transmittance,
                  T* weights, T* opacity) {
  parallel_for(n_rays, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t r = begin; r < end; ++r) {
      const int64_t first = offsets[r], n = offsets[r + 1] - first;
      opacity[r] =
          neus_ray_weights<T>(f_prev + first, f_next + first, nullptr, s, n, min_transmittance, weights + first);
    }
  });
}

template <class T>
void neus_weights_backward(int64_t n_rays, const int64_t* offsets, const T* f_prev, const T* f_next, T s,
                           T min_transmittance, const T* weights, const T* grad_weights, const T* grad_opacity,
                           T* grad_f_prev, T* grad_f_next, T* grad_s_rays) {
  parallel_for(n_rays, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t r = begin; r < end; ++r) {
      const int64_t first = offsets[r], n = offsets[r + 1] - first;
      T *to_prev = grad_f_prev + first, *to_next = grad_f_next + first;
      grad_s_rays[r] = neus_ray_weights_backward(
          f_prev + first, f_next + first, static_cast<const T*>(nullptr), s, n, min_transmittance, weights + first,
          grad_weights + first, grad_opacity[r], to_next,
          [&](int64_t i, const OpticalDepthGrad<T>& g) { to_prev[i] = g.f_prev, to_next[i] = g.f_next; });
    }
  });
}

template <class T>
void composite(int64_t n_rays, int64_t n_channels, const int64_t* offsets, const T* weights, const T* values, T* sums) {
  parallel_for(n_rays, kGrain, [&](int64_t begin, int64_t end) {
    std::vector<double> totals(n_channels);  // the roundings of thousands of samples would add up
    for (int64_t r = begin; r < end; ++r) {
      std::fill(totals.begin(), totals.end(), 0.0);
      for (int64_t i = offsets[r]; i < offsets[r + 1]; ++i)
        for (int64_t c = 0; c < n_channels; ++c) totals[c] += double(weights[i]) * double(values[i * n_channels + c]);
      for (int64_t c = 0; c < n_channels; ++c) sums[r * n_channels + c] = T(totals[c]);
    }
  });
}

template <class T>
void composite_backward(int64_t n_rays, int64_t n_channels, const int64_t* offsets, const T* weights, const T* values,
                        const T* grad_sums, T* grad_weights, T* grad_values) {
  parallel_for(n_rays, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t r = begin; r < end; ++r) {
      const T* g = grad_sums + r * n_channels;
      for (int64_t i = offsets[r]; i < offsets[r + 1]; ++i) {
        T grad_weight = T(0);
        for (int64_t c = 0; c < n_channels; ++c) {
          grad_weight += g[c] * values[i * n_channels + c];
          grad_values[i * n_channels + c] = g[c] * weights[i];
        }
        grad_weights[i] = grad_weight;
      }
    }
  });
}

template <class T> void surface_weights(const SurfaceSamples<T>& in, T* normals, T* weights, T* opacity) {
  parallel_for(in.n_rays, kGrain, [&](int64_t begin, int64_t end) {
    RayWork<T> work;
    for (int64_t r = begin; r < end; ++r) {
      const int64_t first = in.offsets[r], n = in.offsets[r + 1] - first;
      work.load(in, r);
      for (int64_t i = 0; i < n; ++i) store3(normals + 3 * (first + i), work.normals[i]);
      opacity[r] = neus_ray_weights(work.f_prev.data(), work.f_next.data(), work.apart.data(), in.s, n,
                                    in.min_transmittance, weights + first);
    }
  });
}

template <class T>
void surface_weights_backward(const SurfaceSamples<T>& in, const T* weights, const T* grad_normals,
                              const T* grad_weights, const T* grad_opacity, T* grad_sdf, T* grad_gradient,
                              T* grad_s_rays) {
  parallel_for(in.n_rays, kGrain, [&](int64_t begin, int64_t end) {
    RayWork<T> work;
    for (int64_t r = begin; r < end; ++r) {
      const int64_t first = in.offsets[r], n = in.offsets[r + 1] - first;
      const Vec3<T> direction = load3(in.directions + 3 * r);
      work.load(in, r);
      // f_prev, f_next = sdf -+ half,  half = step / 2 annealed(direction . normal)
      const auto keep = [&](int64_t i, const OpticalDepthGrad<T>& g) {
        const T slope = annealed_cosine(dot(direction, work.normals[i]), in.anneal).slope;
        const T grad_cosine = (g.f_next - g.f_prev) * T(0.5) * in.step * slope;
        grad_sdf[first + i] = g.both;
        const Vec3<T> grad_normal = load3(grad_normals + 3 * (first + i)) + direction * grad_cosine;
        store3(grad_gradient + 3 * (first + i),
               unit_normal_backward(load3(in.gradient + 3 * (first + i)), grad_normal));
      };
      grad_s_rays[r] = neus_ray_weights_backward(work.f_prev.data(), work.f_next.data(), work.apart.data(), in.s, n,
                                                 in.min_transmittance, weights + first, grad_weights + first,
                                                 grad_opacity[r], work.depths.data(), keep);
    }
  });
}

template <class T>
Spread spread_samples(int64_t n_rays, const int64_t* offsets, const T* weights, const T* t, const T* phase, T gap,
                      int per_ray, T* share) {
  const int64_t n = offsets[n_rays];
  Spread s{{}, std::vector<int64_t>(n), std::vector<int64_t>(n), {}, {}, {}};
  for (int64_t r = 0; r < n_rays; ++r) {
    const int64_t begin = offsets[r], end = offsets[r + 1];
    auto at = static_cast<int64_t>(s.shaded.size());
    spread_by_weight(weights + begin, t + begin, end - begin, gap, per_ray, double(phase[r]),
                     [&](int64_t i) { s.shaded.push_back(begin + i); });
    const auto last = static_cast<int64_t>(s.shaded.size()) - 1;
    if (at > last) continue;
    int64_t heaviest = at;
    for (int64_t k = at; k <= last; ++k)
      if (weights[s.shaded[k]] > weights[s.shaded[heaviest]]) heaviest = k;
    s.heaviest.push_back(heaviest);
    int64_t stretch_end = begin;
    for (int64_t i = begin, first_drawn = at; i < end; ++i) {
      if (i == stretch_end) {  // a new stretch: its neighbours are drawn samples of its own
        for (stretch_end = i + 1; stretch_end < end && !(t[stretch_end] - t[stretch_end - 1] > gap);) ++stretch_end;
        while (s.shaded[first_drawn] < i) ++first_drawn;
        at = first_drawn;
        int64_t leader = at, after = at;
        for (; after <= last && s.shaded[after] < stretch_end; ++after)
          if (weights[s.shaded[after]] > weights[s.shaded[leader]]) leader = after;
        s.leaders.push_back(leader);
        s.stretch.resize(after, static_cast<int64_t>(s.leaders.size()) - 1);
      }
      while (at < last && s.shaded[at + 1] <= i) ++at;
      const bool more = at < last && s.shaded[at + 1] < stretch_end;
      s.first[i] = at, s.second[i] = s.shaded[at] < i && more ? at + 1 : at;
      share[i] = share_between(t[i], t[s.shaded[s.first[i]]], t[s.shaded[s.second[i]]]);
    }
  }
  return s;
}

template <class T>
void interpolate(int64_t n, int64_t n_channels, const int64_t* first, const int64_t* second, const T* share,
                 const T* values, T* interpolated) {
  for (int64_t i = 0; i < n; ++i)
    for (int64_t c = 0; c < n_channels; ++c)
      interpolated[i * n_channels + c] =
          lerp(values[first[i] * n_channels + c], values[second[i] * n_channels + c], share[i]);
}

template <class T>
void interpolate_backward(int64_t n, int64_t m, int64_t n_channels, const int64_t* first, const int64_t* second,
                          const T* share, const T* grad_interpolated, T* grad_values) {
  std::fill(grad_values, grad_values + m * n_channels, T(0));
  for (int64_t i = 0; i < n; ++i) {
    for (int64_t c = 0; c < n_channels; ++c) {
      const T g = grad_interpolated[i * n_channels + c];
      grad_values[first[i] * n_channels + c] += g * (T(1) - share[i]);
      grad_values[second[i] * n_channels + c] += g * share[i];
    }
  }
}

#define SPLITNERF_INSTANTIATE(T)                                                                                       \
  template void march_rays_count<T>(const MarchOptions&, const OccupancyView&, int64_t, const T*, const T*, const T*,  \
                                    int64_t*);                                                                         \
  template void march_rays_fill<T>(const MarchOptions&, const OccupancyView&, int64_t, const T*, const T*, const T*,   \
                                   const int64_t*, int64_t*, T*, T*);                                                  \
  template void neus_weights<T>(int64_t, const int64_t*, const T*, const T*, T, T, T*, T*);                            \
  template void neus_weights_backward<T>(int64_t, const int64_t*, const T*, const T*, T, T, const T*, const T*,        \
                                         const T*, T*, T*, T*);                                                        \
  template void composite<T>(int64_t, int64_t, const int64_t*, const T*, const T*, T*);                                \
  template void composite_backward<T>(int64_t, int64_t, const int64_t*, const T*, const T*, const T*, T*, T*);         \
  template void surface_weights<T>(const SurfaceSamples<T>&, T*, T*, T*);                                              \
  template void surface_weights_backward<T>(const SurfaceSamples<T>&, const T*, const T*, const T*, const T*, T*, T*,  \
                                            T*);                                                                       \
  template Spread spread_samples<T>(int64_t, const int64_t*, const T*, const T*, const T*, T, int, T*);                \
  template void interpolate<T>(int64_t, int64_t, const int64_t*, const int64_t*, const T*, const T*, T*);              \
  template void interpolate_backward<T>(int64_t, int64_t, int64_t, const int64_t*, const int64_t*, const T*, const T*, \
                                        T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cpu
