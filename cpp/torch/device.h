// One call for the CPU and the GPU: an operator's body runs with the functions of cpu:: or with those of cuda::, these on the
// tensors' device and torch's current stream.
#pragma once

#include "check.h"
#include "splitnerf/ops_cpu.h"
#ifdef SPLITNERF_WITH_CUDA
#include <torch/csrc/stable/accelerator.h>

#include <vector>

#include "splitnerf/ops_cuda.h"
#endif

namespace splitnerf::glue {

// The operators that both devices have.
// clang-format off
#define SPLITNERF_EACH_OPERATOR(X)                                                                           \
  X(hash_encode) X(hash_encode_backward) X(hash_encode_backward_positions) X(query_direction)                \
  X(query_direction_backward) X(split_sum_shade) X(split_sum_shade_backward) X(prefilter_light)              \
  X(prefilter_light_backward) X(sample_ggx_lobe) X(sparse_product) X(light_lookup) X(light_lookup_backward)  \
  X(sample_bsdf) X(monte_carlo_light) X(monte_carlo_light_backward) X(summed_light) X(summed_light_backward) \
  X(shade_sums) X(shade_sums_backward) X(linear_to_srgb) X(linear_to_srgb_backward) X(srgb_to_linear)        \
  X(pixel_losses) X(gradient_losses) X(material_losses) X(quadratic_entropy) X(occupied_blocks)              \
  X(march_rays_count) X(march_rays_fill) X(neus_weights) X(neus_weights_backward) X(surface_weights)         \
  X(surface_weights_backward) X(composite) X(composite_backward) X(spread_samples) X(interpolate) X(interpolate_backward)      \
  X(sdf_values) X(sdf_layer) X(sdf_layer_backward) X(cached_occlusion) X(cached_visibility) X(sample_rays)   \
  X(adamw_step)
// clang-format on

// device.hash_encode(...) is cpu::hash_encode(...) or cuda::hash_encode(queue, ...).
struct OnCpu {
#define SPLITNERF_CALL(op) \
  template <class... Arguments> auto op(Arguments... arguments) const { return cpu::op(arguments...); }
  SPLITNERF_EACH_OPERATOR(SPLITNERF_CALL)
#undef SPLITNERF_CALL
  int64_t read_number(const int64_t* number) const { return *number; }
};

#ifdef SPLITNERF_WITH_CUDA
// The handle of torch's current CUDA stream.
cudaStream_t current_stream(int32_t device);

// Makes a device the current one for its lifetime, and owns the work memory that the kernels ask for: torch hands memory back
// to later users of the stream only, so it may end before the kernels do.
class OnCuda {
 public:
  explicit OnCuda(const Device& device)
      : guard_(device.index()), device_(device), queue_{current_stream(device.index()), allocate, this} {
    cuda::use_device(device.index());
  }
  OnCuda(const OnCuda&) = delete;
  OnCuda& operator=(const OnCuda&) = delete;

#define SPLITNERF_CALL(op) \
  template <class... Arguments> auto op(Arguments... arguments) const { return cuda::op(queue_, arguments...); }
  SPLITNERF_EACH_OPERATOR(SPLITNERF_CALL)
#undef SPLITNERF_CALL

  int64_t read_number(const int64_t* number) const { return cuda::read_number(queue_, number); }

 private:
  static void* allocate(void* self, int64_t bytes) {
    auto& here = *static_cast<OnCuda*>(self);
    here.scratch_.push_back(torch::stable::empty({bytes}, ScalarType::Byte, std::nullopt, here.device_));
    return here.scratch_.back().mutable_data_ptr();
  }

  torch::stable::accelerator::DeviceGuard guard_;
  Device device_;
  cuda::Queue queue_;
  std::vector<Tensor> scratch_;
};
#endif

// Calls body(T{}, device) with T = float or double and the functions of a device.
template <class Body> void on_device(const Kind& kind, Body&& body) {
#ifdef SPLITNERF_WITH_CUDA
  if (!kind.on_cpu()) {
    OnCuda device(kind.device);
    return dispatch_real(kind, [&](auto zero) { body(zero, device); });
  }
#endif
  dispatch_real(kind, [&](auto zero) { body(zero, OnCpu{}); });
}

// SPLITNERF_IMPLEMENT(m) { m.impl(...); } registers operators for every device that this build serves.
#ifdef SPLITNERF_WITH_CUDA
#define SPLITNERF_IMPLEMENT_CUDA \
  STABLE_TORCH_LIBRARY_IMPL(splitnerf, CUDA, library) { implement(library); }
#else
#define SPLITNERF_IMPLEMENT_CUDA
#endif
#define SPLITNERF_IMPLEMENT(m)                                               \
  static void implement(torch::stable::detail::StableLibrary& m);            \
  STABLE_TORCH_LIBRARY_IMPL(splitnerf, CPU, library) { implement(library); } \
  SPLITNERF_IMPLEMENT_CUDA                                                   \
  static void implement(torch::stable::detail::StableLibrary& m)

}  // namespace splitnerf::glue
