// Packed samples along rays, a group of threads a ray.
#pragma once

#include "splitnerf/accumulate.h"
#include "splitnerf/march.h"
#include "splitnerf/neus.h"
#include "splitnerf/spread.h"
#include "splitnerf/varying_outputs.h"

namespace splitnerf {

// counts [n_rays]
template <class T> struct MarchCountBody {
  MarchOptions options;
  OccupancyView grid;
  const T *rays_o, *rays_d, *jitter;
  int64_t* counts;

  template <class Group> SPLITNERF_HD void operator()(const Group& group, int64_t r) const {
    const int64_t n =
        march_ray(group, load3(rays_o + 3 * r), load3(rays_d + 3 * r), jitter[r], grid, options, [](int64_t, T, T) {});
    if (group.lane() == 0) counts[r] = n;
  }
};
SPLITNERF_ON_GPU(MarchCountBody);

template <class T> struct MarchFillBody {
  MarchOptions options;
  OccupancyView grid;
  const T *rays_o, *rays_d, *jitter;
  const int64_t* offsets;
  int64_t* ray_indices;
  T *t_starts, *t_ends;

  template <class Group> SPLITNERF_HD void operator()(const Group& group, int64_t r) const {
    const int64_t first = offsets[r];
    march_ray(group, load3(rays_o + 3 * r), load3(rays_d + 3 * r), jitter[r], grid, options,
              [&](int64_t i, T t_start, T t_end) {
                ray_indices[first + i] = r;
                t_starts[first + i] = t_start;
                t_ends[first + i] = t_end;
              });
  }
};
SPLITNERF_ON_GPU(MarchFillBody);

// blocks [n_blocks^3]: whether a block of kBlockCells^3 cells contains a cell that is not empty; one group of threads
// per block.
struct OccupiedBlocksBody {
  const uint8_t* cells;
  int resolution, n_blocks;
  uint8_t* blocks;

  template <class Group> SPLITNERF_HD void operator()(const Group& group, int64_t b) const {
    const int first[3] = {static_cast<int>(b / (int64_t(n_blocks) * n_blocks)) * kBlockCells,
                          static_cast<int>(b / n_blocks % n_blocks) * kBlockCells,
                          static_cast<int>(b % n_blocks) * kBlockCells};
    bool found = false;
    for (int i = group.lane(); i < kBlockCells * kBlockCells * kBlockCells; i += Group::size) {
      const int x = first[0] + i / (kBlockCells * kBlockCells), y = first[1] + i / kBlockCells % kBlockCells,
                z = first[2] + i % kBlockCells;
      if (x < resolution && y < resolution && z < resolution)
        found = found || cells[OccupancyView::at(x, y, z, resolution)] != 0;
    }
    const bool any = group.ballot(found) != 0;
    if (group.lane() == 0) blocks[b] = any;
  }
};
SPLITNERF_ON_GPU_TYPE(OccupiedBlocksBody);

// The samples of one ray of a surface. Each call computes the interval of a sample.
template <class T> struct SurfaceIntervals {
  const SurfaceSamples<T>& in;
  int64_t first;
  Vec3<T> direction;

  SPLITNERF_HD T cosine(int64_t i) const { return dot(direction, unit_normal(load3(in.gradient + 3 * (first + i)))); }
  SPLITNERF_HD NeusInterval<T> operator()(int64_t i) const {
    return surface_interval(in.sdf[(first + i) * in.stride], cosine(i), *in.step, *in.anneal);
  }
};

// normals [n, 3], weights [n], opacity [n_rays]
template <class T> struct SurfaceWeightsBody {
  SurfaceSamples<T> in;
  T *normals, *weights, *opacity;

  template <class Group> SPLITNERF_HD void operator()(const Group& group, int64_t r) const {
    const SampleRange ray = in.rays.samples_of(r);
    for (int64_t i = ray.first + group.lane(); i < ray.first + ray.n; i += Group::size)
      store3(normals + 3 * i, unit_normal(load3(in.gradient + 3 * i)));
    const SurfaceIntervals<T> intervals{in, ray.first, load3(in.directions + 3 * r)};
    const T sum = neus_ray_weights(group, intervals, *in.s, ray.n, in.min_transmittance, weights + ray.first);
    if (group.lane() == 0) opacity[r] = sum;
    in.rays.for_each_unowned(group, r, [&](int64_t i) {
      weights[i] = T(0);
      store3(normals + 3 * i, Vec3<T>{T(0), T(0), T(0)});
    });
  }
};
SPLITNERF_ON_GPU(SurfaceWeightsBody);

// grad_sdf [n_rows, stride] and grad_gradient [n_rows, 3]; `depths` [n] is work memory.
template <class T> struct SurfaceWeightsBackwardBody {
  SurfaceSamples<T> in;
  const T *weights, *grad_normals, *grad_weights, *grad_opacity;
  T *grad_sdf, *grad_gradient, *grad_s_rays, *depths;

  SPLITNERF_HD void store(int64_t i, T by_sdf, Vec3<T> by_gradient) const {
    const int64_t row = i * in.stride;
    grad_sdf[row] = by_sdf;
    for (int64_t c = row + 1; c < row + in.stride; ++c) grad_sdf[c] = T(0);
    store3(grad_gradient + 3 * i, by_gradient);
  }
  template <class Group> SPLITNERF_HD void operator()(const Group& group, int64_t r) const {
    const SampleRange ray = in.rays.samples_of(r);
    const int64_t first = ray.first;
    const SurfaceIntervals<T> intervals{in, first, load3(in.directions + 3 * r)};
    const T grad_s = neus_ray_weights_backward(
        group, intervals, *in.s, ray.n, in.min_transmittance, weights + first, grad_weights + first, grad_opacity[r],
        depths + first, [&](int64_t i, const OpticalDepthGrad<T>& g) {
          const T grad_cosine = surface_interval_backward(g, intervals.cosine(i), *in.step, *in.anneal);
          const Vec3<T> grad_normal = load3(grad_normals + 3 * (first + i)) + intervals.direction * grad_cosine;
          store(first + i, g.both, unit_normal_backward(load3(in.gradient + 3 * (first + i)), grad_normal));
        });
    if (group.lane() == 0) grad_s_rays[r] = grad_s;
    const PackedRays rows{in.rays.n_rays, in.n_rows, in.rays.offsets};
    rows.for_each_unowned(group, r, [&](int64_t i) { store(i, T(0), Vec3<T>{T(0), T(0), T(0)}); });
  }
};
SPLITNERF_ON_GPU(SurfaceWeightsBackwardBody);

// What is added up along rays: weights [n] times values [n, n_channels]. The sums are divided by the rays' opacity, at least
// `least`; without opacities by 1.
template <class T> struct CompositeArrays {
  PackedRays rays;
  int64_t n_channels;
  const T *weights, *values, *opacity;
  T least;

  SPLITNERF_HD T divisor(int64_t r) const { return opacity ? max_of(opacity[r], least) : T(1); }
};

// sums [n_rays, n_channels], added in double.
template <class T> struct CompositeBody {
  CompositeArrays<T> in;
  T* sums;

  template <class Group> SPLITNERF_HD void operator()(const Group& group, int64_t r) const {
    const SampleRange ray = in.rays.samples_of(r);
    for (int64_t c = 0; c < in.n_channels; ++c) {
      double total = 0;
      for (int64_t i = ray.first + group.lane(); i < ray.first + ray.n; i += Group::size)
        total += double(in.weights[i]) * double(in.values[i * in.n_channels + c]);
      total = group.sum(total);
      if (group.lane() == 0) sums[r * in.n_channels + c] = T(total / double(in.divisor(r)));
    }
  }
};
SPLITNERF_ON_GPU(CompositeBody);

// x = sum w v / max(o, least), so that dx/do = -x / o above the least opacity.
template <class T> struct CompositeBackwardBody {
  CompositeArrays<T> in;
  const T* grad_sums;
  T *grad_weights, *grad_values, *grad_opacity;

  template <class Group> SPLITNERF_HD void operator()(const Group& group, int64_t r) const {
    const SampleRange ray = in.rays.samples_of(r);
    const int64_t n_channels = in.n_channels;
    const T *g = grad_sums + r * n_channels, divisor = in.divisor(r);
    double pulled = 0;
    for (int64_t i = ray.first + group.lane(); i < ray.first + ray.n; i += Group::size) {
      T grad_weight = T(0);
      for (int64_t c = 0; c < n_channels; ++c) {
        grad_weight += g[c] * in.values[i * n_channels + c];
        grad_values[i * n_channels + c] = g[c] * in.weights[i] / divisor;
      }
      grad_weights[i] = grad_weight / divisor;
      pulled += double(grad_weights[i]) * double(in.weights[i]);
    }
    if (in.opacity) {
      pulled = group.sum(pulled);
      if (group.lane() == 0) grad_opacity[r] = in.opacity[r] >= in.least ? T(-pulled / double(divisor)) : T(0);
    }
    in.rays.for_each_unowned(group, r, [&](int64_t i) {
      grad_weights[i] = T(0);
      for (int64_t c = 0; c < n_channels; ++c) grad_values[i * n_channels + c] = T(0);
    });
  }
};
SPLITNERF_ON_GPU(CompositeBackwardBody);

// What the choice of shaded samples reads. `gap` is a length, in units of *unit where there is one.
template <class T> struct SpreadArrays {
  PackedRays rays;
  const T *weights, *t, *phase;
  T gap;
  const T* unit;
  int per_ray;

  SPLITNERF_HD T gap_length() const { return unit ? gap * *unit : gap; }
  template <class Draw> SPLITNERF_HD void draw(int64_t r, const Draw& draw_sample) const {
    const SampleRange ray = rays.samples_of(r);
    spread_by_weight(weights + ray.first, t + ray.first, ray.n, gap_length(), per_ray, double(phase[r]), draw_sample);
  }
};

// Per ray: the number of its shaded samples, 1 if it has samples, and the number of its segments, the columns of `counts`, which
// are n_rays + 1 numbers apart; one call per ray.
template <class T> struct SpreadCountBody {
  SpreadArrays<T> in;
  int64_t* counts;

  SPLITNERF_HD void operator()(int64_t r) const {
    const SampleRange ray = in.rays.samples_of(r);
    const T gap = in.gap_length();
    int64_t n_drawn = 0, n_stretches = 0, column = in.rays.n_rays + 1;
    in.draw(r, [&](int64_t) { ++n_drawn; });
    for (int64_t i = ray.first; i < ray.first + ray.n; ++i)
      if (i == ray.first || in.t[i] - in.t[i - 1] > gap) ++n_stretches;
    counts[r] = n_drawn, counts[column + r] = n_drawn > 0 ? 1 : 0,
    counts[2 * column + r] = n_drawn > 0 ? n_stretches : 0;
  }
};

// Fills the entries that no ray writes: those behind the counts, and of samples from `owned` on, which get the first shaded
// sample. Unused entries have weight 0; they get indices spread over the valid range, so that their zero gradients are not all
// added to one number.
template <class T> struct SpreadUnusedBody {
  int64_t n_samples, n_owned, owned;
  SpreadSizes counted;
  Spread to;
  int64_t *first, *second;
  T* share;

  SPLITNERF_HD int64_t count() const {
    return max_of(max_of(n_samples, to.capacity.shaded), max_of(to.capacity.heaviest, to.capacity.leaders));
  }
  SPLITNERF_HD void operator()(int64_t i) const {
    if (i >= owned && i < n_samples) first[i] = second[i] = 0, share[i] = T(0);
    if (i >= counted.shaded && i < to.capacity.shaded)
      to.shaded[i] = within(i, n_owned), to.stretch[i] = within(i, to.capacity.leaders);
    if (i >= counted.heaviest && i < to.capacity.heaviest) to.heaviest[i] = within(i, to.capacity.shaded);
    if (i >= counted.leaders && i < to.capacity.leaders) to.leaders[i] = within(i, to.capacity.shaded);
  }
  SPLITNERF_HD static int64_t within(int64_t i, int64_t n) { return n > 0 ? i % n : 0; }
};

// From the running sums of these counts, the columns [n_rays + 1] of `sums`: the entries of Spread, and first, second, share [n].
// Where the capacity is exceeded only unused entries are written. One call for each of count().
template <class T> struct SpreadFillBody {
  SpreadArrays<T> in;
  const int64_t* sums;
  Spread to;
  int64_t *first, *second;
  T* share;

  SPLITNERF_HD const int64_t* column(int k) const { return sums + k * (in.rays.n_rays + 1); }
  SPLITNERF_HD int64_t count() const { return max_of(unused(false).count(), in.rays.n_rays); }
  SPLITNERF_HD SpreadUnusedBody<T> unused(bool fits) const {
    const int64_t last = in.rays.n_rays, n_owned = in.rays.n_owned();
    const SpreadSizes counted = fits ? SpreadSizes{column(0)[last], column(1)[last], column(2)[last]} : SpreadSizes{};
    return {in.rays.n_samples, n_owned, fits ? n_owned : 0, counted, to, first, second, share};
  }
  SPLITNERF_HD void operator()(int64_t i) const {
    const bool fits = to.has_room(column(0)[in.rays.n_rays], column(2)[in.rays.n_rays]);
    unused(fits)(i);
    if (fits && i < in.rays.n_rays) fill(i);
  }
  SPLITNERF_HD void fill(int64_t r) const {
    const SampleRange samples = in.rays.samples_of(r);
    const int64_t begin = samples.first, at = column(0)[r], n_drawn = column(0)[r + 1] - at, before = column(2)[r];
    if (n_drawn == 0) return;
    int64_t k = at;  // bounded: a compiler may round here in another way than where the samples were counted
    in.draw(r, [&](int64_t sample) {
      if (k < at + n_drawn) to.shaded[k++] = begin + sample;
    });
    const SpreadRay<T> ray{in.weights, in.t, begin, begin + samples.n, to.shaded, at, n_drawn};
    to.heaviest[column(1)[r]] = heaviest_drawn(ray);
    arrange_spread(ray, in.gap_length(), before, first, second, share, to.leaders + before, to.stretch);
  }
};

// The offsets [n_rays + 1] of samples where at most `capacity` of them fit, from those of all samples, and how many these are.
struct FitOffsetsBody {
  int64_t n_rays, capacity;
  const int64_t* all;
  int64_t *offsets, *n_found;

  SPLITNERF_HD void operator()(int64_t r) const {
    offsets[r] = min_of(all[r], capacity);
    if (r == n_rays) *n_found = all[r];
  }
};

// Zeros behind the samples, of which there are `*n`; one call per row of their capacity.
template <class T> struct PadSamplesBody {
  const int64_t* n;
  PackedSamples<T> to;

  SPLITNERF_HD void operator()(int64_t i) const {
    if (i >= *n) to.ray_indices[i] = 0, to.t_starts[i] = to.t_ends[i] = T(0);
  }
};

// The starts [n_rays, most] of the samples of each ray, one ray after the other; a group of threads a ray.
template <class T> struct PackSamplesBody {
  int64_t most;
  T step;
  const T* starts;
  const int64_t* offsets;
  PackedSamples<T> to;

  template <class Group> SPLITNERF_HD void operator()(const Group& group, int64_t r) const {
    const int64_t first = offsets[r];
    for (int64_t i = group.lane(); i < offsets[r + 1] - first; i += Group::size) {
      const T start = starts[r * most + i];
      to.ray_indices[first + i] = r;
      to.t_starts[first + i] = start;
      to.t_ends[first + i] = start + step;
    }
  }
};

// interpolated [n, n_channels]; one call per value. Positions outside [0, m) are clamped, see PackedRays.
template <class T> struct InterpolateBody {
  int64_t m, n_channels;
  const int64_t *first, *second;
  const T *share, *values;
  T* interpolated;

  SPLITNERF_HD void operator()(int64_t at) const {
    const int64_t i = at / n_channels, c = at % n_channels;
    const int64_t a = clamp<int64_t>(first[i], 0, m - 1), b = clamp<int64_t>(second[i], 0, m - 1);
    interpolated[at] = lerp(values[a * n_channels + c], values[b * n_channels + c], share[i]);
  }
};
SPLITNERF_ON_GPU(InterpolateBody);

// Adds to grad_values [m, n_channels].
template <class T> struct InterpolateBackwardBody {
  static constexpr bool adds_to_shared = true;
  int64_t m, n_channels;
  const int64_t *first, *second;
  const T *share, *grad_interpolated;
  T* grad_values;

  SPLITNERF_HD void operator()(int64_t at) const {
    const int64_t i = at / n_channels, c = at % n_channels;
    const int64_t a = clamp<int64_t>(first[i], 0, m - 1), b = clamp<int64_t>(second[i], 0, m - 1);
    const T g = grad_interpolated[at];
    if (g == T(0)) return;  // padding samples all point at one entry
    add_to(grad_values + a * n_channels + c, g * (T(1) - share[i]));
    add_to(grad_values + b * n_channels + c, g * share[i]);
  }
};
SPLITNERF_ON_GPU(InterpolateBackwardBody);

}  // namespace splitnerf
