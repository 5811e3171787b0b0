#include "splitnerf/bodies/visibility_cache.h"
#include "warp.cuh"

namespace splitnerf::cuda {

template <class T>
void cached_occlusion(const Queue& queue, const VisibilityCache<T>& cache, int64_t n, const T* positions,
                      const T* normals, const T* lobe_dirs, const T* roughness, T* occlusion_d, T* occlusion_s,
                      T* indirect_d, T* indirect_s) {
  for_each_group(queue, "cached_occlusion", n,
                 CachedOcclusionBody<T>{cache, positions, normals, lobe_dirs, roughness, occlusion_d, occlusion_s,
                                        indirect_d, indirect_s});
}

template <class T>
void cached_visibility(const Queue& queue, const VisibilityCache<T>& cache, int64_t n, const T* positions,
                       const T* normals, T* visible, T* arriving) {
  for_each_group(queue, "cached_visibility", n, CachedVisibilityBody<T>{cache, positions, normals, visible, arriving});
}

#define SPLITNERF_INSTANTIATE(T)                                                                                    \
  template void cached_occlusion<T>(const Queue&, const VisibilityCache<T>&, int64_t, const T*, const T*, const T*, \
                                    const T*, T*, T*, T*, T*);                                                      \
  template void cached_visibility<T>(const Queue&, const VisibilityCache<T>&, int64_t, const T*, const T*, T*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cuda
