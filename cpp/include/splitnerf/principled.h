// The metallic-roughness BSDF in the local frame of a shading point (normal along +z): value,
// sampling and density. See path_tracer.h for the equations.
#pragma once

#include "splitnerf/sampling.h"
#include "splitnerf/split_sum.h"

namespace splitnerf {

template <class T> struct BsdfValue {
  Vec3<T> f_cos;  // f (n.l), sr^-1
  T pdf;          // density of sample() at l, sr^-1
};

// The share of light reflected by single scattering of the specular lobe, of all that is reflected: visible normals are
// sampled in proportion to it, the cosine lobe for the rest. Where gain is large most reflections at visible normals
// end below the horizon, and the few above would carry weights of gain > 1 from bounce to bounce.
template <class T> SPLITNERF_HD T specular_share(const LutSample<T>& table, Vec3<T> albedo, T metallic) {
  const DielectricAlbedo<T> layer = dielectric_albedo(table, true);
  T specular = T(3) * (T(1) - metallic) * layer.value, diffuse = T(0);
  for (int c = 0; c < 3; ++c) {
    const T metal = metallic * (albedo[c] * table.value.x + table.value.y);
    specular += metal;
    diffuse += (T(1) - metallic) * layer.rest * albedo[c] +
               metal * (scattering_gain(albedo[c], table.lost, true).value - T(1));
  }
  return specular / max_of(specular + diffuse, T(1e-20));
}

template <class T> class PrincipledBsdf {
 public:
  // lut: brdf_lut(). view: unit, local, view.z > 0, towards the viewer.
  SPLITNERF_HD PrincipledBsdf(const float* lut, Vec3<T> albedo, T roughness, T metallic, Vec3<T> view)
      : view_(view), f0_(albedo), ggx_alpha_(max_of(ggx_alpha_from_roughness(roughness), T(1e-3))) {
    // Below ggx_alpha = 1e-3 rounding of h in float dominates D.
    const LutSample<T> table = sample_brdf_lut(lut, view.z, roughness);
    const DielectricAlbedo<T> layer = dielectric_albedo(table, true);
    dielectric_ = (T(1) - metallic) * layer.gain.value;
    for (int c = 0; c < 3; ++c) {
      metal_[c] = metallic * scattering_gain(f0_[c], table.lost, true).value;
      diffuse_[c] = (T(1) - metallic) * layer.rest * albedo[c];
    }
    specular_probability_ = specular_share(table, albedo, metallic);
  }

  SPLITNERF_HD T specular_probability() const { return specular_probability_; }

  SPLITNERF_HD BsdfValue<T> evaluate(Vec3<T> light) const {
    if (!(light.z > T(0))) return {{T(0), T(0), T(0)}, T(0)};
    const Vec3<T> h = normalize(view_ + light);
    const T v_dot_h = dot(view_, h);
    const T d_v_cos = ggx_d(ggx_alpha_, h.x * h.x + h.y * h.y) * smith_v(ggx_alpha_, view_.z, light.z) * light.z;
    const T cosine_pdf = pdf_cosine_hemisphere(light.z), dielectric = dielectric_ * fresnel_dielectric(v_dot_h);
    BsdfValue<T> out;
    for (int c = 0; c < 3; ++c) {
      out.f_cos[c] = d_v_cos * (metal_[c] * schlick(f0_[c], v_dot_h) + dielectric) + diffuse_[c] * cosine_pdf;
    }
    out.pdf = lerp(cosine_pdf, pdf_ggx_vndf(view_, h, ggx_alpha_), specular_probability_);
    return out;
  }

  // A direction from the mixture of both lobes; it may lie below the horizon, where evaluate()
  // returns zero.
  SPLITNERF_HD Vec3<T> sample(T u_lobe, T u1, T u2) const {
    if (u_lobe >= specular_probability_) return sample_cosine_hemisphere(u1, u2);
    return reflect(sample_ggx_vndf(view_, u1, u2, ggx_alpha_), view_);
  }

 private:
  // metal_ and dielectric_: the share of each times its gain
  Vec3<T> view_, f0_, metal_, diffuse_;
  T ggx_alpha_, dielectric_, specular_probability_;
};

}  // namespace splitnerf
