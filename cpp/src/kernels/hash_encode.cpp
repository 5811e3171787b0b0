#include "kernel_set.h"

namespace splitnerf::SPLITNERF_ISA {
namespace {

// Features of one level, at compile time so that the inner loops unroll.
template <class T, int F>
void encode_level(const HashEncodeArgs<T>& args, int l, int64_t begin, int64_t end, T* features, T* jacobian) {
  const HashLevel& level = args.levels[l];
  const int64_t n_columns = int64_t(args.n_levels) * F;
  for (int64_t p = begin; p < end; ++p) {
    const HashCell<T> cell = hash_cell(level, load3(args.positions + 3 * p));
    T value[F] = {}, dx[F] = {}, dy[F] = {}, dz[F] = {};
    if (jacobian) {
      for (int i = 0; i < 8; ++i) {
        const CornerWeight<T> w = corner_weight_derivatives(cell, i);
        const T* entry = args.table + cell.index[i] * F;
        for (int f = 0; f < F; ++f) {
          value[f] += w.value * entry[f];
          dx[f] += w.d.x * entry[f];
          dy[f] += w.d.y * entry[f];
          dz[f] += w.d.z * entry[f];
        }
      }
      T* row = jacobian + p * 3 * n_columns + l * F;
      for (int f = 0; f < F; ++f) {
        row[f] = dx[f];
        row[n_columns + f] = dy[f];
        row[2 * n_columns + f] = dz[f];
      }
    } else {
      for (int i = 0; i < 8; ++i) {
        const T w = corner_weight(cell, i);
        const T* entry = args.table + cell.index[i] * F;
        for (int f = 0; f < F; ++f) value[f] += w * entry[f];
      }
    }
    T* row = features + p * n_columns + l * F;
    for (int f = 0; f < F; ++f) row[f] = value[f];
  }
}

template <class T, int F>
void scatter_level(const HashEncodeArgs<T>& args, int l, const T* grad_features, const T* grad_jacobian, T* grad_table) {
  const HashLevel& level = args.levels[l];
  const int64_t n_columns = int64_t(args.n_levels) * F;
  for (int64_t p = 0; p < args.n_points; ++p) {
    const HashCell<T> cell = hash_cell(level, load3(args.positions + 3 * p));
    const T* g = grad_features ? grad_features + p * n_columns + l * F : nullptr;
    const T* gj = grad_jacobian ? grad_jacobian + p * 3 * n_columns + l * F : nullptr;
    for (int i = 0; i < 8; ++i) {
      const CornerWeight<T> w = corner_weight_derivatives(cell, i);
      T* entry = grad_table + cell.index[i] * F;
      for (int f = 0; f < F; ++f) {
        T grad = g ? w.value * g[f] : T(0);
        if (gj) grad += w.d.x * gj[f] + w.d.y * gj[n_columns + f] + w.d.z * gj[2 * n_columns + f];
        entry[f] += grad;
      }
    }
  }
}

template <class T, int F>
void position_gradient(const HashEncodeArgs<T>& args, int64_t begin, int64_t end, const T* grad_features,
                       const T* grad_jacobian, T* grad_positions) {
  const int64_t n_columns = int64_t(args.n_levels) * F;
  for (int64_t p = begin; p < end; ++p) {
    Vec3<T> grad{T(0), T(0), T(0)};
    for (int l = 0; l < args.n_active; ++l) {
      const HashCell<T> cell = hash_cell(args.levels[l], load3(args.positions + 3 * p));
      for (int i = 0; i < 8; ++i) {
        const CornerWeight<T> w = corner_weight_derivatives(cell, i);
        const T* entry = args.table + cell.index[i] * F;
        for (int f = 0; f < F; ++f) {
          if (grad_features) grad += w.d * (entry[f] * grad_features[p * n_columns + l * F + f]);
          if (!grad_jacobian) continue;
          const T* gj = grad_jacobian + p * 3 * n_columns + l * F + f;
          const T gx = gj[0], gy = gj[n_columns], gz = gj[2 * n_columns];
          grad += Vec3<T>{w.dxy * gy + w.dxz * gz, w.dxy * gx + w.dyz * gz, w.dxz * gx + w.dyz * gy} * entry[f];
        }
      }
    }
    store3(grad_positions + 3 * p, grad);
  }
}

constexpr int64_t kBlock = 512;  // points whose output rows stay in the L2 while all levels fill them

template <class T, int F>
void encode_all(const HashEncodeArgs<T>& args, int64_t begin, int64_t end, T* features, T* jacobian) {
  for (int64_t b = begin; b < end; b += kBlock)
    for (int l = 0; l < args.n_active; ++l) encode_level<T, F>(args, l, b, min_of(end, b + kBlock), features, jacobian);
}

}  // namespace

template <class T>
void hash_encode(const HashEncodeArgs<T>& args, int64_t begin, int64_t end, T* features, T* jacobian) {
  switch (args.n_features) {
    case 1: return encode_all<T, 1>(args, begin, end, features, jacobian);
    case 2: return encode_all<T, 2>(args, begin, end, features, jacobian);
    case 4: return encode_all<T, 4>(args, begin, end, features, jacobian);
    case 8: return encode_all<T, 8>(args, begin, end, features, jacobian);
  }
}

template <class T>
void hash_scatter(const HashEncodeArgs<T>& args, int level, const T* grad_features, const T* grad_jacobian,
                  T* grad_table) {
  switch (args.n_features) {
    case 1: return scatter_level<T, 1>(args, level, grad_features, grad_jacobian, grad_table);
    case 2: return scatter_level<T, 2>(args, level, grad_features, grad_jacobian, grad_table);
    case 4: return scatter_level<T, 4>(args, level, grad_features, grad_jacobian, grad_table);
    case 8: return scatter_level<T, 8>(args, level, grad_features, grad_jacobian, grad_table);
  }
}

template <class T>
void hash_position_gradient(const HashEncodeArgs<T>& args, int64_t begin, int64_t end, const T* grad_features,
                            const T* grad_jacobian, T* grad_positions) {
  switch (args.n_features) {
    case 1: return position_gradient<T, 1>(args, begin, end, grad_features, grad_jacobian, grad_positions);
    case 2: return position_gradient<T, 2>(args, begin, end, grad_features, grad_jacobian, grad_positions);
    case 4: return position_gradient<T, 4>(args, begin, end, grad_features, grad_jacobian, grad_positions);
    case 8: return position_gradient<T, 8>(args, begin, end, grad_features, grad_jacobian, grad_positions);
  }
}

#define SPLITNERF_INSTANTIATE(T)                                                                          \
  template void hash_encode<T>(const HashEncodeArgs<T>&, int64_t, int64_t, T*, T*);                       \
  template void hash_scatter<T>(const HashEncodeArgs<T>&, int, const T*, const T*, T*);                   \
  template void hash_position_gradient<T>(const HashEncodeArgs<T>&, int64_t, int64_t, const T*, const T*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::SPLITNERF_ISA
