// One call for the CPU and the GPU: device.run(op, n, body) runs a body of splitnerf/bodies/ on the device of an operator's
// tensors, a GPU in torch's current stream.
#pragma once

#include <algorithm>
#include <memory>
#include <vector>

#include "check.h"
#include "register.h"
#include "splitnerf/ops_cpu.h"
#ifdef SPLITNERF_WITH_CUDA
#include <torch/csrc/stable/accelerator.h>

#include "splitnerf/ops_cuda.h"
#endif

namespace splitnerf::glue {

// The operators that are more than bodies, with a strategy of its own for each device: device.hash_encode(...) is
// cpu::hash_encode(...) or cuda::hash_encode(queue, ...).
#define SPLITNERF_EACH_STRATEGY(X)  \
  X(hash_encode)                    \
  X(hash_encode_backward)           \
  X(hash_encode_backward_positions) \
  X(prefilter_light)                \
  X(prefilter_light_backward)       \
  X(light_lookup_backward)          \
  X(spread_samples) X(sdf_values) X(sdf_field) X(sdf_field_backward) X(sample_rays) X(shared_light_backward)

// What an operator asks of a device. The first argument names the operator in errors of a GPU; scratch memory lives until the
// call of on_device ends.
class OnCpu {
 public:
  template <class Body> void run(const char*, int64_t n, const Body& body) const { cpu::run(n, body); }
  template <class T> T* scratch(int64_t n) const {
    scratch_.emplace_back(new unsigned char[n * sizeof(T)]);
    return reinterpret_cast<T*>(scratch_.back().get());
  }
  template <class T> void clear(const char*, T* values, int64_t n) const { std::fill_n(values, n, T(0)); }
  // offsets [n + 1]: 0, and the counts in what follows become their sums.
  void sum_counts(const char*, int64_t n, int64_t* offsets) const {
    offsets[0] = 0;
    for (int64_t i = 0; i < n; ++i) offsets[i + 1] += offsets[i];
  }
  int64_t read_number(const int64_t* number) const { return *number; }

#define SPLITNERF_CALL(op) \
  template <class... Arguments> auto op(Arguments... arguments) const { return cpu::op(arguments...); }
  SPLITNERF_EACH_STRATEGY(SPLITNERF_CALL)
#undef SPLITNERF_CALL

 private:
  mutable std::vector<std::unique_ptr<unsigned char[]>> scratch_;
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

  template <class Body> void run(const char* op, int64_t n, const Body& body) const { cuda::run(queue_, op, n, body); }
  template <class T> T* scratch(int64_t n) const { return queue_.scratch<T>(n); }
  template <class T> void clear(const char* op, T* values, int64_t n) const { cuda::clear(queue_, op, values, n); }
  void sum_counts(const char* op, int64_t n, int64_t* offsets) const { cuda::sum_counts(queue_, op, n, offsets); }
  int64_t read_number(const int64_t* number) const { return cuda::read_number(queue_, number); }

#define SPLITNERF_CALL(op) \
  template <class... Arguments> auto op(Arguments... arguments) const { return cuda::op(queue_, arguments...); }
  SPLITNERF_EACH_STRATEGY(SPLITNERF_CALL)
#undef SPLITNERF_CALL

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

// Calls body(T{}, device) with T = float or double and the device.
template <class Body> void on_device(const Kind& kind, Body&& body) {
#ifdef SPLITNERF_WITH_CUDA
  if (!kind.on_cpu()) {
    OnCuda device(kind.device);
    return dispatch_real(kind, [&](auto zero) { body(zero, device); });
  }
#endif
  dispatch_real(kind, [&](auto zero) { body(zero, OnCpu{}); });
}

}  // namespace splitnerf::glue
