// Adding to memory that other threads add to as well: atomic on the GPU; on the CPU no two threads share what they add to.
#pragma once

#include "splitnerf/vec.h"

namespace splitnerf {

template <class T> SPLITNERF_HD void add_to(T* to, T value) {
#if defined(__CUDA_ARCH__)
  atomicAdd(to, value);
#else
  *to += value;
#endif
}
template <class T> SPLITNERF_HD void add3_to(T* to, Vec3<T> v) {
  add_to(to, v.x);
  add_to(to + 1, v.y);
  add_to(to + 2, v.z);
}

// F numbers side by side, read and written at once where the hardware can: `from` and `to` are aligned to them, or to 16
// bytes where they are more.
template <class T, int F> struct alignas(F * sizeof(T) < 16 ? F * sizeof(T) : 16) Pack {
  T v[F];

  SPLITNERF_HD T& operator[](int i) { return v[i]; }
  SPLITNERF_HD const T& operator[](int i) const { return v[i]; }
};
template <int F, class T> SPLITNERF_HD Pack<T, F> load_pack(const T* from) {
  return *reinterpret_cast<const Pack<T, F>*>(from);
}
template <class T, int F> SPLITNERF_HD void store_pack(T* to, const Pack<T, F>& values) {
  *reinterpret_cast<Pack<T, F>*>(to) = values;
}
template <class T, int F> SPLITNERF_HD void add_pack(T* to, const Pack<T, F>& values) {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
  // One request for two or four neighbours.
  if constexpr (sizeof(T) == 4 && F % 4 == 0) {
    for (int f = 0; f < F; f += 4)
      atomicAdd(reinterpret_cast<float4*>(to + f), make_float4(values[f], values[f + 1], values[f + 2], values[f + 3]));
  } else if constexpr (sizeof(T) == 4 && F == 2) {
    atomicAdd(reinterpret_cast<float2*>(to), make_float2(values[0], values[1]));
  } else {
    for (int f = 0; f < F; ++f) add_to(to + f, values[f]);
  }
#else
  for (int f = 0; f < F; ++f) add_to(to + f, values[f]);
#endif
}

}  // namespace splitnerf
