// march_rays, neus_weights, surface_weights, spread_samples, interpolate and composite as torch operators.
#include <algorithm>
#include <tuple>

#include "check.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf::glue {
namespace {

std::tuple<Tensor, Tensor, Tensor, Tensor> march_rays(Tensor rays_o, Tensor rays_d, Tensor jitter, Tensor cells,
                                                      double box, double step, int64_t max_samples) {
  const char* op = "march_rays";
  const ScalarType type = real_type(op, "rays_o", rays_o);
  const Tensor o = checked(op, "rays_o", rays_o, {kAny, 3}, type);
  const int64_t n_rays = o.size(0);
  const Tensor d = checked(op, "rays_d", rays_d, {n_rays, 3}, type);
  const Tensor u = checked(op, "jitter", jitter, {n_rays}, type);
  require(cells.dim() == 3 && cells.size(0) > 0, op, "cells must be [r, r, r] uint8 with r > 0");
  const int64_t resolution = cells.size(0);
  const Tensor grid = checked(op, "cells", cells, {resolution, resolution, resolution}, ScalarType::Byte);
  require(box > 0 && step > 0, op, "box and step must be positive");
  const MarchOptions options{static_cast<float>(box), static_cast<float>(step), max_samples};
  const OccupancyCells occupancy(in<uint8_t>(grid), static_cast<int>(resolution));
  Tensor offsets = empty_like_type(o, {n_rays + 1}, ScalarType::Long), ray_indices, t_starts, t_ends;
  dispatch_real(type, [&](auto zero) {
    using T = decltype(zero);
    cpu::march_rays_count(options, occupancy.view(), n_rays, in<T>(o), in<T>(d), in<T>(u), out<int64_t>(offsets));
    const int64_t n = in<int64_t>(offsets)[n_rays];
    ray_indices = empty_like_type(o, {n}, ScalarType::Long);
    t_starts = empty_like_type(o, {n}, type);
    t_ends = empty_like_type(o, {n}, type);
    cpu::march_rays_fill(options, occupancy.view(), n_rays, in<T>(o), in<T>(d), in<T>(u), in<int64_t>(offsets),
                         out<int64_t>(ray_indices), out<T>(t_starts), out<T>(t_ends));
  });
  return {ray_indices, t_starts, t_ends, offsets};
}

// The sample ranges of the rays: offsets is non-decreasing, from 0 to n_samples.
Tensor checked_offsets(const char* op, const Tensor& offsets, int64_t n_samples) {
  const Tensor o = checked(op, "offsets", offsets, {kAny}, ScalarType::Long);
  require(o.size(0) >= 1, op, "offsets must be [n_rays + 1]");
  const int64_t *p = in<int64_t>(o), n_rays = o.size(0) - 1;
  bool sorted = p[0] == 0 && p[n_rays] == n_samples;
  for (int64_t r = 0; r < n_rays; ++r) sorted = sorted && p[r] <= p[r + 1];
  require(sorted, op, "offsets must rise from 0 to the number of samples, " + std::to_string(n_samples));
  return o;
}

template <class T> T scalar_value(const Tensor& t) { return *in<T>(t); }

std::tuple<Tensor, Tensor> neus_weights(Tensor f_prev, Tensor f_next, Tensor s, Tensor offsets,
                                        double min_transmittance) {
  const char* op = "neus_weights";
  const ScalarType type = real_type(op, "f_prev", f_prev);
  const Tensor p = checked(op, "f_prev", f_prev, {kAny}, type), q = checked(op, "f_next", f_next, {p.size(0)}, type);
  const Tensor sharpness = checked(op, "s", s, {}, type), o = checked_offsets(op, offsets, p.size(0));
  Tensor weights = empty_like_type(p, {p.size(0)}, type), opacity = empty_like_type(p, {o.size(0) - 1}, type);
  dispatch_real(type, [&](auto zero) {
    using T = decltype(zero);
    cpu::neus_weights(o.size(0) - 1, in<int64_t>(o), in<T>(p), in<T>(q), scalar_value<T>(sharpness),
                      T(min_transmittance), out<T>(weights), out<T>(opacity));
  });
  return {weights, opacity};
}

std::tuple<Tensor, Tensor, Tensor> neus_weights_backward(Tensor f_prev, Tensor f_next, Tensor s, Tensor offsets,
                                                         double min_transmittance, Tensor weights, Tensor grad_weights,
                                                         Tensor grad_opacity) {
  const char* op = "neus_weights_backward";
  const ScalarType type = real_type(op, "f_prev", f_prev);
  const Tensor p = checked(op, "f_prev", f_prev, {kAny}, type), q = checked(op, "f_next", f_next, {p.size(0)}, type);
  const Tensor sharpness = checked(op, "s", s, {}, type), o = checked_offsets(op, offsets, p.size(0));
  const int64_t n_rays = o.size(0) - 1;
  const Tensor w = checked(op, "weights", weights, {p.size(0)}, type);
  const Tensor gw = checked(op, "grad_weights", grad_weights, {p.size(0)}, type);
  const Tensor ga = checked(op, "grad_opacity", grad_opacity, {n_rays}, type);
  Tensor grad_p = empty_like_type(p, {p.size(0)}, type), grad_q = empty_like_type(p, {p.size(0)}, type);
  Tensor grad_s = empty_like_type(p, {n_rays}, type);
  dispatch_real(type, [&](auto zero) {
    using T = decltype(zero);
    cpu::neus_weights_backward(n_rays, in<int64_t>(o), in<T>(p), in<T>(q), scalar_value<T>(sharpness),
                               T(min_transmittance), in<T>(w), in<T>(gw), in<T>(ga), out<T>(grad_p), out<T>(grad_q),
                               out<T>(grad_s));
  });
  return {grad_p, grad_q, grad_s};
}

Tensor composite(Tensor weights, Tensor values, Tensor offsets) {
  const char* op = "composite";
  const ScalarType type = real_type(op, "weights", weights);
  const Tensor w = checked(op, "weights", weights, {kAny}, type),
               v = checked(op, "values", values, {w.size(0), kAny}, type);
  const Tensor o = checked_offsets(op, offsets, w.size(0));
  Tensor sums = empty_like_type(w, {o.size(0) - 1, v.size(1)}, type);
  dispatch_real(type, [&](auto zero) {
    using T = decltype(zero);
    cpu::composite(o.size(0) - 1, v.size(1), in<int64_t>(o), in<T>(w), in<T>(v), out<T>(sums));
  });
  return sums;
}

std::tuple<Tensor, Tensor> composite_backward(Tensor weights, Tensor values, Tensor offsets, Tensor grad_sums) {
  const char* op = "composite_backward";
  const ScalarType type = real_type(op, "weights", weights);
  const Tensor w = checked(op, "weights", weights, {kAny}, type),
               v = checked(op, "values", values, {w.size(0), kAny}, type);
  const Tensor o = checked_offsets(op, offsets, w.size(0));
  const Tensor g = checked(op, "grad_sums", grad_sums, {o.size(0) - 1, v.size(1)}, type);
  Tensor grad_w = empty_like_type(w, {w.size(0)}, type), grad_v = empty_like_type(w, {w.size(0), v.size(1)}, type);
  dispatch_real(type, [&](auto zero) {
    using T = decltype(zero);
    cpu::composite_backward(o.size(0) - 1, v.size(1), in<int64_t>(o), in<T>(w), in<T>(v), in<T>(g), out<T>(grad_w),
                            out<T>(grad_v));
  });
  return {grad_w, grad_v};
}

// Samples of a surface, checked and contiguous.
struct Surface {
  ScalarType type;
  Tensor sdf, gradient, rays_d, s, offsets;
  double step, anneal, min_transmittance;

  Surface(const char* op, const Tensor& sdf_in, const Tensor& gradient_in, const Tensor& rays_d_in, const Tensor& s_in,
          const Tensor& offsets_in, double step, double anneal, double min_transmittance)
      : type(real_type(op, "sdf", sdf_in)), sdf(checked(op, "sdf", sdf_in, {kAny}, type)),
        gradient(checked(op, "gradient", gradient_in, {sdf.size(0), 3}, type)),
        rays_d(checked(op, "rays_d", rays_d_in, {kAny, 3}, type)), s(checked(op, "s", s_in, {}, type)),
        offsets(checked_offsets(op, offsets_in, sdf.size(0))), step(step), anneal(anneal),
        min_transmittance(min_transmittance) {
    require(offsets.size(0) == n_rays() + 1, op, "offsets must be [n_rays + 1]");
    require(step > 0, op, "step must be positive");
  }
  int64_t n_rays() const { return rays_d.size(0); }
  template <class T> cpu::SurfaceSamples<T> view() const {
    return {n_rays(),  in<int64_t>(offsets), in<T>(sdf), in<T>(gradient), in<T>(rays_d), scalar_value<T>(s), T(step),
            T(anneal), T(min_transmittance)};
  }
};

std::tuple<Tensor, Tensor, Tensor> surface_weights(Tensor sdf, Tensor gradient, Tensor rays_d, Tensor s, Tensor offsets,
                                                   double step, double anneal, double min_transmittance) {
  const Surface x("surface_weights", sdf, gradient, rays_d, s, offsets, step, anneal, min_transmittance);
  Tensor normals = empty_like_type(x.sdf, {x.sdf.size(0), 3}, x.type),
         weights = empty_like_type(x.sdf, {x.sdf.size(0)}, x.type);
  Tensor opacity = empty_like_type(x.sdf, {x.n_rays()}, x.type);
  dispatch_real(x.type, [&](auto zero) {
    using T = decltype(zero);
    cpu::surface_weights(x.view<T>(), out<T>(normals), out<T>(weights), out<T>(opacity));
  });
  return {normals, weights, opacity};
}

std::tuple<Tensor, Tensor, Tensor> surface_weights_backward(Tensor sdf, Tensor gradient, Tensor rays_d, Tensor s,
                                                            Tensor offsets, double step, double anneal,
                                                            double min_transmittance, Tensor weights,
                                                            Tensor grad_normals, Tensor grad_weights,
                                                            Tensor grad_opacity) {
  const char* op = "surface_weights_backward";
  const Surface x(op, sdf, gradient, rays_d, s, offsets, step, anneal, min_transmittance);
  const int64_t n = x.sdf.size(0), n_rays = x.n_rays();
  const Tensor w = checked(op, "weights", weights, {n}, x.type);
  const Tensor gn = checked(op, "grad_normals", grad_normals, {n, 3}, x.type);
  const Tensor gw = checked(op, "grad_weights", grad_weights, {n}, x.type);
  const Tensor ga = checked(op, "grad_opacity", grad_opacity, {n_rays}, x.type);
  Tensor grad_sdf = empty_like_type(w, {n}, x.type), grad_gradient = empty_like_type(w, {n, 3}, x.type);
  Tensor grad_s = empty_like_type(w, {n_rays}, x.type);
  dispatch_real(x.type, [&](auto zero) {
    using T = decltype(zero);
    cpu::surface_weights_backward(x.view<T>(), in<T>(w), in<T>(gn), in<T>(gw), in<T>(ga), out<T>(grad_sdf),
                                  out<T>(grad_gradient), out<T>(grad_s));
  });
  return {grad_sdf, grad_gradient, grad_s};
}

Tensor index_tensor(const Tensor& like, const std::vector<int64_t>& values) {
  Tensor t = empty_like_type(like, {static_cast<int64_t>(values.size())}, ScalarType::Long);
  std::copy(values.begin(), values.end(), out<int64_t>(t));
  return t;
}

std::tuple<Tensor, Tensor, Tensor, Tensor, Tensor, Tensor, Tensor> spread_samples(Tensor weights, Tensor t,
                                                                                  Tensor offsets, Tensor phase,
                                                                                  double gap, int64_t per_ray) {
  const char* op = "spread_samples";
  const ScalarType type = real_type(op, "weights", weights);
  const Tensor w = checked(op, "weights", weights, {kAny}, type), at = checked(op, "t", t, {w.size(0)}, type);
  const Tensor o = checked_offsets(op, offsets, w.size(0)), u = checked(op, "phase", phase, {o.size(0) - 1}, type);
  require(gap > 0, op, "gap must be positive");
  require(per_ray >= 0 && per_ray < 1 << 20, op, "per_ray must be in [0, 2^20)");
  Tensor share = empty_like_type(w, {w.size(0)}, type);
  cpu::Spread spread;
  dispatch_real(type, [&](auto zero) {
    using T = decltype(zero);
    require(std::all_of(in<T>(u), in<T>(u) + u.size(0), [](T p) { return p >= T(0) && p < T(1); }), op,
            "phase must be in [0, 1)");
    spread = cpu::spread_samples(o.size(0) - 1, in<int64_t>(o), in<T>(w), in<T>(at), in<T>(u), T(gap),
                                 static_cast<int>(per_ray), out<T>(share));
  });
  return {index_tensor(w, spread.shaded),   index_tensor(w, spread.first),   index_tensor(w, spread.second), share,
          index_tensor(w, spread.heaviest), index_tensor(w, spread.leaders), index_tensor(w, spread.stretch)};
}

// Positions in [0, m), one for each of n samples.
Tensor checked_positions(const char* op, const char* name, const Tensor& positions, int64_t n, int64_t m) {
  const Tensor p = checked(op, name, positions, {n}, ScalarType::Long);
  const int64_t* begin = in<int64_t>(p);
  require(std::all_of(begin, begin + n, [&](int64_t i) { return i >= 0 && i < m; }), op,
          std::string(name) + " must be in [0, " + std::to_string(m) + ")");
  return p;
}

Tensor interpolate(Tensor values, Tensor first, Tensor second, Tensor share) {
  const char* op = "interpolate";
  const ScalarType type = real_type(op, "values", values);
  const Tensor v = checked(op, "values", values, {kAny, kAny}, type), x = checked(op, "share", share, {kAny}, type);
  const Tensor a = checked_positions(op, "first", first, x.size(0), v.size(0));
  const Tensor b = checked_positions(op, "second", second, x.size(0), v.size(0));
  Tensor interpolated = empty_like_type(v, {x.size(0), v.size(1)}, type);
  dispatch_real(type, [&](auto zero) {
    using T = decltype(zero);
    cpu::interpolate(x.size(0), v.size(1), in<int64_t>(a), in<int64_t>(b), in<T>(x), in<T>(v), out<T>(interpolated));
  });
  return interpolated;
}

// Of `shaded` only the first size counts: that of the values.
Tensor interpolate_backward(Tensor grad_interpolated, Tensor first, Tensor second, Tensor share, Tensor shaded) {
  const char* op = "interpolate_backward";
  require(shaded.dim() >= 1, op, "shaded must be [m, ...]");
  const int64_t m = shaded.size(0);
  const ScalarType type = real_type(op, "grad_interpolated", grad_interpolated);
  const Tensor g = checked(op, "grad_interpolated", grad_interpolated, {kAny, kAny}, type);
  const Tensor x = checked(op, "share", share, {g.size(0)}, type);
  const Tensor a = checked_positions(op, "first", first, x.size(0), m),
               b = checked_positions(op, "second", second, x.size(0), m);
  Tensor grad_values = empty_like_type(g, {m, g.size(1)}, type);
  dispatch_real(type, [&](auto zero) {
    using T = decltype(zero);
    cpu::interpolate_backward(x.size(0), m, g.size(1), in<int64_t>(a), in<int64_t>(b), in<T>(x), in<T>(g),
                              out<T>(grad_values));
  });
  return grad_values;
}

}  // namespace

#define SPLITNERF_SURFACE                                                                                  \
  "Tensor sdf, Tensor gradient, Tensor rays_d, Tensor s, Tensor offsets, float step, float anneal, float " \
  "min_transmittance"
STABLE_TORCH_LIBRARY_FRAGMENT(splitnerf, m) {
  m.def(
      "march_rays(Tensor rays_o, Tensor rays_d, Tensor jitter, Tensor cells, float box, float step, "
      "int max_samples) -> (Tensor, Tensor, Tensor, Tensor)");
  m.def(
      "neus_weights(Tensor f_prev, Tensor f_next, Tensor s, Tensor offsets, float min_transmittance) -> "
      "(Tensor, Tensor)");
  m.def(
      "neus_weights_backward(Tensor f_prev, Tensor f_next, Tensor s, Tensor offsets, float min_transmittance, "
      "Tensor weights, Tensor grad_weights, Tensor grad_opacity) -> (Tensor, Tensor, Tensor)");
  m.def("surface_weights(" SPLITNERF_SURFACE ") -> (Tensor, Tensor, Tensor)");
  m.def("surface_weights_backward(" SPLITNERF_SURFACE
        ", Tensor weights, Tensor grad_normals, "
        "Tensor grad_weights, Tensor grad_opacity) -> (Tensor, Tensor, Tensor)");
  m.def(
      "spread_samples(Tensor weights, Tensor t, Tensor offsets, Tensor phase, float gap, int per_ray) -> "
      "(Tensor, Tensor, Tensor, Tensor, Tensor, Tensor, Tensor)");
  m.def("interpolate(Tensor values, Tensor first, Tensor second, Tensor share) -> Tensor");
  m.def(
      "interpolate_backward(Tensor grad_interpolated, Tensor first, Tensor second, Tensor share, Tensor shaded) -> "
      "Tensor");
  m.def("composite(Tensor weights, Tensor values, Tensor offsets) -> Tensor");
  m.def("composite_backward(Tensor weights, Tensor values, Tensor offsets, Tensor grad_sums) -> (Tensor, Tensor)");
}

STABLE_TORCH_LIBRARY_IMPL(splitnerf, CPU, m) {
  m.impl("march_rays", TORCH_BOX(&march_rays));
  m.impl("neus_weights", TORCH_BOX(&neus_weights));
  m.impl("neus_weights_backward", TORCH_BOX(&neus_weights_backward));
  m.impl("surface_weights", TORCH_BOX(&surface_weights));
  m.impl("surface_weights_backward", TORCH_BOX(&surface_weights_backward));
  m.impl("spread_samples", TORCH_BOX(&spread_samples));
  m.impl("interpolate", TORCH_BOX(&interpolate));
  m.impl("interpolate_backward", TORCH_BOX(&interpolate_backward));
  m.impl("composite", TORCH_BOX(&composite));
  m.impl("composite_backward", TORCH_BOX(&composite_backward));
}

}  // namespace splitnerf::glue
