// Products of small matrices, as the layers of small networks are: the inner loop keeps a tile of the result in registers.
#pragma once

#include <cstdint>

#ifndef SPLITNERF_ISA
#define SPLITNERF_ISA base
#endif

namespace splitnerf::SPLITNERF_ISA {

#if defined(__AVX512F__)
inline constexpr int kVectorBytes = 64, kTileRows = 4;
#elif defined(__AVX__)
inline constexpr int kVectorBytes = 32, kTileRows = 2;
#else
inline constexpr int kVectorBytes = 16, kTileRows = 2;
#endif
inline constexpr int kTileVectors = 4;

// A matrix whose element (r, c) stands at data[r * row + c * column].
template <class T> struct Strided {
  const T* data;
  int64_t row, column;
};

template <class T, int Rows, int Vectors>
inline void product_tile(int64_t inner, Strided<T> a, const T* b, int64_t b_row, T* c, int64_t c_row) {
  typedef T Vector __attribute__((vector_size(kVectorBytes), aligned(alignof(T)), may_alias));
  constexpr int kLanes = kVectorBytes / sizeof(T);
  Vector sum[Rows][Vectors];
  for (int r = 0; r < Rows; ++r)
    for (int v = 0; v < Vectors; ++v) sum[r][v] = *reinterpret_cast<const Vector*>(c + r * c_row + v * kLanes);
  for (int64_t i = 0; i < inner; ++i) {
    Vector right[Vectors];
    for (int v = 0; v < Vectors; ++v) right[v] = *reinterpret_cast<const Vector*>(b + i * b_row + v * kLanes);
    for (int r = 0; r < Rows; ++r) {
      const T left = a.data[r * a.row + i * a.column];
      for (int v = 0; v < Vectors; ++v) sum[r][v] += left * right[v];
    }
  }
  for (int r = 0; r < Rows; ++r)
    for (int v = 0; v < Vectors; ++v) *reinterpret_cast<Vector*>(c + r * c_row + v * kLanes) = sum[r][v];
}

template <class T, int Vectors>
inline void product_columns(int64_t rows, int64_t inner, Strided<T> a, const T* b, int64_t b_row, T* c, int64_t c_row) {
  int64_t r = 0;
  for (; r + kTileRows <= rows; r += kTileRows)
    product_tile<T, kTileRows, Vectors>(inner, {a.data + r * a.row, a.row, a.column}, b, b_row, c + r * c_row, c_row);
  for (; r < rows; ++r)
    product_tile<T, 1, Vectors>(inner, {a.data + r * a.row, a.row, a.column}, b, b_row, c + r * c_row, c_row);
}

// c [rows, columns] += a [rows, inner] b [inner, columns]; columns is a padded number.
template <class T>
inline void add_product(int64_t rows, int64_t inner, int64_t columns, Strided<T> a, const T* b, int64_t b_row, T* c,
                        int64_t c_row) {
  constexpr int64_t lanes = kVectorBytes / sizeof(T);
  int64_t k = 0;
  for (; k + kTileVectors * lanes <= columns; k += kTileVectors * lanes)
    product_columns<T, kTileVectors>(rows, inner, a, b + k, b_row, c + k, c_row);
  for (; k + 2 * lanes <= columns; k += 2 * lanes) product_columns<T, 2>(rows, inner, a, b + k, b_row, c + k, c_row);
  for (; k < columns; k += lanes) product_columns<T, 1>(rows, inner, a, b + k, b_row, c + k, c_row);
}

}  // namespace splitnerf::SPLITNERF_ISA
