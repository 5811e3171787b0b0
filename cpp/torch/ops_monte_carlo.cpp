// monte_carlo_light, summed_light and shade_sums as torch operators.
#include <optional>
#include <tuple>

#include "check_lut.h"
#include "device.h"

namespace splitnerf::glue {
namespace {

// What both directions of monte_carlo_light read.
struct Inputs {
  Kind type;
  Tensor normals, view_dirs, roughness, light_dirs, pdf, radiance;

  Inputs(const char* op, const Tensor& n, const Tensor& v, const Tensor& rho, const Tensor& l, const Tensor& p,
         const Tensor& r)
      : type(real_kind(op, "normals", n)), normals(checked(op, "normals", n, {kAny, 3}, type)),
        view_dirs(checked(op, "view_dirs", v, {normals.size(0), 3}, type)),
        roughness(checked(op, "roughness", rho, {normals.size(0), 1}, type)),
        light_dirs(checked(op, "light_dirs", l, {normals.size(0), kAny, 3}, type)),
        pdf(checked(op, "pdf", p, {normals.size(0), light_dirs.size(1)}, type)),
        radiance(checked(op, "radiance", r, {normals.size(0), light_dirs.size(1), 3}, type)) {
    require(n_samples() > 0 || n_points() == 0, op, "light_dirs must hold at least one direction a point");
  }
  int64_t n_points() const { return normals.size(0); }
  int n_samples() const { return static_cast<int>(light_dirs.size(1)); }
  template <class T> DrawnLight<T> light() const {
    return {n_samples(), in<T>(light_dirs), in<T>(pdf), in<T>(radiance)};
  }
};

Tensor monte_carlo_light(Tensor normals, Tensor view_dirs, Tensor roughness, Tensor light_dirs, Tensor pdf,
                         Tensor radiance) {
  const char* op = "monte_carlo_light";
  const Inputs i(op, normals, view_dirs, roughness, light_dirs, pdf, radiance);
  Tensor sums = empty_like_type(i.normals, {i.n_points(), kLightSums, 3}, i.type);
  on_device(i.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, i.n_points(),
               DrawnLightBody<T>{i.n_samples(), in<T>(i.normals), in<T>(i.view_dirs), in<T>(i.roughness), i.light<T>(),
                                 out<T>(sums)});
  });
  return sums;
}

std::tuple<Tensor, Tensor, Tensor> monte_carlo_light_backward(Tensor normals, Tensor view_dirs, Tensor roughness,
                                                              Tensor light_dirs, Tensor pdf, Tensor radiance,
                                                              Tensor grad_sums) {
  const char* op = "monte_carlo_light_backward";
  const Inputs i(op, normals, view_dirs, roughness, light_dirs, pdf, radiance);
  const Tensor g = checked(op, "grad_sums", grad_sums, {i.n_points(), kLightSums, 3}, i.type);
  Tensor grad_normals = empty_like_type(g, {i.n_points(), 3}, i.type);
  Tensor grad_roughness = empty_like_type(g, {i.n_points(), 1}, i.type);
  Tensor grad_radiance = empty_like_type(g, {i.n_points(), i.n_samples(), 3}, i.type);
  on_device(i.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    const ToDrawnLight<T> to_light{i.n_samples(), out<T>(grad_radiance)};
    device.run(
        op, i.n_points(),
        DrawnLightBackwardBody<T>{i.n_samples(), in<T>(i.normals), in<T>(i.view_dirs), in<T>(i.roughness), i.light<T>(),
                                  in<T>(g), out<T>(grad_normals), out<T>(grad_roughness), to_light});
  });
  return {grad_normals, grad_roughness, grad_radiance};
}

// What both directions of summed_light read.
struct SharedInputs {
  Kind type;
  Tensor normals, view_dirs, roughness, directions, solid_angles, radiance, visible, sent;

  SharedInputs(const char* op, const Tensor& n, const Tensor& v, const Tensor& rho, const Tensor& d, const Tensor& a,
               const Tensor& r, const Tensor& open, const Tensor& s)
      : type(real_kind(op, "normals", n)), normals(checked(op, "normals", n, {kAny, 3}, type)),
        view_dirs(checked(op, "view_dirs", v, {n_points(), 3}, type)),
        roughness(checked(op, "roughness", rho, {n_points(), 1}, type)),
        directions(checked(op, "directions", d, {kAny, 3}, type)),
        solid_angles(checked(op, "solid_angles", a, {directions.size(0)}, type)),
        radiance(checked(op, "radiance", r, {directions.size(0), 3}, type)),
        visible(checked(op, "visible", open, {n_points(), directions.size(0)}, type)),
        sent(checked(op, "sent", s, {s.size(0), directions.size(0), 3}, type)) {
    require(sent.size(0) == 0 || sent.size(0) == n_points(), op, "sent must hold as many points as normals, or none");
  }
  int64_t n_points() const { return normals.size(0); }
  template <class T> SharedLight<T> light() const {
    return {
        static_cast<int>(directions.size(0)), in<T>(directions), in<T>(solid_angles), in<T>(radiance), in<T>(visible),
        sent.size(0) ? in<T>(sent) : nullptr};
  }
};

Tensor summed_light(Tensor normals, Tensor view_dirs, Tensor roughness, Tensor directions, Tensor solid_angles,
                    Tensor radiance, Tensor visible, Tensor sent) {
  const char* op = "summed_light";
  const SharedInputs i(op, normals, view_dirs, roughness, directions, solid_angles, radiance, visible, sent);
  Tensor sums = empty_like_type(i.normals, {i.n_points(), kLightSums, 3}, i.type);
  on_device(i.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    const SharedLight<T> light = i.light<T>();
    device.run(
        op, i.n_points(),
        SharedLightBody<T>{light.n, in<T>(i.normals), in<T>(i.view_dirs), in<T>(i.roughness), {light}, out<T>(sums)});
  });
  return sums;
}

std::tuple<Tensor, Tensor, Tensor> summed_light_backward(Tensor normals, Tensor view_dirs, Tensor roughness,
                                                         Tensor directions, Tensor solid_angles, Tensor radiance,
                                                         Tensor visible, Tensor sent, Tensor grad_sums) {
  const char* op = "summed_light_backward";
  const SharedInputs i(op, normals, view_dirs, roughness, directions, solid_angles, radiance, visible, sent);
  const Tensor g = checked(op, "grad_sums", grad_sums, {i.n_points(), kLightSums, 3}, i.type);
  const auto like = [&](const Tensor& t) { return torch::stable::empty_like(t); };
  Tensor grad_normals = like(i.normals), grad_roughness = like(i.roughness), grad_light = like(i.radiance);
  on_device(i.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    const SharedLight<T> light = i.light<T>();
    const ToSharedLight<T> to_light{light.n, light.visible, out<T>(grad_light)};
    device.shared_light_backward(i.n_points(), SharedLightBackwardBody<T>{light.n,
                                                                          in<T>(i.normals),
                                                                          in<T>(i.view_dirs),
                                                                          in<T>(i.roughness),
                                                                          {light},
                                                                          in<T>(g),
                                                                          out<T>(grad_normals),
                                                                          out<T>(grad_roughness),
                                                                          to_light});
  });
  return {grad_normals, grad_roughness, grad_light};
}

// What both directions of shade_sums read: points with their sums, and what is mixed with them, if anything.
struct SummedInputs {
  Kind type;
  Tensor normals, view_dirs, albedo, roughness, metallic, sums, lut;
  std::optional<Tensor> other, share;

  SummedInputs(const char* op, const Tensor& n, const Tensor& v, const Tensor& a, const Tensor& rho, const Tensor& m,
               const Tensor& s, const Tensor& table, const std::optional<Tensor>& mixed,
               const std::optional<Tensor>& part)
      : type(real_kind(op, "normals", n)), normals(checked(op, "normals", n, {kAny, 3}, type)),
        view_dirs(checked(op, "view_dirs", v, {n_points(), 3}, type)),
        albedo(checked(op, "albedo", a, {n_points(), 3}, type)),
        roughness(checked(op, "roughness", rho, {n_points(), 1}, type)),
        metallic(checked(op, "metallic", m, {n_points(), 1}, type)),
        sums(checked(op, "sums", s, {n_points(), kLightSums, 3}, type)), lut(checked_lut(op, table, type)) {
    require(mixed.has_value() == part.has_value(), op, "other and share must be given both or neither");
    if (!mixed) return;
    other = checked(op, "other", *mixed, {n_points(), 3}, type);
    share = checked(op, "share", *part, {n_points()}, type);
  }
  int64_t n_points() const { return normals.size(0); }
  template <class T> SummedArrays<const T> arrays() const {
    return {in<T>(normals), in<T>(view_dirs), in<T>(albedo), in<T>(roughness), in<T>(metallic), in<T>(sums)};
  }
};

Tensor shade_sums(Tensor normals, Tensor view_dirs, Tensor albedo, Tensor roughness, Tensor metallic, Tensor sums,
                  Tensor lut, bool compensate, std::optional<Tensor> other, std::optional<Tensor> share) {
  const char* op = "shade_sums";
  const SummedInputs i(op, normals, view_dirs, albedo, roughness, metallic, sums, lut, other, share);
  Tensor radiance = empty_like_type(i.normals, {i.n_points(), 3}, i.type);
  on_device(i.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, i.n_points(),
               ShadeSumsBody<T>{in<float>(i.lut), compensate, i.arrays<T>(), in_or_null<T>(i.other),
                                in_or_null<T>(i.share), out<T>(radiance)});
  });
  return radiance;
}

std::tuple<Tensor, Tensor, Tensor, Tensor, Tensor, Tensor, Tensor> shade_sums_backward(
    Tensor normals, Tensor view_dirs, Tensor albedo, Tensor roughness, Tensor metallic, Tensor sums, Tensor lut,
    bool compensate, std::optional<Tensor> other, std::optional<Tensor> share, Tensor grad_radiance) {
  const char* op = "shade_sums_backward";
  const SummedInputs i(op, normals, view_dirs, albedo, roughness, metallic, sums, lut, other, share);
  const Tensor g = checked(op, "grad_radiance", grad_radiance, {i.n_points(), 3}, i.type);
  const auto like = [&](const Tensor& t) { return torch::stable::empty_like(t); };
  Tensor grad[7] = {like(i.normals),
                    like(i.view_dirs),
                    like(i.albedo),
                    like(i.roughness),
                    like(i.metallic),
                    like(i.sums),
                    empty_like_type(g, {i.other ? i.n_points() : 0, 3}, i.type)};
  on_device(i.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    const SummedArrays<T> to{out<T>(grad[0]), out<T>(grad[1]), out<T>(grad[2]),
                             out<T>(grad[3]), out<T>(grad[4]), out<T>(grad[5])};
    device.run(op, i.n_points(),
               ShadeSumsBackwardBody<T>{in<float>(i.lut), compensate, i.arrays<T>(), in_or_null<T>(i.share), in<T>(g),
                                        to, i.other ? out<T>(grad[6]) : nullptr});
  });
  return {grad[0], grad[1], grad[2], grad[3], grad[4], grad[5], grad[6]};
}

}  // namespace

SPLITNERF_OPERATORS(op) {
  op(SPLITNERF_OP(monte_carlo_light), "normals view_dirs roughness light_dirs pdf radiance");
  op(SPLITNERF_OP(summed_light), "normals view_dirs roughness directions solid_angles radiance visible sent");
  op(SPLITNERF_OP(summed_light_backward),
     "normals view_dirs roughness directions solid_angles radiance visible sent grad_sums");
  op(SPLITNERF_OP(monte_carlo_light_backward), "normals view_dirs roughness light_dirs pdf radiance grad_sums");
  op(SPLITNERF_OP(shade_sums), "normals view_dirs albedo roughness metallic sums lut compensate other share");
  op(SPLITNERF_OP(shade_sums_backward),
     "normals view_dirs albedo roughness metallic sums lut compensate other share grad_radiance");
}

}  // namespace splitnerf::glue
