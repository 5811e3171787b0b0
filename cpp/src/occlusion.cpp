#include "splitnerf/occlusion.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "splitnerf/environment.h"
#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"
#include "splitnerf/sampling.h"

namespace splitnerf::cpu {
namespace {

constexpr int64_t kGrain = 32;  // points

// Indices of an n-point lattice on the square, 16 that lie together in a row: their rays make a coherent packet, also under
// a shift but where that wraps around.
void order_by_place(int n, std::vector<int>& order) {
  const int bands = max_of(1, static_cast<int>(std::sqrt(n / 32.0) + 0.5)), sectors = max_of(1, n / (16 * bands));
  const auto cell = [&](int i) {
    const Vec2<double> u = fibonacci_lattice<double>(i, n);
    const int band = static_cast<int>(u.x * bands), sector = static_cast<int>(u.y * sectors);
    return band * sectors + (band % 2 ? sectors - 1 - sector : sector);
  };
  order.resize(n);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return cell(a) < cell(b); });
}

// The rays of one point, traced together so that Embree's packets are coherent.
template <class T> class RayFan {
 public:
  RayFan(const Scene& scene, int height, int width, const T* environment)
      : scene_(scene), height_(height), width_(width), environment_(environment) {}

  // Factor over the directions w = frame.to_world(sample(u1, u2)) above the horizon of `normal`, (u1, u2) a lattice of as
  // many points as `order` has; the rays start at origin + ahead w.
  template <class Sampler>
  Vec3<T> factor(Vec3<T> origin, T ahead, Vec3<T> normal, const Frame<T>& frame, Vec2<T> shift,
                 const std::vector<int>& order, Sampler sample) {
    const int n_rays = static_cast<int>(order.size());
    origins_.resize(3 * n_rays), directions_.resize(3 * n_rays), active_.resize(n_rays), visible_.resize(n_rays);
    for (int i = 0; i < n_rays; ++i) {
      const Vec2<T> u = fibonacci_lattice<T>(order[i], n_rays, shift);
      const Vec3<T> w = frame.to_world(sample(u.x, u.y));
      active_[i] = dot(w, normal) > T(0);
      for (int c = 0; c < 3; ++c) {
        origins_[3 * i + c] = static_cast<float>(origin[c] + ahead * w[c]);
        directions_[3 * i + c] = static_cast<float>(w[c]);
      }
    }
    scene_.trace_visibility(origins_.data(), directions_.data(), n_rays, INFINITY, active_.data(), visible_.data());
    OcclusionSum<T> total;
    for (int i = 0; i < n_rays; ++i) {
      if (!active_[i]) continue;
      const Vec3<float> w = load3(&directions_[3 * i]);
      total.add(lookup_environment(environment_, height_, width_, Vec3<T>{T(w.x), T(w.y), T(w.z)}), visible_[i]);
    }
    return total.factor();
  }

 private:
  const Scene& scene_;
  int height_, width_;
  const T* environment_;
  std::vector<float> origins_, directions_;
  std::vector<uint8_t> active_, visible_;
};

}  // namespace

template <class T>
void occlusion_factors(const Scene& scene, const OcclusionOptions& options, int64_t n, const T* positions,
                       const T* normals, const T* lobe_dirs, const T* roughness, int height, int width,
                       const T* environment, T* occlusion_d, T* occlusion_s) {
  std::vector<int> diffuse_order, specular_order;
  order_by_place(options.n_diffuse_rays, diffuse_order);
  order_by_place(options.n_specular_rays, specular_order);
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    RayFan<T> fan(scene, height, width, environment);
    for (int64_t i = begin; i < end; ++i) {
      const auto counter = static_cast<uint32_t>(i);
      const auto shift = [&](uint32_t dimension) {
        return Vec2<T>{random_unit<T>(options.seed, counter, dimension),
                       random_unit<T>(options.seed, counter, dimension + 1)};
      };
      const Vec3<T> normal = load3(normals + 3 * i), axis = load3(lobe_dirs + 3 * i);
      const T ahead = options.along_ray ? T(options.offset) : T(0), up = T(options.offset) - ahead;
      const Vec3<T> origin = load3(positions + 3 * i) + normal * up;
      const T ggx_alpha = ggx_alpha_from_roughness(roughness[i]);
      store3(occlusion_d + 3 * i, fan.factor(origin, ahead, normal, Frame<T>(normal), shift(0), diffuse_order,
                                             [](T u1, T u2) { return sample_cosine_hemisphere(u1, u2); }));
      store3(occlusion_s + 3 * i,
             fan.factor(origin, ahead, normal, Frame<T>(axis), shift(2), specular_order,
                        [&](T u1, T u2) { return splitnerf::sample_ggx_lobe(u1, u2, ggx_alpha); }));
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
