#include <algorithm>
#include <vector>

#include "splitnerf/kernels.h"
#include "splitnerf/neus.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"

namespace splitnerf::cpu {
namespace {

// A ray on its way: the distance at sample `k` is asked for next.
template <class T> struct Walker {
  RayLattice<T> lattice;
  int64_t k;
  int64_t last = -1;        // the sample before, -1 for none
  T f_last = T(0);          // the distance there
  bool last_kept = false;
  T depth = T(0);           // optical depth up to there
  SampledRay<T>* kept;
};

// Takes the distance at w.k and moves on; k = -1 where the ray ends.
template <class T>
void advance(Walker<T>& w, T f, const uint8_t* cells, const MarchOptions& march, const SampleRules<T>& rules) {
  SampledRay<T>& ray = *w.kept;
  ++ray.n_evaluated;
  bool keep = !(f == f);  // a NaN is kept: whoever renders the samples shall see it
  if (w.last >= 0) {
    const T tau = neus_optical_depth(w.f_last, f, rules.s);
    const T weight = std::exp(-w.depth) * -std::expm1(-tau);
    if (weight > rules.min_weight) {
      if (!w.last_kept) ray.starts.push_back(w.lattice.start(w.last));
      keep = true;
    }
    w.depth += tau;
  }
  if (keep) ray.starts.push_back(w.lattice.start(w.k));
  w.last = w.k, w.f_last = f, w.last_kept = keep;
  if (w.depth > rules.max_depth || ray.n_evaluated >= march.max_samples) {
    w.k = -1;
    return;
  }
  // Within (|f| - reach) / Lipschitz there is no density.
  const T free = (std::abs(f) - rules.reach) / (rules.lipschitz * w.lattice.step);
  w.k = next_occupied(w.lattice, cells, march, w.k + (free > T(1) ? static_cast<int64_t>(free) : 1));
}

}  // namespace

template <class T>
void sample_rays(const SdfNetwork<T>& net, const MarchOptions& march, const uint8_t* cells, const SampleRules<T>& rules,
                 int64_t n_rays, const T* rays_o, const T* rays_d, const T* jitter, SampledRay<T>* sampled) {
  const Kernels<T>& k = kernels<T>();
  parallel_for(n_rays, kSdfBlock, [&](int64_t begin, int64_t end) {
    std::vector<T> work(sdf_work_size(net)), positions(3 * kSdfBlock), values(kSdfBlock);
    std::vector<Walker<T>> walkers;
    for (int64_t r = begin; r < end || !walkers.empty();) {
      for (; r < end && walkers.size() < kSdfBlock; ++r) {
        const RayLattice<T> lattice(load3(rays_o + 3 * r), load3(rays_d + 3 * r), jitter[r], march);
        const int64_t start = next_occupied(lattice, cells, march, 0);
        if (start >= 0) walkers.push_back({lattice, start, -1, T(0), false, T(0), sampled + r});
      }
      const int64_t n = static_cast<int64_t>(walkers.size());
      for (int64_t i = 0; i < n; ++i) store3(positions.data() + 3 * i, walkers[i].lattice.middle(walkers[i].k));
      k.sdf_values(net, n, positions.data(), work.data(), values.data());
      const auto ended = [&](const Walker<T>& w) { return w.k < 0; };
      for (int64_t i = 0; i < n; ++i) advance(walkers[i], values[i], cells, march, rules);
      walkers.erase(std::remove_if(walkers.begin(), walkers.end(), ended), walkers.end());
    }
  });
}

#define SPLITNERF_INSTANTIATE(T)                                                                                    \
  template void sample_rays<T>(const SdfNetwork<T>&, const MarchOptions&, const uint8_t*, const SampleRules<T>&,    \
                               int64_t, const T*, const T*, const T*, SampledRay<T>*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cpu
