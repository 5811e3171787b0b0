// The light's pyramid, one point a call.
#pragma once

#include "splitnerf/group.h"
#include "splitnerf/light_pyramid.h"

namespace splitnerf {

// The lobe's zonal factors at a roughness, and their derivatives by it.
template <class T> struct ZonalFactors {
  T value[kShBands], slope[kShBands];

  SPLITNERF_HD ZonalFactors(const LightPyramid<T>& p, T roughness) {
    const ZonalPlace<T> place = zonal_place(p, roughness);
    const T *row = place.row, *next = row + kShBands;
    for (int l = 0; l < kShBands; ++l) {
      value[l] = lerp(row[l], next[l], place.share);
      slope[l] = place.slope * (next[l] - row[l]);
    }
  }
};

template <class T>
SPLITNERF_HD Vec3<T> read_light(const LightPyramid<T>& p, const ShRecurrence<T>& recurrence, Vec3<T> w, T roughness) {
  const LightMix<T> mix = light_mix(p, roughness);
  Vec3<T> radiance = read_maps(p, mix, w);
  if (mix.share == T(0) || !reads_harmonics(p, mix)) return radiance;
  const ZonalFactors<T> zonal(p, roughness);
  T sums[3];
  sh_evaluate(recurrence, p.sh, zonal.value, w.x, w.y, w.z, sums);
  for (int c = 0; c < 3; ++c) radiance[c] += mix.share * floored_light(sums[c], p.sh[c]).value;
  return radiance;
}

// Adds to grad_levels. to_sh.add(i, basis, grad_sums) takes the gradient to the coefficients, to_sh.add_constant(grad) what the
// floor adds to the three constant ones; neither is called, and grad_sums [3] stays as it is, where the harmonics have no share.
template <class T, class Receiver>
SPLITNERF_HD LightArgumentsGrad<T> read_light_backward(const LightPyramid<T>& p, const ShRecurrence<T>& recurrence,
                                                       Vec3<T> w, T roughness, Vec3<T> grad, T* grad_levels,
                                                       const Receiver& to_sh, T* grad_sums) {
  const LightMix<T> mix = light_mix(p, roughness);
  LightArgumentsGrad<T> out = read_maps_backward(p, mix, w, grad, grad_levels);
  if (!reads_harmonics(p, mix)) return out;
  const ZonalFactors<T> zonal(p, roughness);
  T sums[3], grad_zonal[kShBands], grad_xyz[3];
  Vec3<T> grad_constant;
  sh_evaluate(recurrence, p.sh, zonal.value, w.x, w.y, w.z, sums);
  for (int c = 0; c < 3; ++c) {
    const FlooredLight<T> floored = floored_light(sums[c], p.sh[c]);
    out.roughness += mix.slope * grad[c] * floored.value;
    grad_sums[c] = mix.share * grad[c] * floored.d_x;
    grad_constant[c] = mix.share * grad[c] * floored.d_e * T(kShFloor * kShConstant);
  }
  to_sh.add_constant(grad_constant);
  sh_evaluate_backward(recurrence, p.sh, zonal.value, w.x, w.y, w.z, grad_sums, to_sh, grad_zonal, grad_xyz);
  for (int l = 0; l < kShBands; ++l) out.roughness += grad_zonal[l] * zonal.slope[l];
  out.direction += Vec3<T>{grad_xyz[0], grad_xyz[1], grad_xyz[2]};
  return out;
}

// radiance [n, 3]
template <class T> struct LightLookupBody {
  LightPyramid<T> pyramid;
  ShRecurrence<T> recurrence;
  const T *directions, *roughness;
  T* radiance;

  SPLITNERF_HD void operator()(int64_t i) const {
    store3(radiance + 3 * i, read_light(pyramid, recurrence, load3(directions + 3 * i), roughness[i]));
  }
};
SPLITNERF_ON_GPU(LightLookupBody);

// products [n_rows n_images, 3] = matrix . values [n_columns, 3]; a group of threads a row and image.
template <class T> struct SparseProductBody {
  SparseRows<T> matrix;
  const T* values;
  T* products;

  template <class Group> SPLITNERF_HD void operator()(const Group& group, int64_t i) const {
    const int64_t r = i / matrix.n_images;
    const int m = static_cast<int>(i % matrix.n_images);
    Vec3<T> sum{T(0), T(0), T(0)};
    for (int64_t k = matrix.offsets[r] + group.lane(); k < matrix.offsets[r + 1]; k += Group::size)
      sum += load3(values + 3 * int64_t(matrix.images[matrix.n_images * int64_t(matrix.columns[k]) + m])) *
             matrix.weights[k];
    sum = sum3(group, sum);
    if (group.lane() == 0) store3(products + 3 * int64_t(matrix.places[i]), sum);
  }
};
SPLITNERF_ON_GPU(SparseProductBody);

}  // namespace splitnerf
