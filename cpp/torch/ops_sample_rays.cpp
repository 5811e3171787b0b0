// sample_rays as a torch operator.
#include <algorithm>
#include <tuple>
#include <vector>

#include "check_hash.h"
#include "splitnerf/ops_cpu.h"

namespace splitnerf::glue {
namespace {

// Kept samples of all rays in one array, ray after ray.
template <class T>
std::tuple<Tensor, Tensor, Tensor, Tensor, Tensor> packed(const Tensor& like, ScalarType type, T step,
                                                          const std::vector<cpu::SampledRay<T>>& rays) {
  const int64_t n_rays = static_cast<int64_t>(rays.size());
  Tensor offsets = empty_like_type(like, {n_rays + 1}, ScalarType::Long), evaluated = empty_like_type(like, {n_rays}, ScalarType::Long);
  int64_t n = 0;
  for (int64_t r = 0; r < n_rays; ++r) {
    out<int64_t>(offsets)[r] = n;
    out<int64_t>(evaluated)[r] = rays[r].n_evaluated;
    n += static_cast<int64_t>(rays[r].starts.size());
  }
  out<int64_t>(offsets)[n_rays] = n;
  Tensor ray_indices = empty_like_type(like, {n}, ScalarType::Long);
  Tensor t_starts = empty_like_type(like, {n}, type), t_ends = empty_like_type(like, {n}, type);
  for (int64_t r = 0, i = 0; r < n_rays; ++r) {
    for (const T start : rays[r].starts) {
      out<int64_t>(ray_indices)[i] = r;
      out<T>(t_starts)[i] = start;
      out<T>(t_ends)[i] = start + step;
      ++i;
    }
  }
  return {ray_indices, t_starts, t_ends, offsets, evaluated};
}

std::tuple<Tensor, Tensor, Tensor, Tensor, Tensor> sample_rays(
    Tensor rays_o, Tensor rays_d, Tensor jitter, Tensor cells, Tensor table, Tensor hidden, Tensor hidden_bias,
    Tensor out_weights, double out_bias, double beta, int64_t n_levels, int64_t base_resolution, double growth,
    int64_t log2_table_size, int64_t n_active, double box, double step, int64_t max_samples, double s, double min_weight,
    double min_transmittance, double reach, double lipschitz) {
  const char* op = "sample_rays";
  const ScalarType type = real_type(op, "table", table);
  const Tensor o = checked(op, "rays_o", rays_o, {kAny, 3}, type);
  const int64_t n_rays = o.size(0);
  const Tensor d = checked(op, "rays_d", rays_d, {n_rays, 3}, type), u = checked(op, "jitter", jitter, {n_rays}, type);
  require(cells.dim() == 3 && cells.size(0) > 0, op, "cells must be [r, r, r] uint8 with r > 0");
  const int64_t resolution = cells.size(0);
  const Tensor grid = checked(op, "cells", cells, {resolution, resolution, resolution}, ScalarType::Byte);
  require(table.dim() == 2, op, "table must be [n_entries, n_features]");
  const auto shape = checked_shape(op, n_levels, base_resolution, growth, log2_table_size, table.size(1), n_active);
  const Tensor t = checked(op, "table", table, {n_entries(shape), shape.n_features}, type);
  const Tensor w = checked(op, "hidden", hidden, {kAny, 3 + n_levels * shape.n_features}, type);
  const Tensor b = checked(op, "hidden_bias", hidden_bias, {w.size(0)}, type);
  const Tensor v = checked(op, "out", out_weights, {w.size(0)}, type);
  require(box > 0 && step > 0 && s > 0 && beta > 0 && lipschitz > 0, op, "box, step, s, beta and lipschitz must be positive");
  require(min_transmittance >= 0 && min_transmittance < 1, op, "min_transmittance must be in [0, 1)");
  std::array<HashLevel, kMaxLevels> levels;
  hash_levels(shape, levels.data());
  const MarchOptions march{static_cast<float>(box), static_cast<int>(resolution), static_cast<float>(step), max_samples};
  std::tuple<Tensor, Tensor, Tensor, Tensor, Tensor> result;
  dispatch_real(type, [&](auto zero) {
    using T = decltype(zero);
    const SdfNetwork<T> net{{levels.data(), shape.n_features, shape.n_levels, static_cast<int>(n_active), 0, nullptr, in<T>(t)},
                            static_cast<int>(w.size(0)), in<T>(w), in<T>(b), in<T>(v), T(out_bias), T(beta), T(box)};
    const cpu::SampleRules<T> rules{T(s), T(min_weight), T(-std::log(min_transmittance)), T(reach), T(lipschitz)};
    std::vector<cpu::SampledRay<T>> rays(n_rays);
    cpu::sample_rays(net, march, in<uint8_t>(grid), rules, n_rays, in<T>(o), in<T>(d), in<T>(u), rays.data());
    result = packed(o, type, T(step), rays);
  });
  return result;
}

}  // namespace

STABLE_TORCH_LIBRARY_FRAGMENT(splitnerf, m) {
  m.def("sample_rays(Tensor rays_o, Tensor rays_d, Tensor jitter, Tensor cells, Tensor table, Tensor hidden, "
        "Tensor hidden_bias, Tensor out, float out_bias, float beta, int n_levels, int base_resolution, float growth, "
        "int log2_table_size, int n_active, float box, float step, int max_samples, float s, float min_weight, "
        "float min_transmittance, float reach, float lipschitz) -> (Tensor, Tensor, Tensor, Tensor, Tensor)");
}

STABLE_TORCH_LIBRARY_IMPL(splitnerf, CPU, m) { m.impl("sample_rays", TORCH_BOX(&sample_rays)); }

}  // namespace splitnerf::glue
