#include <vector>

#include "planes.h"
#include "splitnerf/ggx.h"
#include "splitnerf/kernels.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"

namespace splitnerf::cpu {
namespace {

constexpr int64_t kGrain = 16;

// A query above whose horizon no light stands is black.
template <class T> T inverse(T total) { return total == T(0) ? T(0) : T(1) / total; }

template <class T> std::vector<T> squared_alphas(const T* roughness, int64_t n) {
  std::vector<T> out(n);
  for (int64_t i = 0; i < n; ++i) out[i] = square(ggx_alpha_from_roughness(roughness[i]));
  return out;
}

}  // namespace

template <class T>
void prefilter_light(int64_t n_queries, const T* query_dirs, const T* roughness, int64_t n_lights, const T* light_dirs,
                     const T* light, T* gbar, T* total) {
  const Planes<T> query(query_dirs, n_queries), direction(light_dirs, n_lights), colour(light, n_lights);
  const std::vector<T> alpha_squared = squared_alphas(roughness, n_queries);
  const LobeSide<T> queries{query.x.data(), query.y.data(), query.z.data(), alpha_squared.data(),
                            nullptr,        nullptr,        nullptr,        n_queries};
  const LobeSide<T> lights{direction.x.data(), direction.y.data(), direction.z.data(), nullptr,
                           colour.x.data(),    colour.y.data(),    colour.z.data(),    n_lights};
  parallel_for(n_queries, kGrain, [&](int64_t begin, int64_t end) {
    std::vector<T> sums(4 * (end - begin));
    kernels<T>().lobe_gather(queries, lights, begin, end, sums.data());
    for (int64_t i = begin; i < end; ++i) {
      const T* s = &sums[4 * (i - begin)];
      total[i] = s[3];
      for (int c = 0; c < 3; ++c) gbar[3 * i + c] = s[c] * inverse(s[3]);
    }
  });
}

// grad_light_i = sum_s K(s, i) grad_gbar_s / total_s: the transpose of the forward sum.
template <class T>
void prefilter_light_backward(int64_t n_queries, const T* query_dirs, const T* roughness, const T* total,
                              const T* grad_gbar, int64_t n_lights, const T* light_dirs, T* grad_light) {
  const Planes<T> query(query_dirs, n_queries), direction(light_dirs, n_lights);
  Planes<T> share(grad_gbar, n_queries);
  const std::vector<T> alpha_squared = squared_alphas(roughness, n_queries);
  for (int64_t i = 0; i < n_queries; ++i) {
    const T inv = inverse(total[i]);
    share.x[i] *= inv, share.y[i] *= inv, share.z[i] *= inv;
  }
  const LobeSide<T> queries{query.x.data(), query.y.data(), query.z.data(), alpha_squared.data(),
                            share.x.data(), share.y.data(), share.z.data(), n_queries};
  const LobeSide<T> lights{
      direction.x.data(), direction.y.data(), direction.z.data(), nullptr, nullptr, nullptr, nullptr, n_lights};
  parallel_for(n_lights, kGrain, [&](int64_t begin, int64_t end) {
    kernels<T>().lobe_scatter(queries, lights, begin, end, grad_light + 3 * begin);
  });
}

#define SPLITNERF_INSTANTIATE(T)                                                                      \
  template void prefilter_light<T>(int64_t, const T*, const T*, int64_t, const T*, const T*, T*, T*); \
  template void prefilter_light_backward<T>(int64_t, const T*, const T*, const T*, const T*, int64_t, const T*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cpu
