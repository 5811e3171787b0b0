// What the tests of kernels share: a stream whose work memory holds NaN until it is written.
#pragma once

#include <cstdlib>
#include <cstring>
#include <limits>
#include <memory>
#include <vector>

#include "splitnerf/run_cuda.h"

namespace splitnerf {

// Work memory lasts as long as this does; each piece is on its own, so that AddressSanitizer sees a step beyond it.
class Gpu {
 public:
  cuda::Queue queue() {
    return {nullptr, [](void* self, int64_t bytes) { return static_cast<Gpu*>(self)->allocate(bytes); }, this};
  }

 private:
  struct Free {
    void operator()(void* memory) const { std::free(memory); }
  };
  void* allocate(int64_t bytes) {
    pieces_.emplace_back(std::malloc(size_t(bytes)));
    std::memset(pieces_.back().get(), 0xff, size_t(bytes));
    return pieces_.back().get();
  }
  std::vector<std::unique_ptr<void, Free>> pieces_;
};

// Runs a body for no item, then for n.
template <class Body> void on_gpu(int64_t n, const Body& body) {
  Gpu gpu;
  cuda::run(gpu.queue(), "on_gpu", 0, body);
  cuda::run(gpu.queue(), "on_gpu", n, body);
}

// Outputs, which nobody has written yet.
template <class T> std::vector<T> unwritten(int64_t n) {
  return std::vector<T>(size_t(n),
                        std::numeric_limits<T>::has_quiet_NaN ? std::numeric_limits<T>::quiet_NaN() : T(-77));
}

}  // namespace splitnerf
