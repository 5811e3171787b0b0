// Octahedral maps of the sphere: the faces |x| + |y| + |z| = 1 unfolded to the square [-1, 1]^2, +z in
// its centre, -z in its four corners. Texel (i, j) of an n x n map, index j n + i, covers
// u = 2 (i ... i + 1)/n - 1 and v likewise by j.
//
// Central projection from flat faces: texel borders are great-circle arcs, and du dv on the square
// spans du dv / |p|^3 steradians, p the point of the face.
// Source: Praun and Hoppe 2003; Engelhardt and Dachsbacher 2008.
#pragma once

#include <cstdint>

#include "splitnerf/sampling.h"
#include "splitnerf/vec.h"

namespace splitnerf {

template <class T> SPLITNERF_HD T sign_of(T x) { return x < T(0) ? T(-1) : T(1); }

// The square's point of a direction of any length but zero.
template <class T> SPLITNERF_HD Vec2<T> octahedral_encode(Vec3<T> w) {
  const T inv = T(1) / (std::fabs(w.x) + std::fabs(w.y) + std::fabs(w.z));
  const T x = w.x * inv, y = w.y * inv;
  if (w.z >= T(0)) return {x, y};
  return {(T(1) - std::fabs(y)) * sign_of(x), (T(1) - std::fabs(x)) * sign_of(y)};
}

// Adjoint of octahedral_encode. It does not depend on w's length, so the gradient is tangential.
template <class T> SPLITNERF_HD Vec3<T> octahedral_encode_backward(Vec3<T> w, Vec2<T> grad) {
  const T inv = T(1) / (std::fabs(w.x) + std::fabs(w.y) + std::fabs(w.z));
  const T sx = sign_of(w.x), sy = sign_of(w.y), fold = -sx * sy;
  const T gx = w.z >= T(0) ? grad.x : fold * grad.y, gy = w.z >= T(0) ? grad.y : fold * grad.x;
  // (x, y) = (w.x, w.y) / (|w.x| + |w.y| + |w.z|)
  const T along = (gx * w.x + gy * w.y) * inv;
  return {(gx - sx * along) * inv, (gy - sy * along) * inv, -sign_of(w.z) * along * inv};
}

// The point of the octahedron over a point of the square, not normalised.
template <class T> SPLITNERF_HD Vec3<T> octahedral_point(Vec2<T> uv) {
  const T z = T(1) - std::fabs(uv.x) - std::fabs(uv.y);
  if (z >= T(0)) return {uv.x, uv.y, z};
  return {(T(1) - std::fabs(uv.y)) * sign_of(uv.x), (T(1) - std::fabs(uv.x)) * sign_of(uv.y), z};
}

template <class T> SPLITNERF_HD Vec2<T> octahedral_texel_centre(int n, int i, int j) {
  return {(T(2) * T(i) + T(1)) / T(n) - T(1), (T(2) * T(j) + T(1)) / T(n) - T(1)};
}

// Index of texel (i, j), each in -1 ... n: beyond an edge stands the same edge, mirrored at its middle.
SPLITNERF_HD int octahedral_wrap(int n, int i, int j) {
  if (i < 0 || i >= n) i = i < 0 ? 0 : n - 1, j = n - 1 - j;
  if (j < 0 || j >= n) j = j < 0 ? 0 : n - 1, i = n - 1 - i;
  return j * n + i;
}

// The four texels around a point of the square and where it lies between their centres.
template <class T> struct OctahedralFootprint {
  int texel[4];  // (i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)
  T fx, fy;

  SPLITNERF_HD T weight(int k) const { return (k & 1 ? fx : T(1) - fx) * (k & 2 ? fy : T(1) - fy); }
};

template <class T> SPLITNERF_HD OctahedralFootprint<T> octahedral_footprint(int n, Vec2<T> uv) {
  const T half = T(0.5) * T(n), x = uv.x * half + (half - T(0.5)), y = uv.y * half + (half - T(0.5));
  // Written so that a NaN gives texel 0 and NaN weights.
  const T x0 = x > T(0) ? std::floor(min_of(x, T(n - 1))) : x < T(0) ? T(-1) : T(0);
  const T y0 = y > T(0) ? std::floor(min_of(y, T(n - 1))) : y < T(0) ? T(-1) : T(0);
  const int i = static_cast<int>(x0), j = static_cast<int>(y0);
  OctahedralFootprint<T> f;
  f.fx = x - x0, f.fy = y - y0;
  if (i >= 0 && j >= 0 && i + 1 < n && j + 1 < n) {
    const int first = j * n + i;
    f.texel[0] = first, f.texel[1] = first + 1, f.texel[2] = first + n, f.texel[3] = first + n + 1;
  } else {
    for (int k = 0; k < 4; ++k) f.texel[k] = octahedral_wrap(n, i + (k & 1), j + (k >> 1));
  }
  return f;
}

}  // namespace splitnerf
