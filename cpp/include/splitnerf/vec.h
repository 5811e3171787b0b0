// Three-vectors and the scalar helpers that every formula uses, for float and double.
#pragma once

#include <cmath>
#include <cstdint>

#include "splitnerf/config.h"

namespace splitnerf {

inline constexpr double kPi = 3.14159265358979323846;

template <class T> SPLITNERF_HD T min_of(T a, T b) { return b < a ? b : a; }
template <class T> SPLITNERF_HD T max_of(T a, T b) { return a < b ? b : a; }
template <class T> SPLITNERF_HD T clamp(T x, T lo, T hi) { return min_of(max_of(x, lo), hi); }
template <class T> SPLITNERF_HD T square(T x) { return x * x; }
template <class T> SPLITNERF_HD T lerp(T a, T b, T t) { return a + t * (b - a); }

template <class T> struct Vec2 {
  T x, y;
};

template <class T> struct Vec3 {
  T x, y, z;

  SPLITNERF_HD T& operator[](int i) { return i == 0 ? x : i == 1 ? y : z; }
  SPLITNERF_HD const T& operator[](int i) const { return i == 0 ? x : i == 1 ? y : z; }
  SPLITNERF_HD Vec3& operator+=(Vec3 b) {
    x += b.x;
    y += b.y;
    z += b.z;
    return *this;
  }
  SPLITNERF_HD Vec3& operator*=(Vec3 b) {
    x *= b.x;
    y *= b.y;
    z *= b.z;
    return *this;
  }
};

template <class T> SPLITNERF_HD Vec3<T> operator+(Vec3<T> a, Vec3<T> b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
template <class T> SPLITNERF_HD Vec3<T> operator-(Vec3<T> a, Vec3<T> b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
template <class T> SPLITNERF_HD Vec3<T> operator-(Vec3<T> a) { return {-a.x, -a.y, -a.z}; }
template <class T> SPLITNERF_HD Vec3<T> operator*(Vec3<T> a, Vec3<T> b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
template <class T> SPLITNERF_HD Vec3<T> operator*(Vec3<T> a, T s) { return {a.x * s, a.y * s, a.z * s}; }
template <class T> SPLITNERF_HD Vec3<T> operator*(T s, Vec3<T> a) { return a * s; }
template <class T> SPLITNERF_HD Vec3<T> operator/(Vec3<T> a, T s) { return a * (T(1) / s); }

template <class T> SPLITNERF_HD T dot(Vec3<T> a, Vec3<T> b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
template <class T> SPLITNERF_HD T sum(Vec3<T> a) { return a.x + a.y + a.z; }
// |a| for every finite vector: the squares of small or large numbers have no float.
template <class T> SPLITNERF_HD T length(Vec3<T> a) {
  const T largest = max_of(std::fabs(a.x), max_of(std::fabs(a.y), std::fabs(a.z)));
  const T scale = largest < T(1e-12) ? T(0x1p100) : largest > T(1e12) ? T(0x1p-100) : T(1);
  return std::sqrt(dot(a * scale, a * scale)) * (T(1) / scale);
}
template <class T> SPLITNERF_HD Vec3<T> cross(Vec3<T> a, Vec3<T> b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class T> SPLITNERF_HD Vec3<T> load3(const T* p) { return {p[0], p[1], p[2]}; }
template <class T> SPLITNERF_HD void store3(T* p, Vec3<T> v) {
  p[0] = v.x;
  p[1] = v.y;
  p[2] = v.z;
}

// Vector i of an array, or 0 where there is no array.
template <class T> SPLITNERF_HD Vec3<T> load3_if(const T* p, int64_t i) {
  return p ? load3(p + 3 * i) : Vec3<T>{T(0), T(0), T(0)};
}

// a / sqrt(|a|^2 + eps): finite, and zero for a = 0.
template <class T> SPLITNERF_HD Vec3<T> normalize(Vec3<T> a, T eps = T(1e-20)) {
  return a * (T(1) / std::sqrt(dot(a, a) + eps));
}

// Adjoint of normalize: d = normalize(a), so grad_a = (grad_d - d (d . grad_d)) / |a|.
template <class T> SPLITNERF_HD Vec3<T> normalize_backward(Vec3<T> a, Vec3<T> grad_d, T eps = T(1e-20)) {
  const T inv = T(1) / std::sqrt(dot(a, a) + eps);
  const Vec3<T> d = a * inv;
  return (grad_d - d * dot(d, grad_d)) * inv;
}

// Two tangents that complete the unit vector n to a right-handed frame, without a singular
// direction. Source: Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 2017.
template <class T> struct Frame {
  Vec3<T> tangent, bitangent, normal;

  SPLITNERF_HD explicit Frame(Vec3<T> n) : normal(n) {
    const T sign = n.z < T(0) ? T(-1) : T(1);
    const T a = T(-1) / (sign + n.z);
    const T b = n.x * n.y * a;
    tangent = {T(1) + sign * n.x * n.x * a, sign * b, -sign * n.x};
    bitangent = {b, sign + n.y * n.y * a, -n.y};
  }
  SPLITNERF_HD Vec3<T> to_world(Vec3<T> v) const { return tangent * v.x + bitangent * v.y + normal * v.z; }
  SPLITNERF_HD Vec3<T> to_local(Vec3<T> v) const { return {dot(v, tangent), dot(v, bitangent), dot(v, normal)}; }
};

}  // namespace splitnerf
