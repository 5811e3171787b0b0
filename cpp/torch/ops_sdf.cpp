// sdf_field, sdf_values and sample_rays as torch operators.
#include <algorithm>
#include <optional>
#include <tuple>
#include <vector>

#include "check_hash.h"
#include "device.h"

namespace splitnerf::glue {
namespace {

// The weights of the layer, checked and contiguous; with lengths, directions of weights.
struct Weights {
  Kind type;
  Tensor hidden, hidden_bias, out, out_bias;
  double beta, box;
  std::optional<Tensor> hidden_length, out_length;

  Weights(const char* op, int64_t n_features, const Tensor& hidden_in, const Tensor& hidden_bias_in,
          const Tensor& out_in, const Tensor& out_bias_in, double beta, double box)
      : type(real_kind(op, "hidden", hidden_in)),
        hidden(checked(op, "hidden", hidden_in, {kAny, 3 + n_features}, type)),
        hidden_bias(checked(op, "hidden_bias", hidden_bias_in, {hidden.size(0)}, type)),
        out(checked(op, "out", out_in, {kAny, hidden.size(0)}, type)),
        out_bias(checked(op, "out_bias", out_bias_in, {out.size(0)}, type)), beta(beta), box(box) {
    require(out.size(0) > 0, op, "out must have a row, the distance's");
    require(beta > 0 && box > 0, op, "beta and box must be positive");
  }
  void set_lengths(const char* op, const Tensor& of_hidden, const Tensor& of_out) {
    hidden_length = checked(op, "hidden_length", of_hidden, {hidden.size(0), 1}, type);
    out_length = checked(op, "out_length", of_out, {out.size(0), 1}, type);
  }
  template <class T> SdfWeights<T> view() const {
    return {static_cast<int>(hidden.size(1)),
            static_cast<int>(hidden.size(0)),
            static_cast<int>(out.size(0)),
            in<T>(hidden),
            in<T>(hidden_bias),
            in<T>(out),
            in<T>(out_bias),
            T(beta),
            T(box),
            hidden_length ? in<T>(*hidden_length) : nullptr,
            out_length ? in<T>(*out_length) : nullptr};
  }
};

// A distance field: hash grid and layer.
struct Field {
  Table table;
  Weights weights;
  Kind type;

  Field(const char* op, const Tensor& table_in, const Tensor& hidden, const Tensor& hidden_bias, const Tensor& out,
        const Tensor& out_bias, double beta, int64_t n_levels, int64_t base_resolution, double growth,
        int64_t log2_table_size, int64_t n_active, double box)
      : table(op, table_in, n_levels, base_resolution, growth, log2_table_size, n_active),
        weights(op, n_levels * table.shape.n_features, hidden, hidden_bias, out, out_bias, beta, box),
        type(weights.type) {
    require(table.type.type == type.type && table.type.device == type.device, op,
            "table must be " + describe(type) + (type == ScalarType::Float ? " or float16" : "") + " on " +
                describe(type.device) + " as hidden is, got " + describe(table.entries.scalar_type()) + " on " +
                describe(table.type.device));
  }
  template <class T> SdfField<T> view() const { return {table.shape, table.n_active, table.view(), weights.view<T>()}; }
};

std::tuple<Tensor, Tensor, Tensor> sdf_field(Tensor positions, Tensor table, Tensor hidden, Tensor hidden_length,
                                             Tensor hidden_bias, Tensor out_weights, Tensor out_length, Tensor out_bias,
                                             double beta, int64_t n_levels, int64_t base_resolution, double growth,
                                             int64_t log2_table_size, int64_t n_active, double box,
                                             std::optional<Tensor> stored) {
  const char* op = "sdf_field";
  Field field(op, table, hidden, hidden_bias, out_weights, out_bias, beta, n_levels, base_resolution, growth,
              log2_table_size, n_active, box);
  field.weights.set_lengths(op, hidden_length, out_length);
  if (stored) field.table.read(op, *stored);
  const Tensor x = checked(op, "positions", positions, {kAny, 3}, field.type);
  const int64_t n = x.size(0);
  Tensor outputs = empty_like_type(x, {n, field.weights.out.size(0)}, field.type);
  Tensor features = empty_like_type(x, {n, field.weights.hidden.size(1) - 3}, field.type);
  Tensor gradient = empty_like_type(x, {n, 3}, field.type);
  on_device(field.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.sdf_field(field.view<T>(), n, in<T>(x), SdfOutputs<T>{out<T>(outputs), out<T>(features), out<T>(gradient)});
  });
  return {outputs, features, gradient};
}

std::tuple<Tensor, Tensor, Tensor, Tensor, Tensor, Tensor, Tensor> sdf_field_backward(
    Tensor positions, Tensor table, Tensor hidden, Tensor hidden_length, Tensor hidden_bias, Tensor out_weights,
    Tensor out_length, Tensor out_bias, double beta, int64_t n_levels, int64_t base_resolution, double growth,
    int64_t log2_table_size, int64_t n_active, double box, Tensor grad_outputs, Tensor grad_features,
    Tensor grad_gradient) {
  const char* op = "sdf_field_backward";
  Field field(op, table, hidden, hidden_bias, out_weights, out_bias, beta, n_levels, base_resolution, growth,
              log2_table_size, n_active, box);
  Weights& w = field.weights;
  w.set_lengths(op, hidden_length, out_length);
  const Tensor x = checked(op, "positions", positions, {kAny, 3}, field.type);
  const int64_t n = x.size(0);
  const Tensor go = checked(op, "grad_outputs", grad_outputs, {n, w.out.size(0)}, field.type);
  const Tensor gf = checked(op, "grad_features", grad_features, {n, w.hidden.size(1) - 3}, field.type);
  const Tensor gg = checked(op, "grad_gradient", grad_gradient, {n, 3}, field.type);
  const auto like = [&](const Tensor& t) { return torch::stable::empty_like(t); };
  Tensor to_table = empty_like_type(x, {table.size(0), table.size(1)}, field.type);
  Tensor to_hidden = like(w.hidden), to_hidden_length = like(*w.hidden_length), to_hidden_bias = like(w.hidden_bias);
  Tensor to_out = like(w.out), to_out_length = like(*w.out_length), to_out_bias = like(w.out_bias);
  on_device(field.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.sdf_field_backward(
        field.view<T>(), n, in<T>(x), SdfOutputs<const T>{in<T>(go), in<T>(gf), in<T>(gg)},
        SdfFieldGrad<T>{out<T>(to_table), out<T>(to_hidden), out<T>(to_hidden_length), out<T>(to_hidden_bias),
                        out<T>(to_out), out<T>(to_out_length), out<T>(to_out_bias)});
  });
  return {to_table, to_hidden, to_hidden_length, to_hidden_bias, to_out, to_out_length, to_out_bias};
}

Tensor sdf_values(Tensor positions, Tensor table, Tensor hidden, Tensor hidden_bias, Tensor out_weights,
                  Tensor out_bias, double beta, int64_t n_levels, int64_t base_resolution, double growth,
                  int64_t log2_table_size, int64_t n_active, double box) {
  const char* op = "sdf_values";
  const Field field(op, table, hidden, hidden_bias, out_weights, out_bias, beta, n_levels, base_resolution, growth,
                    log2_table_size, n_active, box);
  const Tensor x = checked(op, "positions", positions, {kAny, 3}, field.type);
  Tensor values = empty_like_type(x, {x.size(0)}, field.type);
  on_device(field.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.sdf_values(field.view<T>(), x.size(0), in<T>(x), out<T>(values));
  });
  return values;
}

std::tuple<Tensor, Tensor, Tensor, Tensor, Tensor, Tensor> sample_rays(
    Tensor rays_o, Tensor rays_d, Tensor jitter, Tensor cells, Tensor table, Tensor hidden, Tensor hidden_bias,
    Tensor out_weights, Tensor out_bias, double beta, int64_t n_levels, int64_t base_resolution, double growth,
    int64_t log2_table_size, int64_t n_active, double box, double step, int64_t max_samples, double s, double anneal,
    double min_weight, double min_transmittance, double reach, double lipschitz, int64_t capacity) {
  const char* op = "sample_rays";
  const Field field(op, table, hidden, hidden_bias, out_weights, out_bias, beta, n_levels, base_resolution, growth,
                    log2_table_size, n_active, box);
  const Tensor o = checked(op, "rays_o", rays_o, {kAny, 3}, field.type);
  const int64_t n_rays = o.size(0);
  const Tensor d = checked(op, "rays_d", rays_d, {n_rays, 3}, field.type),
               u = checked(op, "jitter", jitter, {n_rays}, field.type);
  require(cells.dim() == 3 && cells.size(0) > 0, op, "cells must be [r, r, r] uint8 with r > 0");
  const int64_t resolution = cells.size(0);
  const Tensor grid =
      checked(op, "cells", cells, {resolution, resolution, resolution}, field.type.with(ScalarType::Byte));
  require(step > 0 && s > 0 && lipschitz > 0, op, "step, s and lipschitz must be positive");
  require(min_transmittance >= 0 && min_transmittance < 1 && min_weight >= 0 && min_weight < 1, op,
          "min_weight and min_transmittance must be in [0, 1)");
  require(capacity >= 0, op, "capacity must not be negative");
  require(reach >= 0 && anneal >= 0 && anneal <= 1, op, "reach must not be negative, anneal must be in [0, 1]");
  const MarchOptions march{static_cast<float>(box), static_cast<float>(step), max_samples};
  const int64_t n_blocks = blocks_along(static_cast<int>(resolution));
  Tensor blocks = empty_like_type(o, {n_blocks, n_blocks, n_blocks}, ScalarType::Byte);
  const OccupancyView occupancy{in<uint8_t>(grid), out<uint8_t>(blocks), static_cast<int>(resolution),
                                static_cast<int>(n_blocks)};
  Tensor offsets = empty_like_type(o, {n_rays + 1}, ScalarType::Long);
  Tensor evaluated = empty_like_type(o, {n_rays}, ScalarType::Long), found = empty_like_type(o, {}, ScalarType::Long);
  Tensor ray_indices, t_starts, t_ends;
  on_device(field.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    const SampleRules<T> rules{T(s),     T(anneal),   T(min_weight), T(-std::log(min_weight)), T(min_transmittance),
                               T(reach), T(lipschitz)};
    const SampleAllocator<T> allocate = [&](int64_t n) {
      ray_indices = empty_like_type(o, {n}, ScalarType::Long);
      t_starts = empty_like_type(o, {n}, field.type), t_ends = empty_like_type(o, {n}, field.type);
      return PackedSamples<T>{out<int64_t>(ray_indices), out<T>(t_starts), out<T>(t_ends)};
    };
    device.run(op, blocks.numel(),
               OccupiedBlocksBody{occupancy.cells, occupancy.resolution, occupancy.n_blocks, out<uint8_t>(blocks)});
    device.sample_rays(field.view<T>(), march, occupancy, rules, n_rays, in<T>(o), in<T>(d), in<T>(u), capacity,
                       out<int64_t>(offsets), out<int64_t>(evaluated), out<int64_t>(found), allocate);
  });
  return {ray_indices, t_starts, t_ends, offsets, evaluated, found};
}

}  // namespace

SPLITNERF_OPERATORS(op) {
  op(SPLITNERF_OP(sdf_field),
     "positions table hidden hidden_length hidden_bias out out_length out_bias beta n_levels base_resolution growth "
     "log2_table_size n_active box stored=None");
  op(SPLITNERF_OP(sdf_field_backward),
     "positions table hidden hidden_length hidden_bias out out_length out_bias beta n_levels base_resolution growth "
     "log2_table_size n_active box grad_outputs grad_features grad_gradient");
  op(SPLITNERF_OP(sdf_values),
     "positions table hidden hidden_bias out out_bias beta n_levels base_resolution growth log2_table_size n_active "
     "box");
  op(SPLITNERF_OP(sample_rays),
     "rays_o rays_d jitter cells table hidden hidden_bias out out_bias beta n_levels base_resolution growth "
     "log2_table_size n_active box step max_samples s anneal min_weight min_transmittance reach lipschitz capacity");
}

}  // namespace splitnerf::glue
