// light_queries and split_sum_shade as torch operators.
#include <optional>
#include <tuple>

#include "check_lut.h"
#include "device.h"

namespace splitnerf::glue {
namespace {

std::tuple<Tensor, Tensor> light_queries(Tensor normals, Tensor view_dirs, Tensor roughness, Tensor lut, bool mean) {
  const char* op = "light_queries";
  const Kind type = real_kind(op, "normals", normals);
  const Tensor n = checked(op, "normals", normals, {kAny, 3}, type);
  const int64_t points = n.size(0);
  const Tensor v = checked(op, "view_dirs", view_dirs, {points, 3}, type);
  const Tensor rho = checked(op, "roughness", roughness, {points, 1}, type);
  const Tensor table = checked_lut(op, lut, type);
  Tensor directions = empty_like_type(n, {2 * points, 3}, type), asked = empty_like_type(n, {2 * points, 1}, type);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, points,
               LightQueriesBody<T>{in<float>(table), mean, points, in<T>(n), in<T>(v), in<T>(rho), out<T>(directions),
                                   out<T>(asked)});
  });
  return {directions, asked};
}

std::tuple<Tensor, Tensor> light_queries_backward(Tensor normals, Tensor view_dirs, Tensor roughness, Tensor lut,
                                                  bool mean, Tensor grad_directions, Tensor grad_asked_roughness) {
  const char* op = "light_queries_backward";
  const Kind type = real_kind(op, "normals", normals);
  const Tensor n = checked(op, "normals", normals, {kAny, 3}, type);
  const int64_t points = n.size(0);
  const Tensor v = checked(op, "view_dirs", view_dirs, {points, 3}, type);
  const Tensor rho = checked(op, "roughness", roughness, {points, 1}, type);
  const Tensor table = checked_lut(op, lut, type);
  const Tensor g = checked(op, "grad_directions", grad_directions, {2 * points, 3}, type);
  const Tensor g_rho = checked(op, "grad_asked_roughness", grad_asked_roughness, {2 * points, 1}, type);
  Tensor grad_n = empty_like_type(n, {points, 3}, type), grad_rho = empty_like_type(n, {points, 1}, type);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, points,
               LightQueriesBackwardBody<T>{in<float>(table), mean, points, in<T>(n), in<T>(v), in<T>(rho), in<T>(g),
                                           in<T>(g_rho), out<T>(grad_n), out<T>(grad_rho)});
  });
  return {grad_n, grad_rho};
}

ShadeOptions checked_options(const char* op, int64_t fresnel_mode, bool compensate) {
  require(fresnel_mode == 0 || fresnel_mode == 1, op,
          "fresnel_mode must be 0 (exact) or 1 (paper), got " + std::to_string(fresnel_mode));
  return {static_cast<FresnelMode>(fresnel_mode), compensate};
}

// The per-point inputs, checked and contiguous. Without `diffuse`, `specular` is [2n, 3]: the diffuse light stands behind.
struct ShadeInputs {
  Tensor normals, view_dirs, albedo, roughness, metallic, specular, diffuse, occlusion_s, occlusion_d, lut;
  std::optional<Tensor> indirect_s, indirect_d;
  Kind type;
  int64_t n;
  int n_channels;
  bool is_stacked;

  ShadeInputs(const char* op, const Tensor& normals_in, const Tensor& view_dirs_in, const Tensor& albedo_in,
              const Tensor& roughness_in, const Tensor& metallic_in, const Tensor& specular_in,
              const std::optional<Tensor>& diffuse_in, const Tensor& occlusion_s_in, const Tensor& occlusion_d_in,
              const Tensor& lut_in, const std::optional<Tensor>& indirect_s_in,
              const std::optional<Tensor>& indirect_d_in)
      : type(real_kind(op, "normals", normals_in)), is_stacked(!diffuse_in) {
    normals = checked(op, "normals", normals_in, {kAny, 3}, type);
    n = normals.size(0);
    n_channels = occlusion_s_in.dim() == 2 && occlusion_s_in.size(1) == 1 ? 1 : 3;
    view_dirs = checked(op, "view_dirs", view_dirs_in, {n, 3}, type);
    albedo = checked(op, "albedo", albedo_in, {n, 3}, type);
    roughness = checked(op, "roughness", roughness_in, {n, 1}, type);
    metallic = checked(op, "metallic", metallic_in, {n, 1}, type);
    specular = checked(op, "specular", specular_in, {is_stacked ? 2 * n : n, 3}, type);
    if (!is_stacked) diffuse = checked(op, "diffuse", *diffuse_in, {n, 3}, type);
    occlusion_s = checked(op, "occlusion_s", occlusion_s_in, {n, n_channels}, type);
    occlusion_d = checked(op, "occlusion_d", occlusion_d_in, {n, n_channels}, type);
    if (indirect_s_in) indirect_s = checked(op, "indirect_s", *indirect_s_in, {n, 3}, type);
    if (indirect_d_in) indirect_d = checked(op, "indirect_d", *indirect_d_in, {n, 3}, type);
    lut = checked_lut(op, lut_in, type);
  }
  template <class T> ShadeArrays<const T> arrays() const {
    return {in<T>(normals),
            in<T>(view_dirs),
            in<T>(albedo),
            in<T>(roughness),
            in<T>(metallic),
            in<T>(specular),
            is_stacked ? in<T>(specular) + 3 * n : in<T>(diffuse),
            in<T>(occlusion_s),
            in<T>(occlusion_d),
            in_or_null<T>(indirect_s),
            in_or_null<T>(indirect_d)};
  }
};

Tensor split_sum_shade(Tensor normals, Tensor view_dirs, Tensor albedo, Tensor roughness, Tensor metallic,
                       Tensor specular, std::optional<Tensor> diffuse, Tensor occlusion_s, Tensor occlusion_d,
                       Tensor lut, int64_t fresnel_mode, bool compensate, std::optional<Tensor> indirect_s,
                       std::optional<Tensor> indirect_d) {
  const char* op = "split_sum_shade";
  const ShadeInputs p(op, normals, view_dirs, albedo, roughness, metallic, specular, diffuse, occlusion_s, occlusion_d,
                      lut, indirect_s, indirect_d);
  const ShadeOptions options = checked_options(op, fresnel_mode, compensate);
  Tensor radiance = empty_like_type(p.normals, {p.n, 3}, p.type);
  on_device(p.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, p.n, ShadeBody<T>{in<float>(p.lut), options, p.n_channels, p.arrays<T>(), out<T>(radiance)});
  });
  return radiance;
}

std::tuple<Tensor, Tensor, Tensor, Tensor, Tensor, Tensor, Tensor, Tensor, Tensor> split_sum_shade_backward(
    Tensor normals, Tensor view_dirs, Tensor albedo, Tensor roughness, Tensor metallic, Tensor specular,
    std::optional<Tensor> diffuse, Tensor occlusion_s, Tensor occlusion_d, Tensor lut, int64_t fresnel_mode,
    bool compensate, std::optional<Tensor> indirect_s, std::optional<Tensor> indirect_d, Tensor grad_radiance) {
  const char* op = "split_sum_shade_backward";
  const ShadeInputs p(op, normals, view_dirs, albedo, roughness, metallic, specular, diffuse, occlusion_s, occlusion_d,
                      lut, indirect_s, indirect_d);
  const ShadeOptions options = checked_options(op, fresnel_mode, compensate);
  const Tensor g = checked(op, "grad_radiance", grad_radiance, {p.n, 3}, p.type);
  const auto make = [&](int64_t columns) { return empty_like_type(p.normals, {p.n, columns}, p.type); };
  Tensor grad[9] = {make(3),
                    make(3),
                    make(3),
                    make(1),
                    make(1),
                    empty_like_type(p.normals, {p.specular.size(0), 3}, p.type),
                    empty_like_type(p.normals, {p.is_stacked ? 0 : p.n, 3}, p.type),
                    make(p.n_channels),
                    make(p.n_channels)};
  on_device(p.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    T* const to_diffuse = p.is_stacked ? out<T>(grad[5]) + 3 * p.n : out<T>(grad[6]);
    const ShadeArrays<T> to{out<T>(grad[0]), out<T>(grad[1]), out<T>(grad[2]), out<T>(grad[3]),
                            out<T>(grad[4]), out<T>(grad[5]), to_diffuse,      out<T>(grad[7]),
                            out<T>(grad[8]), nullptr,         nullptr};
    device.run(op, p.n, ShadeBackwardBody<T>{in<float>(p.lut), options, p.n_channels, p.arrays<T>(), in<T>(g), to});
  });
  return {grad[0], grad[1], grad[2], grad[3], grad[4], grad[5], grad[6], grad[7], grad[8]};
}

}  // namespace

SPLITNERF_OPERATORS(op) {
  op(SPLITNERF_OP(light_queries), "normals view_dirs roughness lut mean");
  op(SPLITNERF_OP(light_queries_backward), "normals view_dirs roughness lut mean grad_directions grad_asked_roughness");
  op(SPLITNERF_OP(split_sum_shade),
     "normals view_dirs albedo roughness metallic specular diffuse occlusion_s occlusion_d lut fresnel_mode compensate "
     "indirect_s indirect_d");
  op(SPLITNERF_OP(split_sum_shade_backward),
     "normals view_dirs albedo roughness metallic specular diffuse occlusion_s occlusion_d lut fresnel_mode compensate "
     "indirect_s indirect_d grad_radiance");
}

}  // namespace splitnerf::glue
