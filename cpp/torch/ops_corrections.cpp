// wide_lobes and add_corrections as torch operators.
#include <optional>
#include <tuple>

#include "device.h"
#include "splitnerf/bodies/corrections.h"

namespace splitnerf::glue {
namespace {

// On the CPU numbers in [0, n); on a GPU they are not looked at.
Tensor checked_numbers(const char* op, const char* name, const Tensor& t, const Kind& type, int64_t size, int64_t n) {
  const Tensor numbers = checked(op, name, t, {size}, type.with(ScalarType::Long));
  if (type.on_cpu())
    require(all_below<int64_t>(numbers, n), op,
            std::string(name) + " must hold numbers in [0, " + std::to_string(n) + ")");
  require(numbers.size(0) == 0 || n > 0, op, std::string(name) + " must be empty where there is nothing to number");
  return numbers;
}

std::tuple<Tensor, Tensor> wide_lobes(Tensor candidates, Tensor roughness, double low, double high,
                                      std::optional<Tensor> n_candidates) {
  const char* op = "wide_lobes";
  const Kind type = real_kind(op, "roughness", roughness);
  const Tensor rho = checked(op, "roughness", roughness, {kAny, 1}, type);
  const Tensor numbers = checked_numbers(op, "candidates", candidates, type, kAny, rho.size(0));
  require(low < high, op, "low must be below high");
  const int64_t k = numbers.size(0);
  std::optional<Tensor> count;
  if (n_candidates) count = checked(op, "n_candidates", *n_candidates, {}, type.with(ScalarType::Long));
  const auto make = [&](int64_t n, ScalarType of) { return empty_like_type(rho, {n}, of); };
  Tensor at, share, offsets = make(count ? 0 : k + 1, ScalarType::Long);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    const WideLobes<T> lobes{in<int64_t>(numbers), in<T>(rho), rho.size(0), T(low), T(high)};
    int64_t n = k;
    if (!count) {
      device.run(op, k, CountWideLobesBody<T>{lobes, out<int64_t>(offsets)});
      device.sum_counts(op, k, out<int64_t>(offsets));
      n = device.read_number(in<int64_t>(offsets) + k);
    }
    at = make(n, ScalarType::Long), share = make(n, type);
    if (count)
      device.run(op, k, ShareWideLobesBody<T>{lobes, in<int64_t>(*count), out<int64_t>(at), out<T>(share)});
    else
      device.run(op, k, PackWideLobesBody<T>{lobes, in<int64_t>(offsets), out<int64_t>(at), out<T>(share)});
  });
  return {at, share};
}

// The shaded samples of rays, checked and contiguous.
struct Segments {
  Kind type;
  Tensor shaded, ray_indices, segment, weights, opacity;
  double min_opacity;

  Segments(const char* op, const Tensor& shaded_in, const Tensor& ray_indices_in, const Tensor& segment_in,
           const Tensor& weights_in, const Tensor& opacity_in, double min_opacity)
      : type(real_kind(op, "weights", weights_in)), weights(checked(op, "weights", weights_in, {kAny}, type)),
        opacity(checked(op, "opacity", opacity_in, {kAny}, type)), min_opacity(min_opacity) {
    const int64_t n = weights.size(0);
    ray_indices = checked(op, "ray_indices", ray_indices_in, {kAny}, type.with(ScalarType::Long));
    shaded = checked_numbers(op, "shaded", shaded_in, type, n, ray_indices.size(0));
    segment = checked(op, "segment", segment_in, {n}, type.with(ScalarType::Long));
    require(min_opacity > 0, op, "min_opacity must be positive");
  }
  int64_t n_rays() const { return opacity.size(0); }
  template <class T> ShadedSegments<T> view() const {
    return {weights.size(0),      ray_indices.size(0), n_rays(),      in<int64_t>(shaded), in<int64_t>(ray_indices),
            in<int64_t>(segment), in<T>(weights),      in<T>(opacity), T(min_opacity)};
  }
};

Tensor add_corrections(Tensor mean, Tensor correction, Tensor at, Tensor shaded, Tensor ray_indices, Tensor segment,
                       Tensor weights, Tensor opacity, double min_opacity) {
  const char* op = "add_corrections";
  const Segments s(op, shaded, ray_indices, segment, weights, opacity, min_opacity);
  const Tensor before = checked(op, "mean", mean, {s.n_rays(), 3}, s.type);
  const Tensor numbers = checked_numbers(op, "at", at, s.type, kAny, s.shaded.size(0));
  const Tensor added = checked(op, "correction", correction, {numbers.size(0), 3}, s.type);
  require(numbers.size(0) == 0 || s.n_rays() > 0, op, "there are no rays to correct");
  Tensor corrected = torch::stable::clone(before);
  on_device(s.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, numbers.size(0),
               AddCorrectionsBody<T>{s.view<T>(), in<int64_t>(numbers), in<T>(added), out<T>(corrected)});
  });
  return corrected;
}

Tensor add_corrections_backward(Tensor at, Tensor shaded, Tensor ray_indices, Tensor segment, Tensor weights,
                                Tensor opacity, double min_opacity, Tensor grad_mean) {
  const char* op = "add_corrections_backward";
  const Segments s(op, shaded, ray_indices, segment, weights, opacity, min_opacity);
  const Tensor g = checked(op, "grad_mean", grad_mean, {s.n_rays(), 3}, s.type);
  const Tensor numbers = checked_numbers(op, "at", at, s.type, kAny, s.shaded.size(0));
  require(numbers.size(0) == 0 || s.n_rays() > 0, op, "there are no rays to correct");
  Tensor to_correction = empty_like_type(g, {numbers.size(0), 3}, s.type);
  on_device(s.type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, numbers.size(0),
               AddCorrectionsBackwardBody<T>{s.view<T>(), in<int64_t>(numbers), in<T>(g), out<T>(to_correction)});
  });
  return to_correction;
}

}  // namespace

#define SPLITNERF_SEGMENTS \
  "Tensor at, Tensor shaded, Tensor ray_indices, Tensor segment, Tensor weights, Tensor opacity, float min_opacity"
STABLE_TORCH_LIBRARY_FRAGMENT(splitnerf, m) {
  m.def(
      "wide_lobes(Tensor candidates, Tensor roughness, float low, float high, Tensor? n_candidates) -> "
      "(Tensor, Tensor)");
  m.def("add_corrections(Tensor mean, Tensor correction, " SPLITNERF_SEGMENTS ") -> Tensor");
  m.def("add_corrections_backward(" SPLITNERF_SEGMENTS ", Tensor grad_mean) -> Tensor");
}

SPLITNERF_IMPLEMENT(m) {
  m.impl("wide_lobes", TORCH_BOX(&wide_lobes));
  m.impl("add_corrections", TORCH_BOX(&add_corrections));
  m.impl("add_corrections_backward", TORCH_BOX(&add_corrections_backward));
}

}  // namespace splitnerf::glue
