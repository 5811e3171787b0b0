// sparse_product and light_lookup as torch operators.
#include <tuple>

#include "device.h"

namespace splitnerf::glue {
namespace {

// The rows of a sparse matrix are walked without further checks.
void check_rows(const char* op, const Tensor& offsets, int64_t n_entries) {
  const int64_t *row = in<int64_t>(offsets), n_rows = offsets.size(0) - 1;
  bool ascend = row[0] >= 0 && row[n_rows] <= n_entries;
  for (int64_t i = 0; i < n_rows; ++i) ascend &= row[i] <= row[i + 1];
  require(ascend, op, "offsets must ascend within [0, " + std::to_string(n_entries) + "]");
}

Tensor sparse_product(Tensor offsets, Tensor columns, Tensor weights, Tensor places, Tensor images,
                      Tensor transposed_offsets, Tensor transposed_columns, Tensor transposed_weights,
                      Tensor transposed_places, Tensor transposed_images, Tensor values) {
  const char* op = "sparse_product";
  const Kind type = real_kind(op, "values", values);
  const Tensor o = checked(op, "offsets", offsets, {kAny}, type.with(ScalarType::Long));
  const Tensor c = checked(op, "columns", columns, {kAny}, type.with(ScalarType::Int));
  const Tensor w = checked(op, "weights", weights, {c.size(0)}, type);
  const Tensor x = checked(op, "values", values, {kAny, 3}, type);
  require(o.size(0) > 0, op, "offsets must hold at least one number");
  const Tensor p = checked(op, "places", places, {o.size(0) - 1, kAny}, type.with(ScalarType::Int));
  const int64_t n_images = p.size(1), n_products = (o.size(0) - 1) * n_images;
  require(n_images == 1 || n_images == kMirrorImages, op,
          "places must have 1 or " + std::to_string(kMirrorImages) + " columns");
  const Tensor m = checked(op, "images", images, {x.size(0), n_images}, type.with(ScalarType::Int));
  checked(op, "transposed_offsets", transposed_offsets, {x.size(0) / n_images + 1}, type.with(ScalarType::Long));
  checked(op, "transposed_columns", transposed_columns, {c.size(0)}, type.with(ScalarType::Int));
  checked(op, "transposed_weights", transposed_weights, {c.size(0)}, type);
  checked(op, "transposed_places", transposed_places, {x.size(0) / n_images, n_images}, type.with(ScalarType::Int));
  checked(op, "transposed_images", transposed_images, {n_products, n_images}, type.with(ScalarType::Int));
  if (type.on_cpu()) {  // to look at a GPU's numbers would mean waiting for it
    check_rows(op, o, c.size(0));
    check_indices(op, "places", p, n_products);
    check_indices(op, "images", m, x.size(0));
  }
  Tensor products = empty_like_type(x, {n_products, 3}, type);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    const SparseRows<T> matrix{in<int64_t>(o),
                               in<int32_t>(c),
                               in<T>(w),
                               in<int32_t>(p),
                               in<int32_t>(m),
                               x.size(0),
                               static_cast<int>(n_images)};
    device.run(op, n_products, SparseProductBody<T>{matrix, in<T>(x), out<T>(products)});
  });
  return products;
}

// The arguments that describe the pyramid, checked and contiguous. resolutions and nodes are on the CPU, whatever the device of
// the others: with them the kernels are called.
struct Parts {
  Tensor levels, sh, resolutions, nodes, zonal;

  Parts(const char* op, Kind type, const Tensor& levels_in, const Tensor& sh_in, const Tensor& resolutions_in,
        const Tensor& nodes_in, const Tensor& zonal_in)
      : levels(checked(op, "levels", levels_in, {kAny, 3}, type)),
        sh(checked(op, "sh", sh_in, {kShCoefficients, 3}, type)),
        resolutions(checked(op, "resolutions", resolutions_in, {kAny}, ScalarType::Long)),
        nodes(checked(op, "nodes", nodes_in, {resolutions.size(0) + 1}, ScalarType::Double)),
        zonal(checked(op, "zonal", zonal_in, {kAny, kShBands}, type)) {
    const int64_t n = resolutions.size(0);
    require(n >= 1 && n <= kMaxLightLevels, op, "there must be 1 to " + std::to_string(kMaxLightLevels) + " levels");
    require(zonal.size(0) >= 2, op, "zonal must have at least two rows");
    int64_t texels = 0;
    for (int64_t k = 0; k < n; ++k) {
      const int64_t side = in<int64_t>(resolutions)[k];
      require(side >= 1 && side <= 1 << 14, op, "resolutions must be in [1, 2^14]");
      require(in<double>(nodes)[k] < in<double>(nodes)[k + 1], op, "nodes must ascend");
      texels += side * side;
    }
    require(in<double>(nodes)[n] < 1, op, "the last node must be below 1");
    require(texels == levels.size(0), op,
            "levels must hold " + std::to_string(texels) + " texels, got " + std::to_string(levels.size(0)));
  }

  template <class T> LightPyramid<T> view() const {
    LightPyramid<T> p{};
    p.levels = in<T>(levels), p.sh = in<T>(sh), p.zonal = in<T>(zonal);
    p.n_levels = static_cast<int>(resolutions.size(0)), p.n_zonal = static_cast<int>(zonal.size(0));
    p.recurrence = &sh_recurrence<T>();
    int64_t offset = 0;
    for (int k = 0; k < p.n_levels; ++k) {
      p.resolution[k] = static_cast<int>(in<int64_t>(resolutions)[k]);
      p.offset[k] = offset;
      offset += int64_t(p.resolution[k]) * p.resolution[k];
    }
    for (int k = 0; k <= p.n_levels; ++k) p.node[k] = T(in<double>(nodes)[k]);
    return p;
  }
};

Tensor light_lookup(Tensor directions, Tensor roughness, Tensor levels, Tensor sh, Tensor resolutions, Tensor nodes,
                    Tensor zonal) {
  const char* op = "light_lookup";
  const Kind type = real_kind(op, "levels", levels);
  const Tensor d = checked(op, "directions", directions, {kAny, 3}, type);
  const Tensor rho = checked(op, "roughness", roughness, {d.size(0), 1}, type);
  const Parts parts(op, type, levels, sh, resolutions, nodes, zonal);
  Tensor radiance = empty_like_type(d, {d.size(0), 3}, type);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, d.size(0),
               LightLookupBody<T>{parts.view<T>(), sh_recurrence<T>(), in<T>(d), in<T>(rho), out<T>(radiance)});
  });
  return radiance;
}

std::tuple<Tensor, Tensor, Tensor, Tensor> light_lookup_backward(Tensor directions, Tensor roughness, Tensor levels,
                                                                 Tensor sh, Tensor resolutions, Tensor nodes,
                                                                 Tensor zonal, Tensor grad_radiance) {
  const char* op = "light_lookup_backward";
  const Kind type = real_kind(op, "levels", levels);
  const Tensor d = checked(op, "directions", directions, {kAny, 3}, type);
  const Tensor rho = checked(op, "roughness", roughness, {d.size(0), 1}, type);
  const Tensor g = checked(op, "grad_radiance", grad_radiance, {d.size(0), 3}, type);
  const Parts parts(op, type, levels, sh, resolutions, nodes, zonal);
  Tensor grad_d = empty_like_type(d, {d.size(0), 3}, type), grad_rho = empty_like_type(d, {d.size(0), 1}, type);
  Tensor grad_levels = empty_like_type(d, {parts.levels.size(0), 3}, type);
  Tensor grad_sh = empty_like_type(d, {kShCoefficients, 3}, type);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.light_lookup_backward(parts.view<T>(), d.size(0), in<T>(d), in<T>(rho), in<T>(g), out<T>(grad_d),
                                 out<T>(grad_rho), out<T>(grad_levels), out<T>(grad_sh));
  });
  return {grad_d, grad_rho, grad_levels, grad_sh};
}

}  // namespace

SPLITNERF_OPERATORS(op) {
  op(SPLITNERF_OP(sparse_product),
     "offsets columns weights places images transposed_offsets transposed_columns transposed_weights transposed_places "
     "transposed_images values");
  op(SPLITNERF_OP(light_lookup), "directions roughness levels sh resolutions nodes zonal");
  op(SPLITNERF_OP(light_lookup_backward), "directions roughness levels sh resolutions nodes zonal grad_radiance");
}

}  // namespace splitnerf::glue
