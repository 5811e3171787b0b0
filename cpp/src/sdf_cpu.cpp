#include <algorithm>
#include <vector>

#include "prepared_field.h"
#include "splitnerf/bodies/rays.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"
#include "splitnerf/ray_walk.h"

namespace splitnerf::cpu {
namespace {

constexpr int64_t kLayerGrain = 512;  // points of a task

}  // namespace

template <class T> void sdf_values(const SdfField<T>& field, int64_t n, const T* positions, T* values) {
  const Kernels<T>& k = kernels<T>();
  const PreparedField<T> prepared(field);
  parallel_for(n, kLayerGrain, [&](int64_t begin, int64_t end) {
    std::vector<T> work(sdf_work_size(prepared.network.layer));
    for (int64_t i = begin; i < end; i += kSdfBlock)
      k.sdf_values(prepared.network, min_of<int64_t>(kSdfBlock, end - i), positions + 3 * i, work.data(), values + i);
  });
}

template <class T>
void sample_rays(const SdfField<T>& field, const MarchOptions& march, const OccupancyView& grid,
                 const SampleRules<T>& rules, int64_t n_rays, const T* rays_o, const T* rays_d, const T* jitter,
                 int64_t capacity, int64_t* offsets, int64_t* n_evaluated, int64_t* n_found,
                 const SampleAllocator<T>& allocate) {
  const Kernels<T>& k = kernels<T>();
  const PreparedField<T> prepared(field);
  std::vector<std::vector<T>> kept(n_rays);  // where the samples of each ray start, front to back
  std::fill(n_evaluated, n_evaluated + n_rays, 0);
  parallel_for(n_rays, kSdfBlock, [&](int64_t begin, int64_t end) {
    std::vector<T> work(sdf_work_size(prepared.network.layer)), positions(3 * kSdfBlock), values(kSdfBlock);
    std::vector<Walk<T>> walks;
    for (int64_t r = begin; r < end || !walks.empty();) {
      for (; r < end && walks.size() < kSdfBlock; ++r) {
        Walk<T> walk(RayLattice<T>(load3(rays_o + 3 * r), load3(rays_d + 3 * r), jitter[r], march), r, march, grid);
        if (walk.next >= 0) walks.push_back(walk);
      }
      const int64_t n = static_cast<int64_t>(walks.size());
      for (int64_t i = 0; i < n; ++i) store3(positions.data() + 3 * i, walks[i].lattice.middle(walks[i].next));
      k.sdf_values(prepared.network, n, positions.data(), work.data(), values.data());
      for (int64_t i = 0; i < n; ++i) {
        std::vector<T>& starts = kept[walks[i].ray];
        advance(walks[i], values[i], grid, march, rules, [&](T start) { starts.push_back(start); });
        n_evaluated[walks[i].ray] = walks[i].n_evaluated;
      }
      walks.erase(std::remove_if(walks.begin(), walks.end(), [](const Walk<T>& w) { return w.next < 0; }), walks.end());
    }
  });
  std::vector<int64_t> all(n_rays + 1);
  for (int64_t r = 0; r < n_rays; ++r) all[r + 1] = all[r] + static_cast<int64_t>(kept[r].size());
  const int64_t rows = capacity > 0 ? capacity : all[n_rays];
  const FitOffsetsBody fit{n_rays, rows, all.data(), offsets, n_found};
  for (int64_t r = 0; r <= n_rays; ++r) fit(r);
  const PackedSamples<T> to = allocate(rows);
  for (int64_t r = 0; r < n_rays; ++r) {
    for (int64_t i = offsets[r]; i < offsets[r + 1]; ++i) {
      to.ray_indices[i] = r;
      to.t_starts[i] = kept[r][i - offsets[r]];
      to.t_ends[i] = to.t_starts[i] + T(march.step);
    }
  }
  const PadSamplesBody<T> pad{offsets + n_rays, to};
  for (int64_t i = offsets[n_rays]; i < rows; ++i) pad(i);
}

#define SPLITNERF_INSTANTIATE(T)                                                                                     \
  template void sdf_values<T>(const SdfField<T>&, int64_t, const T*, T*);                                            \
  template void sample_rays<T>(const SdfField<T>&, const MarchOptions&, const OccupancyView&, const SampleRules<T>&, \
                               int64_t, const T*, const T*, const T*, int64_t, int64_t*, int64_t*, int64_t*,         \
                               const SampleAllocator<T>&);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cpu
