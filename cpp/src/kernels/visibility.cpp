// Visibility bits of a point's neighbours, direction by direction, beside CachedOcclusionBody and CachedVisibilityBody:
// 4.3 x and 4.0 x (2048 points, 256 directions; float32, one thread of an AMD EPYC of family 25, AVX-512).
#include "kernel_set.h"
#include "splitnerf/prefilter.h"
#include "splitnerf/visibility_cache.h"

namespace splitnerf::SPLITNERF_ISA {

template <class T>
void visibility_horizon(const LobeSide<T>& all_directions, const T* normal, T* cosine, uint32_t* above) {
  const LobeSide<T> directions = all_directions;
  const T x = normal[0], y = normal[1], z = normal[2];
#pragma omp simd
  for (int64_t i = 0; i < directions.n; ++i) {
    cosine[i] = max_of(x * directions.x[i] + y * directions.y[i] + z * directions.z[i], T(0));
  }
  for (int64_t word = 0; word < directions.n / kBitsPerWord; ++word) {
    const T* c = cosine + word * kBitsPerWord;
    uint32_t bits = 0;
#pragma omp simd reduction(| : bits)
    for (int j = 0; j < kBitsPerWord; ++j) bits |= uint32_t(c[j] > T(0)) << j;
    above[word] = bits;
  }
}

template <class T> void visibility_shares(int64_t n_directions, const VisibilityPoint<T>& point, T* known, T* visible) {
  const int64_t n_words = n_directions / kBitsPerWord;
  for (int64_t word = 0; word < n_words; ++word) {
    T *all = known + word * kBitsPerWord, *share = visible + word * kBitsPerWord;
    for (int j = 0; j < kBitsPerWord; ++j) all[j] = share[j] = T(0);
    for (int k = 0; k < point.n_neighbours; ++k) {
      const uint32_t open = point.bits[k][word], either = open | point.bits[k][n_words + word];
      const T weight = point.weights[k];
#pragma omp simd
      for (int j = 0; j < kBitsPerWord; ++j) {
        all[j] += weight * T(int32_t(either >> j & 1u));
        share[j] += weight * T(int32_t(open >> j & 1u));
      }
    }
#pragma omp simd
    for (int j = 0; j < kBitsPerWord; ++j) share[j] = all[j] > T(0) ? share[j] / all[j] : T(1);
  }
}

template <class T>
void visibility_sums(const LobeSide<T>& all_directions, const VisibilityLobe<T>& lobes, const T* visible, T* lobe,
                     T* sums) {
  const LobeSide<T> directions = all_directions;  // a copy: its pointers stand still while `lobe` is written
  const T* const cosine = lobes.cosine;
  const T x = lobes.lobe_dir[0], y = lobes.lobe_dir[1], z = lobes.lobe_dir[2], a2 = lobes.alpha_squared;
  T open_dr = 0, open_dg = 0, open_db = 0, all_dr = 0, all_dg = 0, all_db = 0, total_d = 0;
  T open_sr = 0, open_sg = 0, open_sb = 0, all_sr = 0, all_sg = 0, all_sb = 0, total_s = 0;
#pragma omp simd reduction(+ : open_dr, open_dg, open_db, all_dr, all_dg, all_db, total_d, open_sr, open_sg, open_sb, \
                               all_sr, all_sg, all_sb, total_s)
  for (int64_t i = 0; i < directions.n; ++i) {
    const T d = cosine[i], v = visible[i], r = directions.r[i], g = directions.g[i], b = directions.b[i];
    const T weight = prefilter_weight(x - directions.x[i], y - directions.y[i], z - directions.z[i], a2);
    const T s = d > T(0) ? weight : T(0);
    lobe[i] = s;
    all_dr += d * r, all_dg += d * g, all_db += d * b, total_d += d;
    all_sr += s * r, all_sg += s * g, all_sb += s * b, total_s += s;
    open_dr += v * d * r, open_dg += v * d * g, open_db += v * d * b;
    open_sr += v * s * r, open_sg += v * s * g, open_sb += v * s * b;
  }
  const T all[14] = {open_dr, open_dg, open_db, all_dr, all_dg, all_db, total_d,
                     open_sr, open_sg, open_sb, all_sr, all_sg, all_sb, total_s};
  for (int i = 0; i < 14; ++i) sums[i] = all[i];
}

#define SPLITNERF_INSTANTIATE(T)                                                    \
  template void visibility_horizon<T>(const LobeSide<T>&, const T*, T*, uint32_t*); \
  template void visibility_shares<T>(int64_t, const VisibilityPoint<T>&, T*, T*);   \
  template void visibility_sums<T>(const LobeSide<T>&, const VisibilityLobe<T>&, const T*, T*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::SPLITNERF_ISA
