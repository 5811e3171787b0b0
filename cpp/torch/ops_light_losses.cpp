// light_prior as a torch operator.
#include <vector>

#include "device.h"
#include "splitnerf/bodies/light_losses.h"

namespace splitnerf::glue {
namespace {

template <class T>
TexelLevels<T> texel_levels(const char* op, const Tensor& texels, const std::vector<int64_t>& sizes) {
  TexelLevels<T> levels{static_cast<int>(sizes.size()), {}, in<T>(texels)};
  require(!sizes.empty() && sizes.size() <= levels.kMost, op, "level_sizes must hold 1 to 16 numbers");
  int64_t n = 0;
  for (size_t k = 0; k < sizes.size(); ++k) {
    require(sizes[k] > 0, op, "level_sizes must be positive");
    n += levels.sizes[k] = sizes[k];
  }
  require(n == texels.size(0), op, "level_sizes must sum to the number of texels");
  return levels;
}

Tensor light_prior(Tensor texels, std::vector<int64_t> level_sizes) {
  const char* op = "light_prior";
  const Kind type = real_kind(op, "texels", texels);
  const Tensor x = checked(op, "texels", texels, {kAny, 3}, type);
  Tensor loss = empty_like_type(x, {}, type);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, x.size(0), LightPriorBody<T>{texel_levels<T>(op, x, level_sizes), out<T>(loss)});
  });
  return loss;
}

Tensor light_prior_backward(Tensor texels, std::vector<int64_t> level_sizes, Tensor grad_loss) {
  const char* op = "light_prior_backward";
  const Kind type = real_kind(op, "texels", texels);
  const Tensor x = checked(op, "texels", texels, {kAny, 3}, type), g = checked(op, "grad_loss", grad_loss, {}, type);
  Tensor grad_texels = torch::stable::empty_like(x);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, x.size(0),
               LightPriorBackwardBody<T>{texel_levels<T>(op, x, level_sizes), in<T>(g), out<T>(grad_texels)});
  });
  return grad_texels;
}

}  // namespace

SPLITNERF_OPERATORS(op) {
  op(SPLITNERF_OP(light_prior), "texels level_sizes");
  op(SPLITNERF_OP(light_prior_backward), "texels level_sizes grad_loss");
}

}  // namespace splitnerf::glue
