#include <algorithm>
#include <array>

#include "huge_pages.h"
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

// Zeros columns [first, n_columns) of `rows` rows.
template <class T> void clear_columns(T* rows_begin, int64_t rows, int64_t n_columns, int64_t first) {
  if (first == n_columns) return;
  for (int64_t r = 0; r < rows; ++r)
    std::fill(rows_begin + r * n_columns + first, rows_begin + (r + 1) * n_columns, T(0));
}

}  // namespace

template <class T>
void hash_encode(const HashGridShape& shape, int n_active, int64_t n, const T* positions, HashTable table, T* features,
                 T* jacobian) {
  std::array<HashLevel, kMaxLevels> levels;
  hash_levels(shape, levels.data());
  const auto args = make_args(shape, levels.data(), n_active, n, positions, table);
  const Kernels<T>& k = kernels<T>();
  const int64_t n_columns = int64_t(shape.n_levels) * shape.n_features, open = int64_t(n_active) * shape.n_features;
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    clear_columns(features + begin * n_columns, end - begin, n_columns, open);
    if (jacobian) clear_columns(jacobian + 3 * begin * n_columns, 3 * (end - begin), n_columns, open);
    k.hash_encode(args, begin, end, features, jacobian);
  });
}

template <class T>
void hash_encode_backward(const HashGridShape& shape, int n_active, int64_t n, const T* positions,
                          const T* grad_features, const T* grad_jacobian, T* grad_table) {
  std::array<HashLevel, kMaxLevels> levels;
  hash_levels(shape, levels.data());
  const auto args = make_args<T>(shape, levels.data(), n_active, n, positions, nullptr);
  const Kernels<T>& k = kernels<T>();
  const HashLevel& last = levels[shape.n_levels - 1];
  prefer_huge_pages(grad_table, (last.offset + last.n_entries) * shape.n_features * sizeof(T));
  parallel_for(shape.n_levels, 1, [&](int64_t begin, int64_t end) {
    for (int64_t l = begin; l < end; ++l) {
      T* first = grad_table + levels[l].offset * shape.n_features;
      std::fill(first, first + levels[l].n_entries * shape.n_features, T(0));
      if (l < n_active) k.hash_scatter(args, static_cast<int>(l), grad_features, grad_jacobian, grad_table);
    }
  });
}

template <class T>
void hash_encode_backward_positions(const HashGridShape& shape, int n_active, int64_t n, const T* positions,
                                    HashTable table, const T* grad_features, const T* grad_jacobian,
                                    T* grad_positions) {
  with_features(shape.n_features, [&](auto count) {
    table.read_as<T>([&](auto* entries) {
      using S = Pointee<decltype(entries)>;
      const auto grid = make_view<T>(shape, n_active, positions, entries);
      run(n, HashPositionsBody<T, decltype(count)::n, S>{grid, grad_features, grad_jacobian, grad_positions});
    });
  });
}

#define SPLITNERF_INSTANTIATE(T)                                                                                     \
  template void hash_encode<T>(const HashGridShape&, int, int64_t, const T*, HashTable, T*, T*);                     \
  template void hash_encode_backward<T>(const HashGridShape&, int, int64_t, const T*, const T*, const T*, T*);       \
  template void hash_encode_backward_positions<T>(const HashGridShape&, int, int64_t, const T*, HashTable, const T*, \
                                                  const T*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cpu
