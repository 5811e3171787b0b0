// Monte Carlo shading of one point: directions from the BSDF's two lobes, the sums over incoming light
// that stand where the split sum has L_s and L_d, and the radiance that follows, each with its adjoint.
#pragma once

#include "splitnerf/group.h"
#include "splitnerf/sampling.h"
#include "splitnerf/split_sum.h"

namespace splitnerf {

// The lobe that is sampled and weighed is not narrower than this, so that D stays clear of rounding.
inline constexpr double kMinSampledAlpha = 2e-3;

template <class T> SPLITNERF_HD T sampled_alpha(T roughness) {
  return max_of(ggx_alpha_from_roughness(roughness), T(kMinSampledAlpha));
}

// A share of the n directions of a point follows the visible normals, the others the cosine. share: in [0, 1]; other
// numbers count as the nearest in it. u in [0, 1) rounds the number of the former up or down, so that its mean is
// share n, and each lobe has a lattice of its own; the first directions are those of the visible normals.
template <class T> struct LobeChoice {
  T share;
  int n, n_visible;

  SPLITNERF_HD LobeChoice(T share_, int n_, T u)
      : share(clamp(share_, T(0), T(1))), n(n_), n_visible(clamp(static_cast<int>(share * T(n_) + u), 0, n_)) {}

  // The density of both together, at a direction to the light (balance heuristic; Veach 1997). normal: turned to the
  // viewer.
  SPLITNERF_HD T pdf(Vec3<T> normal, Vec3<T> view, Vec3<T> light, T ggx_alpha) const {
    const Frame<T> frame(normal);
    const Vec3<T> v = frame.to_local(view), l = frame.to_local(light), h = normalize(v + l);
    if (!(l.z > T(0))) return T(0);
    return (T(1) - share) * pdf_cosine_hemisphere(l.z) + share * pdf_ggx_vndf(v, h, ggx_alpha);
  }
  // Direction i; it may lie below the horizon.
  SPLITNERF_HD Vec3<T> sample(Vec3<T> normal, Vec3<T> view, T ggx_alpha, int i, Vec2<T> shift) const {
    const Frame<T> frame(normal);
    if (i >= n_visible) {
      const Vec2<T> u = fibonacci_lattice<T>(i - n_visible, n - n_visible, shift);
      return frame.to_world(sample_cosine_hemisphere(u.x, u.y));
    }
    const Vec2<T> u = fibonacci_lattice<T>(i, n_visible, shift);
    const Vec3<T> v = frame.to_local(view);
    return frame.to_world(reflect(sample_ggx_vndf(v, u.x, u.y, ggx_alpha), v));
  }
};

// f without Fresnel times n.l, w = D V (n.l)+, Schlick's weight (1 - v.h)^5, the Fresnel term of a dielectric, and the
// cosine over pi.
template <class T> struct LobeWeight {
  T specular, schlick, dielectric, cosine;
};

// w and its derivatives; the half vector does not depend on the normal.
template <class T> struct LobeWeightGrad {
  LobeWeight<T> value;
  T d_ggx_alpha;
  Vec3<T> d_normal;
};

template <class T>
SPLITNERF_HD LobeWeightGrad<T> lobe_weight(Vec3<T> normal, Vec3<T> view, Vec3<T> light, T ggx_alpha) {
  const T nl = dot(normal, light), nv = max_of(dot(normal, view), T(kMinNdotV));
  LobeWeightGrad<T> out{{T(0), T(0), T(0), T(0)}, T(0), {T(0), T(0), T(0)}};
  if (!(nl > T(0))) return out;
  const Vec3<T> h = normalize(view + light);
  const T a2 = ggx_alpha * ggx_alpha;
  const Vec3<T> delta = normal - h;
  const T d2 = dot(delta, delta), sin2 = d2 * (T(1) - T(0.25) * d2), q = a2 + (T(1) - a2) * sin2;
  const T root_v = std::sqrt(nv * nv * (T(1) - a2) + a2), root_l = std::sqrt(nl * nl * (T(1) - a2) + a2);
  const T x = nl * root_v + nv * root_l;
  const T lobe = ggx_d(ggx_alpha, sin2) * smith_v(ggx_alpha, nv, nl), w = lobe * nl;
  const T v_dot_h = dot(view, h);
  out.value = {w, pow5(clamp(T(1) - v_dot_h, T(0), T(1))), fresnel_dielectric(v_dot_h), nl * T(1 / kPi)};
  // ln w = 2 ln a - 2 ln q + ln nl - ln x + const; what nearly cancels in its derivatives by a and by nl is summed by hand:
  //   2 / a - 4 a (1 - sin2) / q = 2 (sin2 (1 + a^2) - a^2) / (a q),  1 - nl (d x / d nl) / x = nv a^2 / (root_l x)
  const T d_x_alpha = ggx_alpha * (nl * (T(1) - nv * nv) / root_v + nv * (T(1) - nl * nl) / root_l);
  out.d_ggx_alpha = w * (T(2) * (sin2 * (T(1) + a2) - a2) / (ggx_alpha * q) - d_x_alpha / x);
  const T d_nv = nv > T(kMinNdotV) ? -(root_l + nl * nv * (T(1) - a2) / root_v) / x : T(0);
  const T d_sin2 = -T(2) * (T(1) - a2) / q;
  out.d_normal = light * (lobe * (nv * a2 / (root_l * x))) + (view * d_nv + delta * (d_sin2 * (T(2) - d2))) * w;
  return out;
}

// Sums over the n directions of a point, per channel, radiance L_i past the object itself:
//   all     = 1/n sum w_i L_i / p_i             grazing    = 1/n sum w_i (1 - v.h_i)^5 L_i / p_i
//   diffuse = 1/n sum (n.l_i)+ / pi L_i / p_i   dielectric = 1/n sum w_i F_d(v.h_i) L_i / p_i
// so that the specular light with Schlick's Fresnel term is F0 (all - grazing) + grazing.
template <class T> struct LightSums {
  Vec3<T> all, grazing, diffuse, dielectric;
};
inline constexpr int kLightSums = 4;

// incoming(i) says where light comes from, 1 / (n p_i), or the solid angle of a fixed set of directions, and L_i.
template <class T> struct IncomingLight {
  Vec3<T> direction;
  T measure;  // 0: does not count
  Vec3<T> radiance;
};
// As [4, 3] numbers side by side.
template <class T> SPLITNERF_HD LightSums<T> load_sums(const T* sums) {
  return {load3(sums), load3(sums + 3), load3(sums + 6), load3(sums + 9)};
}
template <class T> SPLITNERF_HD void store_sums(T* to, const LightSums<T>& s) {
  store3(to, s.all), store3(to + 3, s.grazing), store3(to + 6, s.diffuse), store3(to + 9, s.dielectric);
}

// The threads of the group share the directions; all of them get the sums.
template <class T, class Group, class Incoming>
SPLITNERF_HD LightSums<T> sum_light(const Group& group, Vec3<T> normal, Vec3<T> view, T roughness, int n,
                                    Incoming incoming) {
  const Vec3<T> facing_normal = normal * facing(normal, view);
  const T ggx_alpha = sampled_alpha(roughness);
  LightSums<T> sums{};
  for (int i = group.lane(); i < n; i += Group::size) {
    const IncomingLight<T> light = incoming(i);
    if (!(light.measure > T(0))) continue;
    const LobeWeight<T> w = lobe_weight(facing_normal, view, light.direction, ggx_alpha).value;
    const Vec3<T> share = light.radiance * light.measure;
    sums.all += share * w.specular;
    sums.grazing += share * (w.specular * w.schlick);
    sums.diffuse += share * w.cosine;
    sums.dielectric += share * (w.specular * w.dielectric);
  }
  return {sum3(group, sums.all), sum3(group, sums.grazing), sum3(group, sums.diffuse), sum3(group, sums.dielectric)};
}

template <class T> struct LightSumsGrad {
  Vec3<T> normal;
  T roughness;
};

// Gradients to normal and roughness; receive(i, gradient) takes that to L_i. Directions and measures are taken as given:
// the integral does not depend on them.
template <class T, class Group, class Incoming, class Receive>
SPLITNERF_HD LightSumsGrad<T> sum_light_backward(const Group& group, Vec3<T> normal, Vec3<T> view, T roughness, int n,
                                                 Incoming incoming, const LightSums<T>& grad, Receive receive) {
  const T sign = facing(normal, view), ggx_alpha = sampled_alpha(roughness);
  const Vec3<T> facing_normal = normal * sign;
  LightSumsGrad<T> out{{T(0), T(0), T(0)}, T(0)};
  T grad_alpha = T(0);
  for (int i = group.lane(); i < n; i += Group::size) {
    Vec3<T> grad_share{T(0), T(0), T(0)};
    const IncomingLight<T> light = incoming(i);
    if (light.measure > T(0)) {
      const LobeWeightGrad<T> w = lobe_weight(facing_normal, view, light.direction, ggx_alpha);
      const Vec3<T> share = light.radiance * light.measure;
      const Vec3<T> grad_specular = grad.all + grad.grazing * w.value.schlick + grad.dielectric * w.value.dielectric;
      grad_share = (grad_specular * w.value.specular + grad.diffuse * w.value.cosine) * light.measure;
      const T grad_w = dot(grad_specular, share);
      grad_alpha += grad_w * w.d_ggx_alpha;
      out.normal += w.d_normal * grad_w;
      if (w.value.cosine > T(0)) out.normal += light.direction * (dot(grad.diffuse, share) * T(1 / kPi));
    }
    receive(i, grad_share);
  }
  out.normal = sum3(group, out.normal) * sign;
  grad_alpha = group.sum(grad_alpha);
  // ggx_alpha = roughness^2 above its floor
  out.roughness = roughness * roughness > T(kMinSampledAlpha) ? grad_alpha * T(2) * roughness : T(0);
  return out;
}

// Light from n directions that all points share, and what of it arrives at each.
template <class T> struct SharedLight {
  int n;
  const T *directions, *solid_angles, *radiance;  // [n, 3], [n], [n, 3]
  const T *visible, *sent;                        // [points, n]; [points, n, 3] what arrives beside it, or null
};
template <class T> struct SummedPoint {
  Vec3<T> normal, view, albedo;
  T roughness, metallic;
  LightSums<T> light;
};

// L = m gain_m (albedo (all - grazing) + grazing) + (1 - m) (gain_d dielectric + (1 - E) albedo diffuse): the integral
// of the path tracer's BSDF, principled.h; E of the dielectric layer.        Source: SplitNeRF Eq. (4)-(6).
template <class T> SPLITNERF_HD Vec3<T> shade_sums(const float* lut, bool compensate, const SummedPoint<T>& p) {
  const T nv = dot(p.normal, p.view) * facing(p.normal, p.view), m = p.metallic;
  const LutSample<T> table = sample_brdf_lut(lut, nv, p.roughness);
  const DielectricAlbedo<T> layer = dielectric_albedo(table, compensate);
  Vec3<T> radiance;
  for (int c = 0; c < 3; ++c) {
    const T albedo = p.albedo[c], gain = scattering_gain(albedo, table.lost, compensate).value;
    const T reflected = albedo * (p.light.all[c] - p.light.grazing[c]) + p.light.grazing[c];
    // The light first: shares of it may be so small that their product has no float.
    radiance[c] = reflected * gain * m + p.light.dielectric[c] * layer.gain.value * (T(1) - m) +
                  p.light.diffuse[c] * layer.rest * (T(1) - m) * albedo;
  }
  return radiance;
}

// Gradients to every field of the point; recomputes the forward pass.
template <class T>
SPLITNERF_HD SummedPoint<T> shade_sums_backward(const float* lut, bool compensate, const SummedPoint<T>& p,
                                                Vec3<T> grad) {
  const T sign = facing(p.normal, p.view), nv = dot(p.normal, p.view) * sign, m = p.metallic;
  const LutSample<T> table = sample_brdf_lut(lut, nv, p.roughness);
  const DielectricAlbedo<T> layer = dielectric_albedo(table, compensate);
  SummedPoint<T> out{};
  T grad_layer = T(0), grad_lost = T(0);
  for (int c = 0; c < 3; ++c) {
    const T albedo = p.albedo[c], diffuse = p.light.diffuse[c], dielectric = p.light.dielectric[c], g = grad[c];
    const T spread = p.light.all[c] - p.light.grazing[c], reflected = albedo * spread + p.light.grazing[c];
    const ScatteringGain<T> gain = scattering_gain(albedo, table.lost, compensate);
    // radiance = m gain reflected + (1 - m) (layer.gain dielectric + layer.rest albedo diffuse)
    out.light.all[c] = g * m * gain.value * albedo;
    out.light.grazing[c] = g * m * gain.value * (T(1) - albedo);
    out.light.diffuse[c] = g * (T(1) - m) * layer.rest * albedo;
    out.light.dielectric[c] = g * (T(1) - m) * layer.gain.value;
    const T grad_gain = g * reflected * m;
    out.albedo[c] = g * spread * gain.value * m + grad_gain * gain.d_fr + g * diffuse * layer.rest * (T(1) - m);
    out.metallic += g * reflected * gain.value - g * dielectric * layer.gain.value - g * diffuse * layer.rest * albedo;
    grad_layer -= g * diffuse * albedo * (T(1) - m);
    grad_lost += grad_gain * albedo * gain.d_lost_over_fr +
                 g * dielectric * (T(kDielectricF0) * layer.gain.d_lost_over_fr) * (T(1) - m);
  }
  grad_lost += grad_layer * layer.d_lost;
  const T grad_dielectric = grad_layer * layer.gain.value;
  // lost, E_d = table(n.v, roughness)
  out.roughness = grad_lost * table.lost_by_roughness + grad_dielectric * table.dielectric_by_roughness;
  const T grad_nv = grad_lost * table.lost_by_n_dot_v + grad_dielectric * table.dielectric_by_n_dot_v;
  out.normal = p.view * (sign * grad_nv);
  out.view = p.normal * (sign * grad_nv);
  return out;
}

// The fields of SummedPoint as arrays, 3 values each but for roughness and metallic; sums [n, 4, 3] in the order of LightSums.
template <class T> struct SummedArrays {
  T *normals, *view_dirs, *albedo, *roughness, *metallic, *sums;
};

}  // namespace splitnerf
