// All pairs of lobes and lights, beside LobeGather and LobeScatter pair by pair: 11 x and 7 x (512 queries, 4096
// lights; float32, one thread of an AMD EPYC of family 25, AVX-512).
#include "kernel_set.h"
#include "splitnerf/prefilter.h"

namespace splitnerf::SPLITNERF_ISA {

// One query against all lights; the sums live in registers, so memory is O(queries + lights).
template <class T>
void lobe_gather(const LobeSide<T>& queries, const LobeSide<T>& lights, int64_t begin, int64_t end, T* sums) {
  const LobeSide<T> l = lights;  // a copy: its pointers stand still while sums are written
  for (int64_t s = begin; s < end; ++s) {
    const T x = queries.x[s], y = queries.y[s], z = queries.z[s], a2 = queries.alpha_squared[s];
    T r = 0, g = 0, b = 0, total = 0;
#pragma omp simd reduction(+ : r, g, b, total)
    for (int64_t i = 0; i < l.n; ++i) {
      const T k = prefilter_weight(x - l.x[i], y - l.y[i], z - l.z[i], a2);
      r += k * l.r[i];
      g += k * l.g[i];
      b += k * l.b[i];
      total += k;
    }
    T* out = sums + 4 * (s - begin);
    out[0] = r, out[1] = g, out[2] = b, out[3] = total;
  }
}

// The transpose: one light against all queries.
template <class T>
void lobe_scatter(const LobeSide<T>& queries, const LobeSide<T>& lights, int64_t begin, int64_t end, T* sums) {
  const LobeSide<T> q = queries;
  for (int64_t i = begin; i < end; ++i) {
    const T x = lights.x[i], y = lights.y[i], z = lights.z[i];
    T r = 0, g = 0, b = 0;
#pragma omp simd reduction(+ : r, g, b)
    for (int64_t s = 0; s < q.n; ++s) {
      const T k = prefilter_weight(x - q.x[s], y - q.y[s], z - q.z[s], q.alpha_squared[s]);
      r += k * q.r[s];
      g += k * q.g[s];
      b += k * q.b[s];
    }
    T* out = sums + 3 * (i - begin);
    out[0] = r, out[1] = g, out[2] = b;
  }
}

#define SPLITNERF_INSTANTIATE(T)                                                              \
  template void lobe_gather<T>(const LobeSide<T>&, const LobeSide<T>&, int64_t, int64_t, T*); \
  template void lobe_scatter<T>(const LobeSide<T>&, const LobeSide<T>&, int64_t, int64_t, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::SPLITNERF_ISA
