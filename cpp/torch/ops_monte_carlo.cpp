// sample_bsdf and monte_carlo_light as torch operators.
#include <tuple>

#include "check.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf::glue {
namespace {

std::tuple<Tensor, Tensor> sample_bsdf(Tensor normals, Tensor view_dirs, Tensor roughness, int64_t n_samples,
                                       int64_t seed) {
  const char* op = "sample_bsdf";
  const ScalarType type = real_type(op, "normals", normals);
  const Tensor n = checked(op, "normals", normals, {kAny, 3}, type);
  const Tensor v = checked(op, "view_dirs", view_dirs, {n.size(0), 3}, type);
  const Tensor rho = checked(op, "roughness", roughness, {n.size(0), 1}, type);
  require(n_samples > 0 && n_samples <= 1 << 20, op, "n_samples must be in [1, 2^20]");
  Tensor directions = empty_like_type(n, {n.size(0), n_samples, 3}, type);
  Tensor pdf = empty_like_type(n, {n.size(0), n_samples}, type);
  dispatch_real(type, [&](auto zero) {
    using T = decltype(zero);
    cpu::sample_bsdf(n.size(0), in<T>(n), in<T>(v), in<T>(rho), static_cast<int>(n_samples),
                     static_cast<uint32_t>(seed), out<T>(directions), out<T>(pdf));
  });
  return {directions, pdf};
}

// What both directions of monte_carlo_light read.
struct Inputs {
  ScalarType type;
  Tensor normals, view_dirs, roughness, light_dirs, pdf, radiance;

  Inputs(const char* op, const Tensor& n, const Tensor& v, const Tensor& rho, const Tensor& l, const Tensor& p,
         const Tensor& r)
      : type(real_type(op, "normals", n)),
        normals(checked(op, "normals", n, {kAny, 3}, type)),
        view_dirs(checked(op, "view_dirs", v, {normals.size(0), 3}, type)),
        roughness(checked(op, "roughness", rho, {normals.size(0), 1}, type)),
        light_dirs(checked(op, "light_dirs", l, {normals.size(0), kAny, 3}, type)),
        pdf(checked(op, "pdf", p, {normals.size(0), light_dirs.size(1)}, type)),
        radiance(checked(op, "radiance", r, {normals.size(0), light_dirs.size(1), 3}, type)) {
    require(n_samples() > 0 || n_points() == 0, op, "light_dirs must hold at least one direction a point");
  }
  int64_t n_points() const { return normals.size(0); }
  int n_samples() const { return static_cast<int>(light_dirs.size(1)); }
};

Tensor monte_carlo_light(Tensor normals, Tensor view_dirs, Tensor roughness, Tensor light_dirs, Tensor pdf,
                         Tensor radiance) {
  const Inputs i("monte_carlo_light", normals, view_dirs, roughness, light_dirs, pdf, radiance);
  Tensor sums = empty_like_type(i.normals, {i.n_points(), 3, 3}, i.type);
  dispatch_real(i.type, [&](auto zero) {
    using T = decltype(zero);
    cpu::monte_carlo_light(i.n_points(), i.n_samples(), in<T>(i.normals), in<T>(i.view_dirs), in<T>(i.roughness),
                           in<T>(i.light_dirs), in<T>(i.pdf), in<T>(i.radiance), out<T>(sums));
  });
  return sums;
}

std::tuple<Tensor, Tensor, Tensor> monte_carlo_light_backward(Tensor normals, Tensor view_dirs, Tensor roughness,
                                                              Tensor light_dirs, Tensor pdf, Tensor radiance,
                                                              Tensor grad_sums) {
  const char* op = "monte_carlo_light_backward";
  const Inputs i(op, normals, view_dirs, roughness, light_dirs, pdf, radiance);
  const Tensor g = checked(op, "grad_sums", grad_sums, {i.n_points(), 3, 3}, i.type);
  Tensor grad_normals = empty_like_type(g, {i.n_points(), 3}, i.type);
  Tensor grad_roughness = empty_like_type(g, {i.n_points(), 1}, i.type);
  Tensor grad_radiance = empty_like_type(g, {i.n_points(), i.n_samples(), 3}, i.type);
  dispatch_real(i.type, [&](auto zero) {
    using T = decltype(zero);
    cpu::monte_carlo_light_backward(i.n_points(), i.n_samples(), in<T>(i.normals), in<T>(i.view_dirs),
                                    in<T>(i.roughness), in<T>(i.light_dirs), in<T>(i.pdf), in<T>(i.radiance), in<T>(g),
                                    out<T>(grad_normals), out<T>(grad_roughness), out<T>(grad_radiance));
  });
  return {grad_normals, grad_roughness, grad_radiance};
}

}  // namespace

STABLE_TORCH_LIBRARY_FRAGMENT(splitnerf, m) {
  m.def("sample_bsdf(Tensor normals, Tensor view_dirs, Tensor roughness, int n_samples, int seed) -> (Tensor, Tensor)");
  m.def("monte_carlo_light(Tensor normals, Tensor view_dirs, Tensor roughness, Tensor light_dirs, Tensor pdf, "
        "Tensor radiance) -> Tensor");
  m.def("monte_carlo_light_backward(Tensor normals, Tensor view_dirs, Tensor roughness, Tensor light_dirs, Tensor pdf, "
        "Tensor radiance, Tensor grad_sums) -> (Tensor, Tensor, Tensor)");
}

STABLE_TORCH_LIBRARY_IMPL(splitnerf, CPU, m) {
  m.impl("sample_bsdf", TORCH_BOX(&sample_bsdf));
  m.impl("monte_carlo_light", TORCH_BOX(&monte_carlo_light));
  m.impl("monte_carlo_light_backward", TORCH_BOX(&monte_carlo_light_backward));
}

}  // namespace splitnerf::glue
