#include "launch.cuh"
#include "splitnerf/ops_cuda.h"
#include "splitnerf/bodies/hash_encode.h"
#include "splitnerf/features.h"

namespace splitnerf::cuda {

// Level after level, so that a level's part of the table stays in the L2 cache while all points read it.
template <class T>
void hash_encode(const Queue& queue, const HashGridShape& shape, int n_active, int64_t n, const T* positions,
                 HashTable table, T* features) {
  with_features(shape.n_features, [&](auto count) {
    table.read_as<T>([&](auto* entries) {
      using S = Pointee<decltype(entries)>;
      const auto grid = make_view<T>(shape, n_active, positions, entries);
      for_each_pair(queue, "hash_encode", n, shape.n_levels, HashEncodeBody<T, decltype(count)::n, S>{grid, features});
    });
  });
}

template <class T>
void hash_encode_backward(const Queue& queue, const HashGridShape& shape, int n_active, int64_t n, const T* positions,
                          const T* grad_features, T* grad_table) {
  const auto grid = make_view<T, T>(shape, n_active, positions, nullptr);
  const HashLevel& last = grid.levels[shape.n_levels - 1];
  clear(queue, "hash_encode_backward", grad_table, (last.offset + last.n_entries) * shape.n_features);
  with_features(shape.n_features, [&](auto count) {
    for_each_pair(queue, "hash_encode_backward", n, n_active,
                  HashScatterBody<T, decltype(count)::n>{grid, grad_features, grad_table});
  });
}

template <class T>
void hash_encode_backward_positions(const Queue& queue, const HashGridShape& shape, int n_active, int64_t n,
                                    const T* positions, HashTable table, const T* grad_features, T* grad_positions) {
  with_features(shape.n_features, [&](auto count) {
    table.read_as<T>([&](auto* entries) {
      using S = Pointee<decltype(entries)>;
      const auto grid = make_view<T>(shape, n_active, positions, entries);
      for_each(queue, "hash_encode_backward_positions", n,
               HashPositionsBody<T, decltype(count)::n, S>{grid, grad_features, grad_positions});
    });
  });
}

#define SPLITNERF_INSTANTIATE(T)                                                                                   \
  template void hash_encode<T>(const Queue&, const HashGridShape&, int, int64_t, const T*, HashTable, T*);         \
  template void hash_encode_backward<T>(const Queue&, const HashGridShape&, int, int64_t, const T*, const T*, T*); \
  template void hash_encode_backward_positions<T>(const Queue&, const HashGridShape&, int, int64_t, const T*,      \
                                                  HashTable, const T*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cuda
