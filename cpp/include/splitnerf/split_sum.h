// Split-sum shading: the table of the lobe's integrals, the direction at which the pre-integrated light is
// asked, and the shading of one point, each with its adjoint directly below it.
//
// Source: SplitNeRF Eq. (6)-(10), (17); Karis 2013 for the split sum.
#pragma once

#include "splitnerf/ggx.h"
#include "splitnerf/vec.h"

namespace splitnerf {

inline constexpr int kLutSize = 32;        // texels along sqrt(n.v) and along roughness
inline constexpr int kLutChannels = 4;     // F1, F2, chi, E_d
inline constexpr double kMinNdotV = 1e-4;  // n.v is clamped to [kMinNdotV, 1]

// [kLutSize roughness][kLutSize sqrt(n.v)][F1, F2, chi, E_d] float32, computed once per process.
// Texel i stands at i / (kLutSize - 1) on both axes.
//   F1 = int D V (1 - (1 - v.h)^5) (n.l) dl,  F2 the same with (1 - v.h)^5:  E = F0 F1 + F2 with Schlick's Fresnel term
//   chi places the mean direction of the lobe between normal and reflection, see query_direction.
//   E_d = int D V F_d (n.l) dl with the exact Fresnel term of a dielectric, fresnel_dielectric; at most 1 - 0.01
SPLITNERF_API const float* brdf_lut();

// One entry of the table by quadrature over 2 n_points microfacet normals.
struct LobeIntegrals {
  double f1, f2, chi, dielectric;
};
SPLITNERF_API LobeIntegrals integrate_brdf(double n_dot_v, double roughness, int n_points);

// Values and partial derivatives of the table at one point. Those by n.v are zero where it is clamped, those by
// roughness outside [0, 1].
template <class T> struct LutSample {
  Vec3<T> value;  // F1, F2, chi
  Vec3<T> d_n_dot_v, d_roughness;
  T rest;  // 1 - chi, which the difference would lose where chi is close to 1
  // 1 - F1 - F2, what a lobe that reflects all light loses by single scattering, and its derivatives: on smooth surfaces
  // close to 0, where those of F1 and F2 cancel
  T lost, lost_by_n_dot_v, lost_by_roughness;
  T dielectric, dielectric_by_n_dot_v, dielectric_by_roughness;  // E_d
  T beyond_dielectric;                                           // F2 - E_d: at grazing angles both are close to 1
};

// 1 - a - b of shares, the larger one first: that difference has no rounding.
template <class T> SPLITNERF_HD T rest_of_shares(T a, T b) { return (T(1) - max_of(a, b)) - min_of(a, b); }

// Between four nodes of the table: v01 follows v00 along n.v, v10 along roughness; derivatives per interval, from
// differences of nodes, which are exact where neighbours are close.
template <class T> struct Bilinear {
  T value, along_n_dot_v, along_roughness;
};
template <class T> SPLITNERF_HD Bilinear<T> bilinear(T v00, T v01, T v10, T v11, T fx, T fy) {
  return {lerp(lerp(v00, v01, fx), lerp(v10, v11, fx), fy), lerp(v01 - v00, v11 - v10, fy),
          lerp(v10 - v00, v11 - v01, fx)};
}

// Bilinear in (sqrt(n.v), roughness).
template <class T> SPLITNERF_HD LutSample<T> sample_brdf_lut(const float* lut, T n_dot_v, T roughness) {
  const T nv = clamp(n_dot_v, T(kMinNdotV), T(1));
  const T root = std::sqrt(nv);
  const T x = root * T(kLutSize - 1), y = clamp(roughness, T(0), T(1)) * T(kLutSize - 1);
  const int x0 = clamp(static_cast<int>(x), 0, kLutSize - 2), y0 = clamp(static_cast<int>(y), 0, kLutSize - 2);
  const T fx = x - T(x0), fy = y - T(y0);
  const bool nv_free = n_dot_v > T(kMinNdotV) && n_dot_v < T(1);
  const bool roughness_free = roughness >= T(0) && roughness <= T(1);
  const T dx = nv_free ? T(kLutSize - 1) * T(0.5) / root : T(0), dy = roughness_free ? T(kLutSize - 1) : T(0);
  // Indices, not pointers: so a loop over points turns these reads into gathers.
  const int n00 = (y0 * kLutSize + x0) * kLutChannels, n01 = n00 + kLutChannels;
  const int n10 = n00 + kLutSize * kLutChannels, n11 = n10 + kLutChannels;
  const auto entry = [&](int c) {
    return bilinear(T(lut[n00 + c]), T(lut[n01 + c]), T(lut[n10 + c]), T(lut[n11 + c]), fx, fy);
  };
  LutSample<T> s;
  SPLITNERF_UNROLL for (int c = 0; c < 3; ++c) {
    const Bilinear<T> e = entry(c);
    s.value[c] = e.value, s.d_n_dot_v[c] = e.along_n_dot_v * dx, s.d_roughness[c] = e.along_roughness * dy;
  }
  const Bilinear<T> dielectric = entry(3);
  s.dielectric = dielectric.value;
  s.dielectric_by_n_dot_v = dielectric.along_n_dot_v * dx, s.dielectric_by_roughness = dielectric.along_roughness * dy;
  const auto rest = [&](int node) { return T(1) - T(lut[node + 2]); };
  s.rest = bilinear(rest(n00), rest(n01), rest(n10), rest(n11), fx, fy).value;
  const auto lost_at = [&](int node) { return rest_of_shares(T(lut[node]), T(lut[node + 1])); };
  const Bilinear<T> lost = bilinear(lost_at(n00), lost_at(n01), lost_at(n10), lost_at(n11), fx, fy);
  const auto beyond = [&](int node) { return T(lut[node + 1]) - T(lut[node + 3]); };
  s.beyond_dielectric = bilinear(beyond(n00), beyond(n01), beyond(n10), beyond(n11), fx, fy).value;
  s.lost = lost.value, s.lost_by_n_dot_v = lost.along_n_dot_v * dx, s.lost_by_roughness = lost.along_roughness * dy;
  return s;
}

// ---- the direction at which g is asked -------------------------------------------------------
//
// g assumes n = v = w_r. Asking it at the mean direction of the true lobe,
//   d = normalize((1 - k) n + k w_r),  k = lerp(1, chi(n.v, roughness), smoothstep(0.3, 0.4, roughness)),
// removes most of that assumption's error; k = 1 (w_r itself) is the paper's form. The normal is
// turned towards the viewer first.

template <class T> SPLITNERF_HD T smoothstep(T lo, T hi, T x) {
  const T t = clamp((x - lo) / (hi - lo), T(0), T(1));
  return t * t * (T(3) - T(2) * t);
}
template <class T> SPLITNERF_HD T smoothstep_derivative(T lo, T hi, T x) {
  const T t = clamp((x - lo) / (hi - lo), T(0), T(1));
  return T(6) * t * (T(1) - t) / (hi - lo);
}

// +1 where the normal faces the viewer, -1 where it must be turned.
template <class T> SPLITNERF_HD T facing(Vec3<T> normal, Vec3<T> view) {
  return dot(normal, view) < T(0) ? T(-1) : T(1);
}

template <class T> SPLITNERF_HD Vec3<T> reflect(Vec3<T> normal, Vec3<T> view) {
  return normal * (T(2) * dot(normal, view)) - view;
}

inline constexpr double kQueryBlendStart = 0.3, kQueryBlendEnd = 0.4;

template <class T>
SPLITNERF_HD Vec3<T> query_direction(const float* lut, bool mean, Vec3<T> normal, Vec3<T> view, T roughness) {
  const Vec3<T> n = normal * facing(normal, view);
  const Vec3<T> w_r = reflect(n, view);
  if (!mean) return w_r;
  const T blend = smoothstep(T(kQueryBlendStart), T(kQueryBlendEnd), roughness);
  const T rest = blend * sample_brdf_lut(lut, dot(n, view), roughness).rest;  // 1 - k
  return normalize(n * rest + w_r * (T(1) - rest));
}

template <class T> struct QueryDirectionGrad {
  Vec3<T> normal;
  T roughness;
};

template <class T>
SPLITNERF_HD QueryDirectionGrad<T> query_direction_backward(const float* lut, bool mean, Vec3<T> normal, Vec3<T> view,
                                                            T roughness, Vec3<T> grad) {
  const T sign = facing(normal, view);
  const Vec3<T> n = normal * sign;
  const T nv = dot(n, view);
  const Vec3<T> w_r = reflect(n, view);
  QueryDirectionGrad<T> out{{T(0), T(0), T(0)}, T(0)};
  Vec3<T> grad_n{T(0), T(0), T(0)}, grad_w_r = grad;
  T grad_nv = T(0);
  if (mean) {
    const T lo = T(kQueryBlendStart), hi = T(kQueryBlendEnd), blend = smoothstep(lo, hi, roughness);
    const LutSample<T> s = sample_brdf_lut(lut, nv, roughness);
    const T rest = blend * s.rest, k = T(1) - rest;
    // d = normalize(n (1 - k) + w_r k)
    const Vec3<T> grad_a = normalize_backward(n * rest + w_r * k, grad);
    grad_n = grad_a * rest;
    grad_w_r = grad_a * k;
    // k = 1 + blend (chi - 1)
    // grad_a stands on n rest + w_r k, so its product with w_r - n follows from the shorter of the two alone.
    const bool mirrors = square(k) > square(rest) * dot(n, n);
    const T grad_k = mirrors ? -dot(grad_a, n) / k : dot(grad_a, w_r) / rest;
    grad_nv = grad_k * blend * s.d_n_dot_v.z;
    out.roughness = grad_k * (blend * s.d_roughness.z - smoothstep_derivative(lo, hi, roughness) * s.rest);
  }
  // w_r = 2 nv n - view,  nv = n . view
  grad_n += grad_w_r * (T(2) * nv);
  grad_nv += T(2) * dot(grad_w_r, n);
  grad_n += view * grad_nv;
  out.normal = grad_n * sign;
  return out;
}

// ---- shading ---------------------------------------------------------------------------------

// exact: a metal and a diffuse base under a dielectric layer, mixed: the path tracer's BSDF, principled.h.
// paper: one Fresnel term of F0 = 0.04 (1 - m) + m albedo, counted twice.
enum class FresnelMode : int { kExact = 0, kPaper = 1 };

struct ShadeOptions {
  FresnelMode fresnel = FresnelMode::kExact;
  // Multiple-scattering energy compensation E [1 + F0 (1 / (F1 + F2) - 1)], what Blender's
  // Principled BSDF does. Source: Turquin 2019, Eq. (16).
  bool compensate = false;
};

inline constexpr double kDielectricF0 = 0.04;

// Reflectance at normal incidence of one channel in the mode paper.
template <class T> SPLITNERF_HD T normal_reflectance(T metallic, T albedo) {
  return T(kDielectricF0) * (T(1) - metallic) + metallic * albedo;
}

// Effective Fresnel colour Fr = F0 + (1 - rho - F0)(1 - n.v)^5 of one channel that multiplies F1 in the mode paper, and its
// partial derivatives. Source: SplitNeRF Eq. (7).
template <class T> struct FresnelTerm {
  T value, d_f0, d_roughness, d_n_dot_v;
  T rest;  // 1 - Fr, which the difference would lose where both are close to 1
};
template <class T> SPLITNERF_HD FresnelTerm<T> fresnel_term(T f0, T roughness, T n_dot_v) {
  const T nv = clamp(n_dot_v, T(0), T(1)), c = T(1) - nv, c5 = pow5(c);
  const T inner = nv * (T(1) + c * (T(1) + c * (T(1) + c * (T(1) + c))));  // 1 - c^5
  const T edge = T(1) - roughness - f0;
  const bool nv_free = n_dot_v > T(0) && n_dot_v < T(1);
  return {f0 + edge * c5, inner, -c5, nv_free ? T(-5) * edge * square(c * c) : T(0),
          (T(1) - f0) * inner + roughness * c5};
}

// What multiple scattering adds to the specular lobe of one channel, a factor, and its partial derivatives by Fr, and
// by lost over Fr, which may be so small that its products have no float:
// 1 or, compensated, 1 + Fr (1 / (F1 + F2) - 1) = 1 + Fr lost / (1 - lost).
template <class T> struct ScatteringGain {
  T value, d_fr, d_lost_over_fr;
};
template <class T> SPLITNERF_HD ScatteringGain<T> scattering_gain(T fr, T lost, bool compensate) {
  if (!compensate) return {T(1), T(0), T(0)};
  const T inv_s = T(1) / (T(1) - lost);
  return {T(1) + fr * lost * inv_s, lost * inv_s, inv_s * inv_s};
}

// Directional albedo E = (Fr F1 + F2) gain of the specular lobe for one channel, and its partial derivatives. With
// F1 = 1 - F2 - lost no term of E = gain (Fr (1 - lost) + (1 - Fr) F2) is negative, and none of the derivatives by F2 and
// lost cancels another: on smooth surfaces those by F1 and F2 would.
template <class T> struct SpecularAlbedo {
  T value, d_fr, d_f2, d_lost;
  T rest;    // 1 - E
  T single;  // E without the gain
};
template <class T>
SPLITNERF_HD SpecularAlbedo<T> specular_albedo(T fr, T rest_of_fr, const LutSample<T>& table, bool compensate) {
  const T f1 = table.value.x, f2 = table.value.y, single = fr * (T(1) - table.lost) + rest_of_fr * f2;
  if (!compensate) return {single, f1, rest_of_fr, -fr, table.lost + rest_of_fr * f1, single};
  const ScatteringGain<T> gain = scattering_gain(fr, table.lost, compensate);
  const T inv_s = T(1) / (T(1) - table.lost), d_lost = rest_of_fr * fr * (f2 * inv_s * inv_s - T(1));
  const T d_fr = f1 * gain.value + single * gain.d_fr, rest = rest_of_fr * (table.lost + f1 * gain.value);
  return {single * gain.value, d_fr, rest_of_fr * gain.value, d_lost, rest, single};
}

// Directional albedo E = gain E_d of a dielectric layer; its partial derivatives are gain by E_d, and d_lost.
template <class T> struct DielectricAlbedo {
  T value, d_lost;
  T rest;  // 1 - E, at least 0.01
  ScatteringGain<T> gain;
};
template <class T> SPLITNERF_HD DielectricAlbedo<T> dielectric_albedo(const LutSample<T>& table, bool compensate) {
  const ScatteringGain<T> gain = scattering_gain(T(kDielectricF0), table.lost, compensate);
  const T value = table.dielectric * gain.value;
  return {value, table.dielectric * (T(kDielectricF0) * gain.d_lost_over_fr), T(1) - value, gain};
}

template <class T> struct ShadePoint {
  Vec3<T> normal, view, albedo;
  T roughness, metallic;
  Vec3<T> specular, diffuse;         // g(query direction, roughness) and g(n, 1)
  Vec3<T> occlusion_s, occlusion_d;  // the paper's o: 1 = open
  Vec3<T> indirect_s, indirect_d;    // light that the object itself sends to the point, in the normalisation of g
};

// Many points: [n, 3] but for roughness and metallic [n]; occlusion factors [n, 3] or [n]; indirect light, or null for none.
template <class T> struct ShadeArrays {
  T *normals, *view_dirs, *albedo, *roughness, *metallic, *specular, *diffuse, *occlusion_s, *occlusion_d;
  T *indirect_s, *indirect_d;
};

// The light that arrives at a point, of one channel.
template <class T> struct ArrivingAt {
  T specular, diffuse;
};
template <class T> SPLITNERF_HD ArrivingAt<T> arriving(const ShadePoint<T>& p, int c) {
  return {p.specular[c] * p.occlusion_s[c] + p.indirect_s[c], p.diffuse[c] * p.occlusion_d[c] + p.indirect_d[c]};
}

// Of one channel: the albedo E of the specular lobe, and the share of light that it leaves to a diffuse base.
//   exact: E = m E_m + (1 - m) E_d,  kept = 1 - E_d;  E_m = gain (albedo F1 + F2), E_d of the dielectric layer
//   paper: E = gain (Fr F1 + F2),  kept = 1 - Fr
template <class T> struct ChannelAlbedo {
  T specular, kept;
};
template <class T>
SPLITNERF_HD ChannelAlbedo<T> channel_albedo(ShadeOptions options, const LutSample<T>& table, T n_dot_v, T roughness,
                                             T metallic, T albedo) {
  if (options.fresnel == FresnelMode::kExact) {
    const SpecularAlbedo<T> metal = specular_albedo(albedo, T(1) - albedo, table, options.compensate);
    const DielectricAlbedo<T> layer = dielectric_albedo(table, options.compensate);
    return {metallic * metal.value + (T(1) - metallic) * layer.value, layer.rest};
  }
  const FresnelTerm<T> fr = fresnel_term(normal_reflectance(metallic, albedo), roughness, n_dot_v);
  return {specular_albedo(fr.value, fr.rest, table, options.compensate).value, fr.rest};
}

template <class T> struct ChannelAlbedoGrad {
  T albedo, metallic, roughness, n_dot_v;  // the last two but for what goes through the table
  T f2, lost, dielectric;                  // of the table
};
template <class T>
SPLITNERF_HD ChannelAlbedoGrad<T> channel_albedo_backward(ShadeOptions options, const LutSample<T>& table, T n_dot_v,
                                                          T roughness, T metallic, T albedo, ChannelAlbedo<T> grad) {
  if (options.fresnel == FresnelMode::kExact) {
    const SpecularAlbedo<T> metal = specular_albedo(albedo, T(1) - albedo, table, options.compensate);
    const DielectricAlbedo<T> layer = dielectric_albedo(table, options.compensate);
    const T grad_metal = grad.specular * metallic, grad_layer = grad.specular * (T(1) - metallic) - grad.kept;
    // E_m - E_d: first of single scattering, then of what the gains add.
    const T more = table.beyond_dielectric + albedo * table.value.x +
                   layer.gain.d_fr * (albedo * metal.single - T(kDielectricF0) * table.dielectric);
    return {grad_metal * metal.d_fr,
            grad.specular * more,
            T(0),
            T(0),
            grad_metal * metal.d_f2,
            grad_metal * metal.d_lost + grad_layer * layer.d_lost,
            grad_layer * layer.gain.value};
  }
  const FresnelTerm<T> fr = fresnel_term(normal_reflectance(metallic, albedo), roughness, n_dot_v);
  const SpecularAlbedo<T> e = specular_albedo(fr.value, fr.rest, table, options.compensate);
  const T grad_fr = grad.specular * e.d_fr - grad.kept, grad_f0 = grad_fr * fr.d_f0;
  return {grad_f0 * metallic,
          grad_f0 * (albedo - T(kDielectricF0)),
          grad_fr * fr.d_roughness,
          grad_fr * fr.d_n_dot_v,
          grad.specular * e.d_f2,
          grad.specular * e.d_lost,
          T(0)};
}

// L = (1 - m) kept albedo (o_d g(n, 1) + i_d) + E (o_s g(d, rho) + i_s), i the indirect light.
// Source: SplitNeRF Eq. (6)-(10), (17); the paper has no i.
template <class T>
SPLITNERF_HD Vec3<T> split_sum_shade(const float* lut, ShadeOptions options, const ShadePoint<T>& p) {
  const T nv = dot(p.normal, p.view) * facing(p.normal, p.view), m = p.metallic;
  const LutSample<T> table = sample_brdf_lut(lut, nv, p.roughness);
  Vec3<T> radiance;
  SPLITNERF_UNROLL for (int c = 0; c < 3; ++c) {
    const ChannelAlbedo<T> e = channel_albedo(options, table, nv, p.roughness, m, p.albedo[c]);
    const ArrivingAt<T> light = arriving(p, c);
    // The light first: shares of it may be so small that their product has no float.
    radiance[c] = light.diffuse * e.kept * (T(1) - m) * p.albedo[c] + light.specular * e.specular;
  }
  return radiance;
}

// Gradients to every field of the point but the indirect light; recomputes the forward pass and so needs nothing saved.
template <class T>
SPLITNERF_HD ShadePoint<T> split_sum_shade_backward(const float* lut, ShadeOptions options, const ShadePoint<T>& p,
                                                    Vec3<T> grad) {
  const T sign = facing(p.normal, p.view), nv = dot(p.normal, p.view) * sign, m = p.metallic;
  const LutSample<T> table = sample_brdf_lut(lut, nv, p.roughness);
  ShadePoint<T> out{};
  T grad_f2 = T(0), grad_lost = T(0), grad_dielectric = T(0), grad_nv = T(0);
  SPLITNERF_UNROLL for (int c = 0; c < 3; ++c) {
    const T albedo = p.albedo[c], l_d = p.diffuse[c], l_s = p.specular[c], o_d = p.occlusion_d[c],
            o_s = p.occlusion_s[c], g = grad[c];
    const ChannelAlbedo<T> e = channel_albedo(options, table, nv, p.roughness, m, albedo);
    const ArrivingAt<T> light = arriving(p, c);
    // radiance = kept (1 - m) albedo light.diffuse + e light.specular,  light = o l + i
    const T grad_base = light.diffuse * albedo * g;
    out.occlusion_d[c] = l_d * e.kept * (T(1) - m) * albedo * g;
    out.occlusion_s[c] = l_s * e.specular * g;
    out.diffuse[c] = g * o_d * e.kept * (T(1) - m) * albedo;
    out.specular[c] = g * o_s * e.specular;
    const ChannelAlbedoGrad<T> d = channel_albedo_backward(options, table, nv, p.roughness, m, albedo,
                                                           {light.specular * g, grad_base * (T(1) - m)});
    out.albedo[c] = light.diffuse * e.kept * (T(1) - m) * g + d.albedo;
    out.metallic += d.metallic - grad_base * e.kept;
    out.roughness += d.roughness;
    grad_nv += d.n_dot_v;
    grad_f2 += d.f2;
    grad_lost += d.lost;
    grad_dielectric += d.dielectric;
  }
  // F2, lost, E_d = table(n.v, roughness)
  out.roughness += grad_f2 * table.d_roughness.y + grad_lost * table.lost_by_roughness +
                   grad_dielectric * table.dielectric_by_roughness;
  grad_nv +=
      grad_f2 * table.d_n_dot_v.y + grad_lost * table.lost_by_n_dot_v + grad_dielectric * table.dielectric_by_n_dot_v;
  out.normal = p.view * (sign * grad_nv);
  out.view = p.normal * (sign * grad_nv);
  return out;
}

}  // namespace splitnerf
