// The light's pyramid, its harmonics for as many points as a vector has lanes, beside LightLookupBody and
// read_light_backward: 5 x forward, 6 x backward (8192 points, half of them on the harmonics; float32, one thread, AVX-512).
#include "block_product.h"
#include "kernel_set.h"

namespace splitnerf::SPLITNERF_ISA {
namespace {

// One register: vectors of two spill, 4 to 6 x as long on AVX2.
template <class T> struct Lanes {
  typedef T V __attribute__((vector_size(kVectorBytes)));
  static constexpr int n = kVectorBytes / sizeof(T);
};

// Points that wait for the harmonics, evaluated one lane each. `share` is how much of the harmonics'
// value the point takes, `slope` the derivative of that by its roughness.
template <class T> struct Waiting {
  using V = typename Lanes<T>::V;
  V x, y, z, zonal[kShBands], zonal_slope[kShBands];
  T share[Lanes<T>::n], slope[Lanes<T>::n];
  int64_t point[Lanes<T>::n];
  int n = 0;

  SPLITNERF_HD void add(const LightPyramid<T>& p, const LightMix<T>& mix, int64_t i, Vec3<T> w, T roughness) {
    const ZonalPlace<T> place = zonal_place(p, roughness);
    const T *row = place.row, *next = row + kShBands;
    x[n] = w.x, y[n] = w.y, z[n] = w.z;
    for (int l = 0; l < kShBands; ++l) {
      zonal[l][n] = lerp(row[l], next[l], place.share);
      zonal_slope[l][n] = place.slope * (next[l] - row[l]);
    }
    share[n] = mix.share, slope[n] = mix.slope, point[n] = i;
    ++n;
  }
  SPLITNERF_HD bool full() const { return n == Lanes<T>::n; }

  // Lanes without a point: the pole, with no weight.
  SPLITNERF_HD void pad() {
    for (int k = n; k < Lanes<T>::n; ++k) {
      x[k] = y[k] = T(0), z[k] = T(1);
      for (int l = 0; l < kShBands; ++l) zonal[l][k] = zonal_slope[l][k] = T(0);
    }
  }
};

template <class T> void flush(const LightPyramid<T>& p, Waiting<T>& waiting, T* radiance) {
  typename Lanes<T>::V sums[3];
  waiting.pad();
  sh_evaluate(*p.recurrence, p.sh, waiting.zonal, waiting.x, waiting.y, waiting.z, sums);
  for (int k = 0; k < waiting.n; ++k) {
    T* out = radiance + 3 * waiting.point[k];
    for (int c = 0; c < 3; ++c) out[c] += waiting.share[k] * floored_light(sums[c][k], p.sh[c]).value;
  }
  waiting.n = 0;
}

template <class T>
void flush_backward(const LightPyramid<T>& p, Waiting<T>& waiting, const T* grad_radiance, T* grad_directions,
                    T* grad_roughness, typename Lanes<T>::V* grad_sh) {
  using V = typename Lanes<T>::V;
  V sums[3], grad[3] = {}, grad_zonal[kShBands], grad_xyz[3], to_roughness = V{};
  waiting.pad();
  sh_evaluate(*p.recurrence, p.sh, waiting.zonal, waiting.x, waiting.y, waiting.z, sums);
  for (int k = 0; k < waiting.n; ++k) {
    const int64_t i = waiting.point[k];
    for (int c = 0; c < 3; ++c) {
      const FlooredLight<T> floored = floored_light(sums[c][k], p.sh[c]);
      const T g = grad_radiance[3 * i + c];
      grad_roughness[i] += waiting.slope[k] * g * floored.value;
      grad[c][k] = waiting.share[k] * g * floored.d_x;
      grad_sh[c][k] += waiting.share[k] * g * floored.d_e * T(kShFloor * kShConstant);
    }
  }
  sh_evaluate_backward(*p.recurrence, p.sh, waiting.zonal, waiting.x, waiting.y, waiting.z, grad, ShGradSum<V>{grad_sh},
                       grad_zonal, grad_xyz);
  for (int l = 0; l < kShBands; ++l) to_roughness += grad_zonal[l] * waiting.zonal_slope[l];
  for (int k = 0; k < waiting.n; ++k) {
    const int64_t i = waiting.point[k];
    grad_roughness[i] += to_roughness[k];
    for (int c = 0; c < 3; ++c) grad_directions[3 * i + c] += grad_xyz[c][k];
  }
  waiting.n = 0;
}

}  // namespace

template <class T>
void light_lookup(const LightPyramid<T>& p, int64_t begin, int64_t end, const T* directions, const T* roughness,
                  T* radiance) {
  Waiting<T> waiting;
  for (int64_t i = begin; i < end; ++i) {
    const Vec3<T> w = load3(directions + 3 * i);
    const LightMix<T> mix = light_mix(p, roughness[i]);
    store3(radiance + 3 * i, read_maps(p, mix, w));
    if (mix.share == T(0) || !reads_harmonics(p, mix)) continue;
    waiting.add(p, mix, i, w, roughness[i]);
    if (waiting.full()) flush(p, waiting, radiance);
  }
  if (waiting.n) flush(p, waiting, radiance);
}

template <class T>
void light_lookup_backward(const LightPyramid<T>& p, int64_t begin, int64_t end, const T* directions,
                           const T* roughness, const T* grad_radiance, T* grad_directions, T* grad_roughness,
                           T* grad_levels, T* grad_sh) {
  using V = typename Lanes<T>::V;
  V lanes_sh[3 * kShCoefficients] = {};
  Waiting<T> waiting;
  for (int64_t i = begin; i < end; ++i) {
    const Vec3<T> w = load3(directions + 3 * i), grad = load3(grad_radiance + 3 * i);
    const LightMix<T> mix = light_mix(p, roughness[i]);
    const LightArgumentsGrad<T> to = read_maps_backward(p, mix, w, grad, grad_levels);
    store3(grad_directions + 3 * i, to.direction);
    grad_roughness[i] = to.roughness;
    if (!reads_harmonics(p, mix)) continue;
    waiting.add(p, mix, i, w, roughness[i]);
    if (waiting.full()) flush_backward(p, waiting, grad_radiance, grad_directions, grad_roughness, lanes_sh);
  }
  if (waiting.n) flush_backward(p, waiting, grad_radiance, grad_directions, grad_roughness, lanes_sh);
  for (int i = 0; i < 3 * kShCoefficients; ++i) {
    T sum = T(0);
    for (int k = 0; k < Lanes<T>::n; ++k) sum += lanes_sh[i][k];
    grad_sh[i] += sum;
  }
}

#define SPLITNERF_INSTANTIATE(T)                                                                                     \
  template void light_lookup<T>(const LightPyramid<T>&, int64_t, int64_t, const T*, const T*, T*);                   \
  template void light_lookup_backward<T>(const LightPyramid<T>&, int64_t, int64_t, const T*, const T*, const T*, T*, \
                                         T*, T*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::SPLITNERF_ISA
