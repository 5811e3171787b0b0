#include "device.h"

#include <dlfcn.h>

#include <stdexcept>

namespace splitnerf::glue {

// The one function that only torch's CUDA library has. It is looked up when the first CUDA tensor comes, which that library
// must have made: so the operators load beside a torch for the CPU as well.
cudaStream_t current_stream(int32_t device) {
  using GetStream = int32_t (*)(int32_t device, void** stream);
  static const auto get = [] {
    void* library = dlopen("libtorch_cuda.so", RTLD_LAZY | RTLD_NOLOAD);
    return library ? reinterpret_cast<GetStream>(dlsym(library, "aoti_torch_get_current_cuda_stream")) : nullptr;
  }();
  void* stream = nullptr;
  if (!get || get(device, &stream) != 0) throw std::runtime_error("torch has no current CUDA stream");
  return static_cast<cudaStream_t>(stream);
}

}  // namespace splitnerf::glue
