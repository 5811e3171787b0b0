// prefilter_light, sample_ggx_lobe and occlusion_factors as torch operators.
#include <cmath>
#include <tuple>

#include "device.h"

namespace splitnerf::glue {
namespace {

bool all_finite(const Tensor& values, ScalarType type) {
  bool finite = true;
  dispatch_real(type, [&](auto zero) {
    using T = decltype(zero);
    const T* value = in<T>(values);
    for (int64_t i = 0; i < values.numel(); ++i) finite &= std::isfinite(value[i]);
  });
  return finite;
}

std::tuple<Tensor, Tensor> prefilter_light(Tensor query_dirs, Tensor roughness, Tensor light_dirs, Tensor light) {
  const char* op = "prefilter_light";
  const Kind type = real_kind(op, "light", light);
  const Tensor q = checked(op, "query_dirs", query_dirs, {kAny, 3}, type);
  const Tensor rho = checked(op, "roughness", roughness, {q.size(0), 1}, type);
  const Tensor d = checked(op, "light_dirs", light_dirs, {kAny, 3}, type);
  const Tensor l = checked(op, "light", light, {d.size(0), 3}, type);
  require(d.size(0) > 0 || q.size(0) == 0, op, "light_dirs must hold at least one direction");
  Tensor gbar = empty_like_type(q, {q.size(0), 3}, type), total = empty_like_type(q, {q.size(0)}, type);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.prefilter_light(q.size(0), in<T>(q), in<T>(rho), d.size(0), in<T>(d), in<T>(l), out<T>(gbar), out<T>(total));
  });
  return {gbar, total};
}

Tensor prefilter_light_backward(Tensor query_dirs, Tensor roughness, Tensor total, Tensor grad_gbar,
                                Tensor light_dirs) {
  const char* op = "prefilter_light_backward";
  const Kind type = real_kind(op, "grad_gbar", grad_gbar);
  const Tensor q = checked(op, "query_dirs", query_dirs, {kAny, 3}, type);
  const Tensor rho = checked(op, "roughness", roughness, {q.size(0), 1}, type);
  const Tensor w = checked(op, "total", total, {q.size(0)}, type);
  const Tensor g = checked(op, "grad_gbar", grad_gbar, {q.size(0), 3}, type);
  const Tensor d = checked(op, "light_dirs", light_dirs, {kAny, 3}, type);
  Tensor grad_light = empty_like_type(q, {d.size(0), 3}, type);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.prefilter_light_backward(q.size(0), in<T>(q), in<T>(rho), in<T>(w), in<T>(g), d.size(0), in<T>(d),
                                    out<T>(grad_light));
  });
  return grad_light;
}

std::tuple<Tensor, Tensor> occlusion_factors(int64_t scene, Tensor positions, Tensor normals, Tensor lobe_dirs,
                                             Tensor roughness, Tensor environment, int64_t n_diffuse_rays,
                                             int64_t n_specular_rays, double offset, int64_t seed) {
  const char* op = "occlusion_factors";
  const Kind type = real_kind(op, "positions", positions);
  const Tensor x = checked(op, "positions", positions, {kAny, 3}, type);
  const Tensor n = checked(op, "normals", normals, {x.size(0), 3}, type);
  const Tensor d = checked(op, "lobe_dirs", lobe_dirs, {x.size(0), 3}, type);
  const Tensor rho = checked(op, "roughness", roughness, {x.size(0), 1}, type);
  const Tensor env = checked(op, "environment", environment, {kAny, kAny, 3}, type);
  require(env.size(0) > 0 && env.size(1) > 0, op, "environment must hold at least one texel");
  require(env.numel() <= INT32_MAX, op, "environment must hold less than 2^31 numbers");
  require(all_finite(env, type), op, "environment must be finite");
  require(n_diffuse_rays > 0 && n_specular_rays > 0 && n_diffuse_rays <= 1 << 20 && n_specular_rays <= 1 << 20, op,
          "n_diffuse_rays and n_specular_rays must be in [1, 2^20]");
  const OcclusionOptions options{static_cast<int>(n_diffuse_rays), static_cast<int>(n_specular_rays),
                                 static_cast<float>(offset), static_cast<uint32_t>(seed)};
  Tensor o_d = empty_like_type(x, {x.size(0), 3}, type), o_s = empty_like_type(x, {x.size(0), 3}, type);
  const auto mesh = get_scene(scene);
  dispatch_real(type, [&](auto zero) {
    using T = decltype(zero);
    cpu::occlusion_factors(*mesh, options, x.size(0), in<T>(x), in<T>(n), in<T>(d), in<T>(rho),
                           static_cast<int>(env.size(0)), static_cast<int>(env.size(1)), in<T>(env), out<T>(o_d),
                           out<T>(o_s));
  });
  return {o_d, o_s};
}

Tensor sample_ggx_lobe(Tensor axes, Tensor roughness, int64_t n_samples, int64_t seed) {
  const char* op = "sample_ggx_lobe";
  const Kind type = real_kind(op, "axes", axes);
  const Tensor a = checked(op, "axes", axes, {kAny, 3}, type);
  const Tensor rho = checked(op, "roughness", roughness, {a.size(0), 1}, type);
  require(n_samples > 0 && n_samples <= 1 << 20, op, "n_samples must be in [1, 2^20]");
  Tensor directions = empty_like_type(a, {a.size(0), n_samples, 3}, type);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, a.size(0),
               SampleLobeBody<T>{in<T>(a), in<T>(rho), static_cast<int>(n_samples), static_cast<uint32_t>(seed),
                                 out<T>(directions)});
  });
  return directions;
}

}  // namespace

SPLITNERF_OPERATORS(op) {
  op(SPLITNERF_OP(prefilter_light), "query_dirs roughness light_dirs light");
  op(SPLITNERF_OP(prefilter_light_backward), "query_dirs roughness total grad_gbar light_dirs");
  op(SPLITNERF_OP(sample_ggx_lobe), "axes roughness n_samples seed");
}

// Rays are traced on the CPU.
SPLITNERF_CPU_OPERATORS(op) {
  op(SPLITNERF_OP(occlusion_factors),
     "scene positions normals lobe_dirs roughness environment n_diffuse_rays n_specular_rays offset seed");
}

}  // namespace splitnerf::glue
