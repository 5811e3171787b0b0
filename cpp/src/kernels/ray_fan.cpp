// The rays of a fan and the light along them, beside the same formulas ray by ray: directions 6 x (cosine lobe) and 17
// x (GGX), light 4.5 x (64 rays; float32, one thread of an AMD EPYC of family 25, AVX-512).
#include "kernel_set.h"
#include "splitnerf/environment.h"
#include "splitnerf/occlusion.h"

namespace splitnerf::SPLITNERF_ISA {
namespace {

constexpr double kLongestRay = 1e30;  // squared

// One ray. Functions of their own: what is declared inside a simd loop would be kept in memory, once a lane.
template <bool kCosine, class T> SPLITNERF_HD Vec3<T> fan_direction(const RayFan<T>& fan, int i) {
  const T u = wrap_unit(fan.u[i], fan.shift.x), v = wrap_unit(fan.v[i], fan.shift.y);
  return fan.frame.to_world(kCosine ? sample_cosine_hemisphere(u, v) : sample_ggx_lobe_of_edge(u, v, fan.edge));
}

// What does not count, numbers that are not finite among it, looks along +z: the light is looked up for every lane.
template <bool kCosine, class T>
SPLITNERF_HD void fan_lane(const RayFan<T>& fan, int i, float* x, float* y, float* z, int32_t* active) {
  const Vec3<T> w = fan_direction<kCosine>(fan, i);
  const bool counts = (dot(w, fan.normal) > T(0)) & (dot(w, w) < T(kLongestRay)) & (i < fan.n);
  x[i] = counts ? static_cast<float>(w.x) : 0.f;
  y[i] = counts ? static_cast<float>(w.y) : 0.f;
  z[i] = counts ? static_cast<float>(w.z) : 1.f;
  active[i] = counts ? -1 : 0;
}

template <bool kCosine, class T> void fan_rays(const RayFan<T>& all, float* x, float* y, float* z, int32_t* active) {
  const RayFan<T> fan = all;  // a copy: it stands still while the rays are written
  const int n = static_cast<int>(padded_fan(fan.n));
#pragma omp simd
  for (int i = 0; i < n; ++i) fan_lane<kCosine>(fan, i, x, y, z, active);
}

template <class T> struct LightBlock {
  T r[kFanLanes], g[kFanLanes], b[kFanLanes];
};

template <class T> SPLITNERF_HD T bilinear(const T* map, const EquirectCell<T>& c, int top, int bottom) {
  return lerp(lerp(map[top + 3 * c.column], map[top + 3 * c.next_column], c.fx),
              lerp(map[bottom + 3 * c.column], map[bottom + 3 * c.next_column], c.fx), c.fy);
}

template <class T>
SPLITNERF_HD void light_lane(const T* map, int height, int width, Vec3<T> w, int i, LightBlock<T>& light) {
  const EquirectCell<T> c = equirect_cell(direction_to_equirect(w), height, width);
  const int top = 3 * width * c.row, bottom = 3 * width * c.next_row;
  light.r[i] = bilinear(map, c, top, bottom);
  light.g[i] = bilinear(map + 1, c, top, bottom);
  light.b[i] = bilinear(map + 2, c, top, bottom);
}

}  // namespace

template <class T> void fan_directions(const RayFan<T>& fan, float* x, float* y, float* z, int32_t* active) {
  fan.edge > T(0) ? fan_rays<false>(fan, x, y, z, active) : fan_rays<true>(fan, x, y, z, active);
}

template <class T>
void fan_light(const T* map, int height, int width, int64_t n, const float* x, const float* y, const float* z,
               const int32_t* active, const int32_t* visible, T* sums) {
  T all_r[kFanLanes] = {}, all_g[kFanLanes] = {}, all_b[kFanLanes] = {};
  T open_r[kFanLanes] = {}, open_g[kFanLanes] = {}, open_b[kFanLanes] = {};
  for (int64_t first = 0; first < n; first += kFanLanes) {
    const float *wx = x + first, *wy = y + first, *wz = z + first;
    const int32_t *counts = active + first, *seen = visible + first;
    LightBlock<T> light;
#pragma omp simd
    for (int i = 0; i < kFanLanes; ++i) light_lane(map, height, width, Vec3<T>{wx[i], wy[i], wz[i]}, i, light);
#pragma omp simd
    for (int i = 0; i < kFanLanes; ++i) {
      const T any = T(-counts[i]), open = T(-seen[i]);
      const T r = any * (light.r[i] + T(kBlackLight)), g = any * (light.g[i] + T(kBlackLight));
      const T b = any * (light.b[i] + T(kBlackLight));
      all_r[i] += r, all_g[i] += g, all_b[i] += b;
      open_r[i] += open * r, open_g[i] += open * g, open_b[i] += open * b;
    }
  }
  for (int c = 0; c < 6; ++c) sums[c] = T(0);
  for (int i = 0; i < kFanLanes; ++i) {
    const T lanes[6] = {open_r[i], open_g[i], open_b[i], all_r[i], all_g[i], all_b[i]};
    for (int c = 0; c < 6; ++c) sums[c] += lanes[c];
  }
}

#define SPLITNERF_INSTANTIATE(T)                                                                                    \
  template void fan_directions<T>(const RayFan<T>&, float*, float*, float*, int32_t*);                              \
  template void fan_light<T>(const T*, int, int, int64_t, const float*, const float*, const float*, const int32_t*, \
                             const int32_t*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::SPLITNERF_ISA
