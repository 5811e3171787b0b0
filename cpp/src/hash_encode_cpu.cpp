#include <array>

#include "each_level.h"
#include "splitnerf/bodies/hash_encode.h"
#include "splitnerf/features.h"
#include "splitnerf/kernels.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"

namespace splitnerf::cpu {
namespace {

constexpr int64_t kGrain = 512;

template <class T>
HashEncodeArgs<T> make_args(const HashGridShape& shape, HashLevel* levels, int n_active, int64_t n, const T* positions,
                            HashTable table) {
  return {levels, shape.n_features, shape.n_levels, n_active, n, positions, table};
}

}  // namespace

template <class T>
void hash_encode(const HashGridShape& shape, int n_active, int64_t n, const T* positions, HashTable table,
                 T* features) {
  std::array<HashLevel, kMaxLevels> levels;
  hash_levels(shape, levels.data());
  const auto args = make_args(shape, levels.data(), n_active, n, positions, table);
  const Kernels<T>& k = kernels<T>();
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) { k.hash_encode(args, begin, end, features, nullptr); });
}

template <class T>
void hash_encode_backward(const HashGridShape& shape, int n_active, int64_t n, const T* positions,
                          const T* grad_features, T* grad_table) {
  std::array<HashLevel, kMaxLevels> levels;
  hash_levels(shape, levels.data());
  const auto args = make_args<T>(shape, levels.data(), n_active, n, positions, nullptr);
  const Kernels<T>& k = kernels<T>();
  for_each_level(args, grad_table, [&](int level) { k.hash_scatter(args, level, grad_features, grad_table); });
}

template <class T>
void hash_encode_backward_positions(const HashGridShape& shape, int n_active, int64_t n, const T* positions,
                                    HashTable table, const T* grad_features, T* grad_positions) {
  with_features(shape.n_features, [&](auto count) {
    table.read_as<T>([&](auto* entries) {
      using S = Pointee<decltype(entries)>;
      const auto grid = make_view<T>(shape, n_active, positions, entries);
      run(n, HashPositionsBody<T, decltype(count)::n, S>{grid, grad_features, grad_positions});
    });
  });
}

#define SPLITNERF_INSTANTIATE(T)                                                                                     \
  template void hash_encode<T>(const HashGridShape&, int, int64_t, const T*, HashTable, T*);                         \
  template void hash_encode_backward<T>(const HashGridShape&, int, int64_t, const T*, const T*, T*);                 \
  template void hash_encode_backward_positions<T>(const HashGridShape&, int, int64_t, const T*, HashTable, const T*, \
                                                  T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cpu
