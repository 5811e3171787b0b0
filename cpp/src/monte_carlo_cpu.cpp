#include "splitnerf/monte_carlo.h"

#include <algorithm>
#include <vector>

#include "splitnerf/ops_cpu.h"
#include "splitnerf/parallel.h"

namespace splitnerf::cpu {
namespace {

constexpr int64_t kGrain = 32;         // points with many directions each
constexpr int64_t kShadeGrain = 1024;  // points

template <class T> SummedPoint<T> load_point(const SummedArrays<const T>& in, int64_t i) {
  return {load3(in.normals + 3 * i),
          load3(in.view_dirs + 3 * i),
          load3(in.albedo + 3 * i),
          in.roughness[i],
          in.metallic[i],
          {load3(in.all + 3 * i), load3(in.grazing + 3 * i), load3(in.diffuse + 3 * i)}};
}

// The directions of one point, drawn for it.
template <class T> auto drawn_light(int n, const T* light_dirs, const T* pdf, const T* radiance) {
  return [=](int i) {
    return IncomingLight<T>{load3(light_dirs + 3 * i), pdf[i] > T(0) ? T(1) / (T(n) * pdf[i]) : T(0),
                            load3(radiance + 3 * i)};
  };
}

// What of a light that all points share arrives at point `p`.
template <class T> auto arriving_light(const SharedLight<T>& light, int64_t p) {
  const T* visible = light.visible + p * light.n;
  const T* sent = light.sent ? light.sent + 3 * p * light.n : nullptr;
  return [=](int i) {
    const Vec3<T> sky = load3(light.radiance + 3 * i) * visible[i];
    return IncomingLight<T>{load3(light.directions + 3 * i), light.solid_angles[i],
                            sent ? sky + load3(sent + 3 * i) : sky};
  };
}

template <class T> void store_sums(const LightSums<T>& s, T* sums) {
  store3(sums, s.all), store3(sums + 3, s.grazing), store3(sums + 6, s.diffuse);
}
template <class T> LightSums<T> load_sums(const T* sums) { return {load3(sums), load3(sums + 3), load3(sums + 6)}; }

}  // namespace

template <class T>
void sample_bsdf(int64_t n, const T* normals, const T* view_dirs, const T* roughness, int n_samples, uint32_t seed,
                 T* directions, T* pdf) {
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const Vec3<T> view = load3(view_dirs + 3 * i);
      const Vec3<T> given = load3(normals + 3 * i), normal = given * facing(given, view);
      const T ggx_alpha = sampled_alpha(roughness[i]);
      const auto counter = static_cast<uint32_t>(i);
      const Vec2<T> shift{random_unit<T>(seed, counter, 0), random_unit<T>(seed, counter, 1)};
      for (int k = 0; k < n_samples; ++k) {
        const int64_t at = i * n_samples + k;
        const Vec3<T> l = splitnerf::sample_bsdf(normal, view, ggx_alpha, k, fibonacci_lattice<T>(k, n_samples, shift));
        store3(directions + 3 * at, l);
        pdf[at] = bsdf_pdf(normal, view, l, ggx_alpha);
      }
    }
  });
}

template <class T>
void monte_carlo_light(int64_t n, int n_samples, const T* normals, const T* view_dirs, const T* roughness,
                       const T* light_dirs, const T* pdf, const T* radiance, T* sums) {
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const int64_t at = i * n_samples;
      store_sums(sum_light(load3(normals + 3 * i), load3(view_dirs + 3 * i), roughness[i], n_samples,
                           drawn_light(n_samples, light_dirs + 3 * at, pdf + at, radiance + 3 * at)),
                 sums + 9 * i);
    }
  });
}

template <class T>
void monte_carlo_light_backward(int64_t n, int n_samples, const T* normals, const T* view_dirs, const T* roughness,
                                const T* light_dirs, const T* pdf, const T* radiance, const T* grad_sums,
                                T* grad_normals, T* grad_roughness, T* grad_radiance) {
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const int64_t at = i * n_samples;
      const LightSumsGrad<T> out = sum_light_backward(
          load3(normals + 3 * i), load3(view_dirs + 3 * i), roughness[i], n_samples,
          drawn_light(n_samples, light_dirs + 3 * at, pdf + at, radiance + 3 * at), load_sums(grad_sums + 9 * i),
          [&](int k, Vec3<T> g) { store3(grad_radiance + 3 * (at + k), g); });
      store3(grad_normals + 3 * i, out.normal);
      grad_roughness[i] = out.roughness;
    }
  });
}

template <class T>
void summed_light(int64_t n, const T* normals, const T* view_dirs, const T* roughness, const SharedLight<T>& light,
                  T* sums) {
  parallel_for(n, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i)
      store_sums(
          sum_light(load3(normals + 3 * i), load3(view_dirs + 3 * i), roughness[i], light.n, arriving_light(light, i)),
          sums + 9 * i);
  });
}

template <class T>
void summed_light_backward(int64_t n, const T* normals, const T* view_dirs, const T* roughness,
                           const SharedLight<T>& light, const T* grad_sums, T* grad_normals, T* grad_roughness,
                           T* grad_light) {
  const int64_t n_chunks = clamp<int64_t>(n / kGrain, 1, kLightChunks), stride = 3 * int64_t{light.n};
  std::vector<T> partial(n_chunks * stride);  // added in order: the same bits each time
  parallel_for(n_chunks, 1, [&](int64_t first, int64_t last) {
    for (int64_t c = first; c < last; ++c) {
      T* to_light = &partial[c * stride];
      for (int64_t i = c * n / n_chunks; i < (c + 1) * n / n_chunks; ++i) {
        const T* visible = light.visible + i * light.n;
        const LightSumsGrad<T> out = sum_light_backward(
            load3(normals + 3 * i), load3(view_dirs + 3 * i), roughness[i], light.n, arriving_light(light, i),
            load_sums(grad_sums + 9 * i),
            [&](int k, Vec3<T> g) { store3(to_light + 3 * k, load3(to_light + 3 * k) + g * visible[k]); });
        store3(grad_normals + 3 * i, out.normal);
        grad_roughness[i] = out.roughness;
      }
    }
  });
  std::fill(grad_light, grad_light + stride, T(0));
  for (int64_t c = 0; c < n_chunks; ++c)
    for (int64_t k = 0; k < stride; ++k) grad_light[k] += partial[c * stride + k];
}

template <class T>
void shade_sums(const float* lut, bool compensate, int64_t n, const SummedArrays<const T>& in, T* radiance) {
  parallel_for(n, kShadeGrain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i)
      store3(radiance + 3 * i, splitnerf::shade_sums(lut, compensate, load_point(in, i)));
  });
}

template <class T>
void shade_sums_backward(const float* lut, bool compensate, int64_t n, const SummedArrays<const T>& in,
                         const T* grad_radiance, const SummedArrays<T>& grad) {
  parallel_for(n, kShadeGrain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const SummedPoint<T> g =
          splitnerf::shade_sums_backward(lut, compensate, load_point(in, i), load3(grad_radiance + 3 * i));
      store3(grad.normals + 3 * i, g.normal);
      store3(grad.view_dirs + 3 * i, g.view);
      store3(grad.albedo + 3 * i, g.albedo);
      grad.roughness[i] = g.roughness;
      grad.metallic[i] = g.metallic;
      store3(grad.all + 3 * i, g.light.all);
      store3(grad.grazing + 3 * i, g.light.grazing);
      store3(grad.diffuse + 3 * i, g.light.diffuse);
    }
  });
}

#define SPLITNERF_INSTANTIATE(T)                                                                                     \
  template void sample_bsdf<T>(int64_t, const T*, const T*, const T*, int, uint32_t, T*, T*);                        \
  template void monte_carlo_light<T>(int64_t, int, const T*, const T*, const T*, const T*, const T*, const T*, T*);  \
  template void monte_carlo_light_backward<T>(int64_t, int, const T*, const T*, const T*, const T*, const T*,        \
                                              const T*, const T*, T*, T*, T*);                                       \
  template void summed_light<T>(int64_t, const T*, const T*, const T*, const SharedLight<T>&, T*);                   \
  template void summed_light_backward<T>(int64_t, const T*, const T*, const T*, const SharedLight<T>&, const T*, T*, \
                                         T*, T*);                                                                    \
  template void shade_sums<T>(const float*, bool, int64_t, const SummedArrays<const T>&, T*);                        \
  template void shade_sums_backward<T>(const float*, bool, int64_t, const SummedArrays<const T>&, const T*,          \
                                       const SummedArrays<T>&);
SPLITNERF_INSTANTIATE(float)
SPLITNERF_INSTANTIATE(double)
#undef SPLITNERF_INSTANTIATE

}  // namespace splitnerf::cpu
