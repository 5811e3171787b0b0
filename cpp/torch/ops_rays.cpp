// march_rays, surface_weights, spread_samples, interpolate and composite as torch operators.
#include <algorithm>
#include <optional>
#include <tuple>

#include "device.h"

namespace splitnerf::glue {
namespace {

constexpr double kMostSteps = 1 << 20;

std::tuple<Tensor, Tensor, Tensor, Tensor> march_rays(Tensor rays_o, Tensor rays_d, Tensor jitter, Tensor cells,
                                                      double box, double step, int64_t max_samples) {
  const char* op = "march_rays";
  const Kind type = real_kind(op, "rays_o", rays_o);
  const Tensor o = checked(op, "rays_o", rays_o, {kAny, 3}, type);
  const int64_t n_rays = o.size(0);
  const Tensor d = checked(op, "rays_d", rays_d, {n_rays, 3}, type);
  const Tensor u = checked(op, "jitter", jitter, {n_rays}, type);
  require(cells.dim() == 3 && cells.size(0) > 0, op, "cells must be [r, r, r] uint8 with r > 0");
  const int64_t resolution = cells.size(0);
  const Tensor grid = checked(op, "cells", cells, {resolution, resolution, resolution}, type.with(ScalarType::Byte));
  require(box > 0 && step > 0, op, "box and step must be positive");
  require(box <= kMostSteps * step, op, "box must be at most 2^20 steps");  // a ray may look at each of them
  const MarchOptions options{static_cast<float>(box), static_cast<float>(step), max_samples};
  const int64_t n_blocks = blocks_along(static_cast<int>(resolution));
  Tensor blocks = empty_like_type(o, {n_blocks, n_blocks, n_blocks}, ScalarType::Byte);
  const OccupancyView occupancy{in<uint8_t>(grid), out<uint8_t>(blocks), static_cast<int>(resolution),
                                static_cast<int>(n_blocks)};
  Tensor offsets = empty_like_type(o, {n_rays + 1}, ScalarType::Long), ray_indices, t_starts, t_ends;
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, blocks.numel(),
               OccupiedBlocksBody{occupancy.cells, occupancy.resolution, occupancy.n_blocks, out<uint8_t>(blocks)});
    device.run(op, n_rays,
               MarchCountBody<T>{options, occupancy, in<T>(o), in<T>(d), in<T>(u), out<int64_t>(offsets) + 1});
    device.sum_counts(op, n_rays, out<int64_t>(offsets));
    const int64_t n = device.read_number(in<int64_t>(offsets) + n_rays);  // the one place where a GPU is waited for
    ray_indices = empty_like_type(o, {n}, ScalarType::Long);
    t_starts = empty_like_type(o, {n}, type);
    t_ends = empty_like_type(o, {n}, type);
    device.run(op, n_rays,
               MarchFillBody<T>{options, occupancy, in<T>(o), in<T>(d), in<T>(u), in<int64_t>(offsets),
                                out<int64_t>(ray_indices), out<T>(t_starts), out<T>(t_ends)});
  });
  return {ray_indices, t_starts, t_ends, offsets};
}

// The sample ranges of the rays: offsets is non-decreasing, from 0 to n_samples at most. To look at them on a GPU would mean
// waiting for it.
Tensor checked_offsets(const char* op, const Tensor& offsets, int64_t n_samples, Kind kind) {
  const Tensor o = checked(op, "offsets", offsets, {kAny}, kind.with(ScalarType::Long));
  require(o.size(0) >= (n_samples > 0 ? 2 : 1), op, "offsets must be [n_rays + 1], with rays where there are samples");
  if (!kind.on_cpu()) return o;
  const int64_t *p = in<int64_t>(o), n_rays = o.size(0) - 1;
  bool sorted = p[0] == 0 && p[n_rays] <= n_samples;
  for (int64_t r = 0; r < n_rays; ++r) sorted = sorted && p[r] <= p[r + 1];
  require(sorted, op, "offsets must rise from 0 to the number of samples at most, " + std::to_string(n_samples));
  return o;
}

PackedRays packed_rays(const Tensor& offsets, int64_t n_samples) {
  return {offsets.size(0) - 1, n_samples, in<int64_t>(offsets)};
}

// Weights and values of samples, checked and contiguous.
struct Weighed {
  Kind type;
  Tensor weights, values, offsets;
  std::optional<Tensor> opacity;
  double least;

  Weighed(const char* op, const Tensor& weights_in, const Tensor& values_in, const Tensor& offsets_in,
          const std::optional<Tensor>& opacity_in, double least)
      : type(real_kind(op, "weights", weights_in)), weights(checked(op, "weights", weights_in, {kAny}, type)),
        values(checked(op, "values", values_in, {weights.size(0), kAny}, type)),
        offsets(checked_offsets(op, offsets_in, weights.size(0), type)), least(least) {
    if (!opacity_in) return;
    require(least > 0, op, "least_opacity must be positive");
    opacity = checked(op, "opacity", *opacity_in, {n_rays()}, type);
  }
  int64_t n_rays() const { return offsets.size(0) - 1; }
  template <class T> CompositeArrays<T> view() const {
    return {packed_rays(offsets, weights.size(0)), values.size(1), in<T>(weights), in<T>(values),
            opacity ? in<T>(*opacity) : nullptr,   T(least)};
  }
};

Tensor composite(Tensor weights, Tensor values, Tensor offsets, std::optional<Tensor> opacity, double least_opacity) {
  const char* op = "composite";
  const Weighed x(op, weights, values, offsets, opacity, least_opacity);
  Tensor sums = empty_like_type(x.weights, {x.n_rays(), x.values.size(1)}, x.type);
  on_device(x.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, x.n_rays(), CompositeBody<T>{x.view<T>(), out<T>(sums)});
  });
  return sums;
}

// The gradient to the opacity is empty where there is none.
std::tuple<Tensor, Tensor, Tensor> composite_backward(Tensor weights, Tensor values, Tensor offsets,
                                                      std::optional<Tensor> opacity, double least_opacity,
                                                      Tensor grad_sums) {
  const char* op = "composite_backward";
  const Weighed x(op, weights, values, offsets, opacity, least_opacity);
  const Tensor g = checked(op, "grad_sums", grad_sums, {x.n_rays(), x.values.size(1)}, x.type);
  Tensor grad_w = empty_like_type(g, {x.weights.size(0)}, x.type),
         grad_v = empty_like_type(g, {x.weights.size(0), x.values.size(1)}, x.type),
         grad_o = empty_like_type(g, {x.opacity ? x.n_rays() : 0}, x.type);
  on_device(x.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, x.n_rays(),
               CompositeBackwardBody<T>{x.view<T>(), in<T>(g), out<T>(grad_w), out<T>(grad_v), out<T>(grad_o)});
  });
  return {grad_w, grad_v, grad_o};
}

// Samples of a surface, checked and contiguous: the first n of a field's points.
struct Surface {
  Kind type;
  Tensor sdf;
  int64_t n;
  Tensor gradient, rays_d, s, offsets, step, anneal;
  double min_transmittance;

  Surface(const char* op, const Tensor& sdf_in, const Tensor& gradient_in, const Tensor& rays_d_in, const Tensor& s_in,
          const Tensor& offsets_in, const Tensor& step_in, const Tensor& anneal_in, double min_transmittance,
          int64_t n_samples)
      : type(real_kind(op, "sdf", sdf_in)), sdf(sdf_in.dim() == 2 ? checked(op, "sdf", sdf_in, {kAny, kAny}, type)
                                                                  : checked(op, "sdf", sdf_in, {kAny}, type)),
        n(n_samples < 0 ? n_rows() : n_samples), gradient(checked(op, "gradient", gradient_in, {n_rows(), 3}, type)),
        rays_d(checked(op, "rays_d", rays_d_in, {kAny, 3}, type)), s(checked(op, "s", s_in, {}, type)),
        offsets(checked_offsets(op, offsets_in, n, type)), step(checked(op, "step", step_in, {}, type)),
        anneal(checked(op, "anneal", anneal_in, {}, type)), min_transmittance(min_transmittance) {
    require(n <= n_rows(), op, "n_samples must be at most the number of points");
    require(n_rows() == 0 || (stride() > 0 && n_rays() > 0), op, "there are points but no distances or no rays");
    require(offsets.size(0) == n_rays() + 1, op, "offsets must be [n_rays + 1]");
    if (!type.on_cpu()) return;
    dispatch_real(type, [&](auto zero) { require(*in<decltype(zero)>(this->step) > 0, op, "step must be positive"); });
  }
  int64_t n_rays() const { return rays_d.size(0); }
  int64_t n_rows() const { return sdf.size(0); }
  int64_t stride() const { return sdf.dim() == 2 ? sdf.size(1) : 1; }
  template <class T> SurfaceSamples<T> view() const {
    return {packed_rays(offsets, n), in<T>(sdf),           in<T>(gradient), in<T>(rays_d), in<T>(s), in<T>(step),
            in<T>(anneal),           T(min_transmittance), stride(),        n_rows()};
  }
};

std::tuple<Tensor, Tensor, Tensor> surface_weights(Tensor sdf, Tensor gradient, Tensor rays_d, Tensor s, Tensor offsets,
                                                   Tensor step, Tensor anneal, double min_transmittance,
                                                   int64_t n_samples) {
  const char* op = "surface_weights";
  const Surface x(op, sdf, gradient, rays_d, s, offsets, step, anneal, min_transmittance, n_samples);
  Tensor normals = empty_like_type(x.sdf, {x.n, 3}, x.type), weights = empty_like_type(x.sdf, {x.n}, x.type),
         opacity = empty_like_type(x.sdf, {x.n_rays()}, x.type);
  on_device(x.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, x.n_rays(), SurfaceWeightsBody<T>{x.view<T>(), out<T>(normals), out<T>(weights), out<T>(opacity)});
  });
  return {normals, weights, opacity};
}

std::tuple<Tensor, Tensor, Tensor> surface_weights_backward(Tensor sdf, Tensor gradient, Tensor rays_d, Tensor s,
                                                            Tensor offsets, Tensor step, Tensor anneal,
                                                            double min_transmittance, int64_t n_samples, Tensor weights,
                                                            Tensor grad_normals, Tensor grad_weights,
                                                            Tensor grad_opacity) {
  const char* op = "surface_weights_backward";
  const Surface x(op, sdf, gradient, rays_d, s, offsets, step, anneal, min_transmittance, n_samples);
  const Tensor w = checked(op, "weights", weights, {x.n}, x.type);
  const Tensor gn = checked(op, "grad_normals", grad_normals, {x.n, 3}, x.type);
  const Tensor gw = checked(op, "grad_weights", grad_weights, {x.n}, x.type);
  const Tensor ga = checked(op, "grad_opacity", grad_opacity, {x.n_rays()}, x.type);
  Tensor grad_sdf = torch::stable::empty_like(x.sdf), grad_gradient = empty_like_type(w, {x.n_rows(), 3}, x.type);
  Tensor grad_s = empty_like_type(w, {x.n_rays()}, x.type);
  on_device(x.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, x.n_rays(),
               SurfaceWeightsBackwardBody<T>{x.view<T>(), in<T>(w), in<T>(gn), in<T>(gw), in<T>(ga), out<T>(grad_sdf),
                                             out<T>(grad_gradient), out<T>(grad_s), device.template scratch<T>(x.n)});
  });
  return {grad_sdf, grad_gradient, grad_s};
}

using Tensors8 = std::tuple<Tensor, Tensor, Tensor, Tensor, Tensor, Tensor, Tensor, Tensor>;
Tensors8 spread_samples(Tensor weights, Tensor t, Tensor offsets, Tensor phase, double gap, int64_t per_ray,
                        int64_t max_shaded, int64_t max_stretches, std::optional<Tensor> unit) {
  const char* op = "spread_samples";
  const Kind type = real_kind(op, "weights", weights);
  const Tensor w = checked(op, "weights", weights, {kAny}, type), at = checked(op, "t", t, {w.size(0)}, type);
  const Tensor o = checked_offsets(op, offsets, w.size(0), type),
               u = checked(op, "phase", phase, {o.size(0) - 1}, type);
  require(gap > 0, op, "gap must be positive");
  std::optional<Tensor> length;
  if (unit) length = checked(op, "unit", *unit, {}, type);
  require(per_ray >= 0 && per_ray < 1 << 20, op, "per_ray must be in [0, 2^20)");
  const bool fixed = max_shaded >= 0;
  require(fixed == (max_stretches >= 0), op, "max_shaded and max_stretches must be given both or neither");
  const SpreadSizes capacity{max_shaded, u.size(0), max_stretches};
  const auto indices = [&](int64_t n) { return empty_like_type(w, {n}, ScalarType::Long); };
  Tensor first = indices(w.size(0)), second = indices(w.size(0)), share = empty_like_type(w, {w.size(0)}, type);
  Tensor shaded, heaviest, leaders, stretch, sizes = indices(3);
  const SpreadAllocator allocator{[&](const SpreadSizes& n) {
                                    shaded = indices(n.shaded), heaviest = indices(n.heaviest);
                                    leaders = indices(n.leaders), stretch = indices(n.shaded);
                                    return Spread{out<int64_t>(shaded), out<int64_t>(heaviest), out<int64_t>(leaders),
                                                  out<int64_t>(stretch), n};
                                  },
                                  fixed ? &capacity : nullptr};
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    const auto inside = [](T p) { return p >= T(0) && p < T(1); };
    require(!type.on_cpu() || std::all_of(in<T>(u), in<T>(u) + u.size(0), inside), op, "phase must be in [0, 1)");
    const SpreadArrays<T> arrays{
        packed_rays(o, w.size(0)), in<T>(w), in<T>(at), in<T>(u), T(gap), length ? in<T>(*length) : nullptr,
        static_cast<int>(per_ray)};
    device.spread_samples(arrays, out<int64_t>(sizes), out<int64_t>(first), out<int64_t>(second), out<T>(share),
                          allocator);
  });
  return {shaded, first, second, share, heaviest, leaders, stretch, sizes};
}

// Positions in [0, m), one for each of n samples.
Tensor checked_positions(const char* op, const char* name, const Tensor& positions, int64_t n, int64_t m, Kind kind) {
  const Tensor p = checked(op, name, positions, {n}, kind.with(ScalarType::Long));
  require(n == 0 || m > 0, op, std::string(name) + " must be in [0, 0)");
  if (!kind.on_cpu()) return p;
  const int64_t* begin = in<int64_t>(p);
  require(std::all_of(begin, begin + n, [&](int64_t i) { return i >= 0 && i < m; }), op,
          std::string(name) + " must be in [0, " + std::to_string(m) + ")");
  return p;
}

Tensor interpolate(Tensor values, Tensor first, Tensor second, Tensor share) {
  const char* op = "interpolate";
  const Kind type = real_kind(op, "values", values);
  const Tensor v = checked(op, "values", values, {kAny, kAny}, type), x = checked(op, "share", share, {kAny}, type);
  const Tensor a = checked_positions(op, "first", first, x.size(0), v.size(0), type);
  const Tensor b = checked_positions(op, "second", second, x.size(0), v.size(0), type);
  Tensor interpolated = empty_like_type(v, {x.size(0), v.size(1)}, type);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, x.size(0) * v.size(1),
               InterpolateBody<T>{v.size(0), v.size(1), in<int64_t>(a), in<int64_t>(b), in<T>(x), in<T>(v),
                                  out<T>(interpolated)});
  });
  return interpolated;
}

// Of `shaded` only the first size counts: that of the values.
Tensor interpolate_backward(Tensor grad_interpolated, Tensor first, Tensor second, Tensor share, Tensor shaded) {
  const char* op = "interpolate_backward";
  require(shaded.dim() >= 1, op, "shaded must be [m, ...]");
  const int64_t m = shaded.size(0);
  const Kind type = real_kind(op, "grad_interpolated", grad_interpolated);
  const Tensor g = checked(op, "grad_interpolated", grad_interpolated, {kAny, kAny}, type);
  const Tensor x = checked(op, "share", share, {g.size(0)}, type);
  const Tensor a = checked_positions(op, "first", first, x.size(0), m, type),
               b = checked_positions(op, "second", second, x.size(0), m, type);
  Tensor grad_values = empty_like_type(g, {m, g.size(1)}, type);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.clear(op, out<T>(grad_values), m * g.size(1));
    device.run(op, x.size(0) * g.size(1),
               InterpolateBackwardBody<T>{m, g.size(1), in<int64_t>(a), in<int64_t>(b), in<T>(x), in<T>(g),
                                          out<T>(grad_values)});
  });
  return grad_values;
}

}  // namespace

SPLITNERF_OPERATORS(op) {
  op(SPLITNERF_OP(march_rays), "rays_o rays_d jitter cells box step max_samples");
  op(SPLITNERF_OP(surface_weights), "sdf gradient rays_d s offsets step anneal min_transmittance n_samples=-1");
  op(SPLITNERF_OP(surface_weights_backward),
     "sdf gradient rays_d s offsets step anneal min_transmittance n_samples weights grad_normals grad_weights "
     "grad_opacity");
  op(SPLITNERF_OP(spread_samples), "weights t offsets phase gap per_ray max_shaded=-1 max_stretches=-1 unit=None");
  op(SPLITNERF_OP(interpolate), "values first second share");
  op(SPLITNERF_OP(interpolate_backward), "grad_interpolated first second share shaded");
  op(SPLITNERF_OP(composite), "weights values offsets opacity=None least_opacity=1");
  op(SPLITNERF_OP(composite_backward), "weights values offsets opacity least_opacity grad_sums");
}

}  // namespace splitnerf::glue
