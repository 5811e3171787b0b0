// Split-sum shading of blocks of points, a point a lane, beside ShadeBody and ShadeBackwardBody: 4.6 x each (8192
// points; float32, one thread of an AMD EPYC of family 25, AVX-512).
#include "kernel_set.h"
#include "splitnerf/split_sum.h"

namespace splitnerf::SPLITNERF_ISA {
namespace {

constexpr int kLanes = 16;  // points of a block, one a lane

// One array for each component of a block of points, in the order of ShadePoint.
template <class T> struct ShadeBlock {
  alignas(64) T normal[3 * kLanes], view[3 * kLanes], albedo[3 * kLanes], roughness[kLanes], metallic[kLanes];
  T specular[3 * kLanes], diffuse[3 * kLanes], occlusion_s[3 * kLanes], occlusion_d[3 * kLanes];
  T indirect_s[3 * kLanes], indirect_d[3 * kLanes];
};

// Rows [first, first + n) of [points, kColumns] to one array a column, zeros behind them, and back. A whole block has a
// loop of its own, whose lengths are constants: that one becomes shuffles of vectors.
template <int kColumns, class T> void load_rows(const T* rows, int64_t first, int n, T* columns) {
  rows += first * kColumns;
  if (n == kLanes) {
#pragma omp simd
    for (int i = 0; i < kLanes; ++i) {
      SPLITNERF_UNROLL
      for (int c = 0; c < kColumns; ++c) columns[c * kLanes + i] = rows[i * kColumns + c];
    }
    return;
  }
  for (int i = 0; i < kLanes; ++i)
    for (int c = 0; c < kColumns; ++c) columns[c * kLanes + i] = i < n ? rows[i * kColumns + c] : T(0);
}
template <int kColumns, class T> void store_rows(const T* columns, int64_t first, int n, T* rows) {
  rows += first * kColumns;
  if (n == kLanes) {
#pragma omp simd
    for (int i = 0; i < kLanes; ++i) {
      SPLITNERF_UNROLL
      for (int c = 0; c < kColumns; ++c) rows[i * kColumns + c] = columns[c * kLanes + i];
    }
    return;
  }
  for (int i = 0; i < n; ++i)
    for (int c = 0; c < kColumns; ++c) rows[i * kColumns + c] = columns[c * kLanes + i];
}

// Occlusion factors come as one value for all channels or as three; the gradient of the one is the sum of theirs.
template <class T> void load_factors(const T* rows, int64_t first, int n, int n_channels, T* columns) {
  if (n_channels == 3) return load_rows<3>(rows, first, n, columns);
  load_rows<1>(rows, first, n, columns);
  for (int i = 0; i < kLanes; ++i) columns[kLanes + i] = columns[2 * kLanes + i] = columns[i];
}
template <class T> void store_factors(T* columns, int64_t first, int n, int n_channels, T* rows) {
  if (n_channels == 3) return store_rows<3>(columns, first, n, rows);
  for (int i = 0; i < kLanes; ++i) columns[i] += columns[kLanes + i] + columns[2 * kLanes + i];
  store_rows<1>(columns, first, n, rows);
}

// Indirect light, zeros where there is none.
template <class T> void load_indirect(const T* rows, int64_t first, int n, T* columns) {
  if (rows) return load_rows<3>(rows, first, n, columns);
  for (int i = 0; i < 3 * kLanes; ++i) columns[i] = T(0);
}

template <class T> ShadeBlock<T> load_block(const ShadeArrays<const T>& in, int64_t first, int n, int n_channels) {
  ShadeBlock<T> b;
  load_rows<3>(in.normals, first, n, b.normal);
  load_rows<3>(in.view_dirs, first, n, b.view);
  load_rows<3>(in.albedo, first, n, b.albedo);
  load_rows<1>(in.roughness, first, n, b.roughness);
  load_rows<1>(in.metallic, first, n, b.metallic);
  load_rows<3>(in.specular, first, n, b.specular);
  load_rows<3>(in.diffuse, first, n, b.diffuse);
  load_factors(in.occlusion_s, first, n, n_channels, b.occlusion_s);
  load_factors(in.occlusion_d, first, n, n_channels, b.occlusion_d);
  load_indirect(in.indirect_s, first, n, b.indirect_s);
  load_indirect(in.indirect_d, first, n, b.indirect_d);
  return b;
}

template <class T> void store_block(ShadeBlock<T>& b, int64_t first, int n, int n_channels, const ShadeArrays<T>& out) {
  store_rows<3>(b.normal, first, n, out.normals);
  store_rows<3>(b.view, first, n, out.view_dirs);
  store_rows<3>(b.albedo, first, n, out.albedo);
  store_rows<1>(b.roughness, first, n, out.roughness);
  store_rows<1>(b.metallic, first, n, out.metallic);
  store_rows<3>(b.specular, first, n, out.specular);
  store_rows<3>(b.diffuse, first, n, out.diffuse);
  store_factors(b.occlusion_s, first, n, n_channels, out.occlusion_s);
  store_factors(b.occlusion_d, first, n, n_channels, out.occlusion_d);
}

template <class T> SPLITNERF_HD Vec3<T> lane3(const T* columns, int i) {
  return {columns[i], columns[kLanes + i], columns[2 * kLanes + i]};
}
template <class T> SPLITNERF_HD void set_lane3(T* columns, int i, Vec3<T> v) {
  columns[i] = v.x, columns[kLanes + i] = v.y, columns[2 * kLanes + i] = v.z;
}
template <class T> SPLITNERF_HD ShadePoint<T> lane(const ShadeBlock<T>& b, int i) {
  return {lane3(b.normal, i),      lane3(b.view, i),       lane3(b.albedo, i),    b.roughness[i],
          b.metallic[i],           lane3(b.specular, i),   lane3(b.diffuse, i),   lane3(b.occlusion_s, i),
          lane3(b.occlusion_d, i), lane3(b.indirect_s, i), lane3(b.indirect_d, i)};
}

// One point. A function of its own: what is declared inside a simd loop would be kept in memory, once a lane.
template <FresnelMode kMode, bool kCompensate, class T>
SPLITNERF_HD void shade_lane(const float* lut, const ShadeBlock<T>& points, int i, T* radiance) {
  set_lane3(radiance, i, splitnerf::split_sum_shade(lut, {kMode, kCompensate}, lane(points, i)));
}

template <FresnelMode kMode, bool kCompensate, class T>
SPLITNERF_HD void shade_lane_backward(const float* lut, const ShadeBlock<T>& points, const T* cotangent, int i,
                                      ShadeBlock<T>& grad) {
  const ShadePoint<T> g =
      splitnerf::split_sum_shade_backward(lut, {kMode, kCompensate}, lane(points, i), lane3(cotangent, i));
  set_lane3(grad.normal, i, g.normal);
  set_lane3(grad.view, i, g.view);
  set_lane3(grad.albedo, i, g.albedo);
  grad.roughness[i] = g.roughness;
  grad.metallic[i] = g.metallic;
  set_lane3(grad.specular, i, g.specular);
  set_lane3(grad.diffuse, i, g.diffuse);
  set_lane3(grad.occlusion_s, i, g.occlusion_s);
  set_lane3(grad.occlusion_d, i, g.occlusion_d);
}

// The options are constants here, so that the lanes have nothing to ask.
template <FresnelMode kMode, bool kCompensate, class T>
void shade_block(const float* lut, const ShadeBlock<T>& points, T* radiance) {
#pragma omp simd
  for (int i = 0; i < kLanes; ++i) shade_lane<kMode, kCompensate>(lut, points, i, radiance);
}
template <FresnelMode kMode, bool kCompensate, class T>
void shade_block_backward(const float* lut, const ShadeBlock<T>& points, const T* cotangent, ShadeBlock<T>& grad) {
#pragma omp simd
  for (int i = 0; i < kLanes; ++i) shade_lane_backward<kMode, kCompensate>(lut, points, cotangent, i, grad);
}

// Calls body with the options as a type.
template <FresnelMode kMode, bool kCompensate> struct Constant {
  static constexpr FresnelMode fresnel = kMode;
  static constexpr bool compensate = kCompensate;
};
template <bool kCompensate, class Body> void with_mode(FresnelMode mode, Body&& body) {
  if (mode == FresnelMode::kExact) return body(Constant<FresnelMode::kExact, kCompensate>{});
  body(Constant<FresnelMode::kPaper, kCompensate>{});
}
template <class Body> void with_constant(ShadeOptions options, Body&& body) {
  options.compensate ? with_mode<true>(options.fresnel, body) : with_mode<false>(options.fresnel, body);
}

}  // namespace

template <class T>
void split_sum_shade(const float* lut, ShadeOptions options, int64_t begin, int64_t end, int n_channels,
                     const ShadeArrays<const T>& in, T* radiance) {
  with_constant(options, [&](auto constant) {
    for (int64_t first = begin; first < end; first += kLanes) {
      const int n = static_cast<int>(min_of(int64_t(kLanes), end - first));
      T out[3 * kLanes];
      shade_block<constant.fresnel, constant.compensate>(lut, load_block(in, first, n, n_channels), out);
      store_rows<3>(out, first, n, radiance);
    }
  });
}

template <class T>
void split_sum_shade_backward(const float* lut, ShadeOptions options, int64_t begin, int64_t end, int n_channels,
                              const ShadeArrays<const T>& in, const T* grad_radiance, const ShadeArrays<T>& grad) {
  with_constant(options, [&](auto constant) {
    for (int64_t first = begin; first < end; first += kLanes) {
      const int n = static_cast<int>(min_of(int64_t(kLanes), end - first));
      T cotangent[3 * kLanes];
      load_rows<3>(grad_radiance, first, n, cotangent);
      ShadeBlock<T> out;
      shade_block_backward<constant.fresnel, constant.compensate>(lut, load_block(in, first, n, n_channels), cotangent,
                                                                  out);
      store_block(out, first, n, n_channels, grad);
    }
  });
}

#define SPLITNERF_INSTANTIATE(T)                                                                                   \
  template void split_sum_shade<T>(const float*, ShadeOptions, int64_t, int64_t, int, const ShadeArrays<const T>&, \
                                   T*);                                                                            \
  template void split_sum_shade_backward<T>(const float*, ShadeOptions, int64_t, int64_t, int,                     \
                                            const ShadeArrays<const T>&, const T*, const ShadeArrays<T>&);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::SPLITNERF_ISA
