#include "splitnerf/occlusion.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "splitnerf/kernels.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"
#include "splitnerf/sampling.h"

namespace splitnerf::cpu {
namespace {

constexpr int64_t kGrain = 32;  // points

// An n-point lattice on the square, 16 points that lie together in a row: their rays make a coherent packet, also under a
// shift but where that wraps around.
template <class T> struct OrderedLattice {
  int64_t n;
  std::vector<T> u, v;  // [padded_fan(n)]

  explicit OrderedLattice(int count) : n(count), u(padded_fan(count)), v(padded_fan(count)) {
    const int bands = max_of(1, static_cast<int>(std::sqrt(n / 32.0) + 0.5)), sectors = max_of(1, count / (16 * bands));
    const auto cell = [&](int i) {
      const Vec2<double> at = fibonacci_lattice<double>(i, count);
      const int band = static_cast<int>(at.x * bands), sector = static_cast<int>(at.y * sectors);
      return band * sectors + (band % 2 ? sectors - 1 - sector : sector);
    };
    std::vector<int> order(count);
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return cell(a) < cell(b); });
    for (int i = 0; i < count; ++i) {
      const Vec2<T> at = fibonacci_lattice<T>(order[i], count);
      u[i] = at.x, v[i] = at.y;
    }
  }
};

// Traces one fan after the other; holds what a fan needs meanwhile.
template <class T> class FanTracer {
 public:
  FanTracer(const Scene& scene, int height, int width, const T* environment, int64_t most_rays)
      : scene_(scene), height_(height), width_(width), environment_(environment), x_(padded_fan(most_rays)),
        y_(x_.size()), z_(x_.size()), active_(x_.size()), visible_(x_.size()) {}

  Vec3<T> factor(Vec3<T> origin, const RayFan<T>& fan) {
    const int64_t n = padded_fan(fan.n);
    kernels<T>().fan_directions(fan, x_.data(), y_.data(), z_.data(), active_.data());
    const Vec3<float> start{static_cast<float>(origin.x), static_cast<float>(origin.y), static_cast<float>(origin.z)};
    scene_.trace_fan(start, x_.data(), y_.data(), z_.data(), n, active_.data(), visible_.data());
    T sums[6];
    kernels<T>().fan_light(environment_, height_, width_, n, x_.data(), y_.data(), z_.data(), active_.data(),
                           visible_.data(), sums);
    return occlusion_factor(load3(sums), load3(sums + 3));
  }

 private:
  const Scene& scene_;
  int height_, width_;
  const T* environment_;
  std::vector<float> x_, y_, z_;
  std::vector<int32_t> active_, visible_;
};

}  // namespace

template <class T>
void occlusion_factors(const Scene& scene, const OcclusionOptions& options, int64_t n, const T* positions,
                       const T* normals, const T* lobe_dirs, const T* roughness, int height, int width,
                       const T* environment, T* occlusion_d, T* occlusion_s) {
  const OrderedLattice<T> diffuse(options.n_diffuse_rays), specular(options.n_specular_rays);
  const int64_t most = max_of(diffuse.n, specular.n);
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    FanTracer<T> tracer(scene, height, width, environment, most);
    for (int64_t i = begin; i < end; ++i) {
      const auto counter = static_cast<uint32_t>(i);
      const auto shift = [&](uint32_t dimension) {
        return Vec2<T>{random_unit<T>(options.seed, counter, dimension),
                       random_unit<T>(options.seed, counter, dimension + 1)};
      };
      const Vec3<T> normal = load3(normals + 3 * i), axis = load3(lobe_dirs + 3 * i);
      const Vec3<T> origin = load3(positions + 3 * i) + normal * T(options.offset);
      const auto fan = [&](const OrderedLattice<T>& lattice, uint32_t dimension, Vec3<T> about, T edge) {
        return RayFan<T>{
            lattice.u.data(), lattice.v.data(), lattice.n, shift(dimension), Frame<T>(about), edge, normal};
      };
      const T edge = ggx_lobe_edge(ggx_alpha_from_roughness(roughness[i]));
      store3(occlusion_d + 3 * i, tracer.factor(origin, fan(diffuse, 0, normal, T(0))));
      store3(occlusion_s + 3 * i, tracer.factor(origin, fan(specular, 2, axis, edge)));
    }
  });
}

#define SPLITNERF_INSTANTIATE(T)                                                                                   \
  template void occlusion_factors<T>(const Scene&, const OcclusionOptions&, int64_t, const T*, const T*, const T*, \
                                     const T*, int, int, const T*, T*, T*);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cpu
