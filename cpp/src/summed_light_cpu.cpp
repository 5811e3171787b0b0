// The adjoint of the summed light: as many copies of the light's gradient as chunks of points, added in order.
#include <vector>

#include "splitnerf/ops_cpu.h"

namespace splitnerf::cpu {

template <class T> void shared_light_backward(int64_t n, const SharedLightBackwardBody<T>& body) {
  constexpr int64_t kGrain = 32;
  const int64_t n_chunks = clamp<int64_t>(n / kGrain, 1, kLightChunks), stride = 3 * int64_t{body.n};
  std::vector<T> partial(n_chunks * stride);
  parallel_for(n_chunks, 1, [&](int64_t first, int64_t last) {
    for (int64_t c = first; c < last; ++c) {
      SharedLightBackwardBody<T> chunk = body;
      chunk.receive.grad_light = &partial[c * stride];
      for (int64_t i = c * n / n_chunks; i < (c + 1) * n / n_chunks; ++i) chunk(OneThread{}, i);
    }
  });
  for (int64_t k = 0; k < stride; ++k) body.receive.grad_light[k] = partial[k];
  for (int64_t c = 1; c < n_chunks; ++c)
    for (int64_t k = 0; k < stride; ++k) body.receive.grad_light[k] += partial[c * stride + k];
}
template void shared_light_backward<float>(int64_t, const SharedLightBackwardBody<float>&);
template void shared_light_backward<double>(int64_t, const SharedLightBackwardBody<double>&);

}  // namespace splitnerf::cpu
