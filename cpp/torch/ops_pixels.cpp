// draw_rays, read_pixels, probe_points and place_samples as torch operators.
#include <tuple>

#include "device.h"
#include "splitnerf/bodies/pixels.h"

namespace splitnerf::glue {
namespace {

// The list as tensors of its runs; `count` pixels.
PixelList pixel_list(const char* op, const char* name, const Tensor& last, const Tensor& shift, int64_t count) {
  require(count >= 0 && (last.size(0) == 0 || count > 0), op, std::string(name) + " has runs without pixels");
  return {in<int64_t>(last), in<int64_t>(shift), last.size(0), count};
}

std::tuple<Tensor, Tensor, Tensor, Tensor> draw_rays(Tensor random, int64_t n_near, Tensor near_last, Tensor near_shift,
                                                     int64_t near_count, Tensor known_last, Tensor known_shift,
                                                     int64_t known_count, Tensor matrices, Tensor origins,
                                                     int64_t height, int64_t width) {
  const char* op = "draw_rays";
  const Kind type = real_kind(op, "random", random), whole = type.with(ScalarType::Long);
  const Tensor u = checked(op, "random", random, {kAny}, type),
               m = checked(op, "matrices", matrices, {kAny, 3, 3}, type);
  const Tensor o = checked(op, "origins", origins, {m.size(0), 3}, type);
  const Tensor near_ends = checked(op, "near_last", near_last, {kAny}, whole),
               near_shifts = checked(op, "near_shift", near_shift, {near_ends.size(0)}, whole);
  const Tensor known_ends = checked(op, "known_last", known_last, {kAny}, whole),
               known_shifts = checked(op, "known_shift", known_shift, {known_ends.size(0)}, whole);
  const int64_t n = u.size(0), n_views = m.size(0);
  const PixelList near = pixel_list(op, "near", near_ends, near_shifts, near_count),
                  known = pixel_list(op, "known", known_ends, known_shifts, known_count);
  require(height > 0 && width > 0, op, "height and width must be positive");
  require(n_near >= 0 && n_near <= n, op, "n_near must be from 0 to the number of rays");
  require(n_near == 0 || near_count > 0, op, "near has no pixels");
  require(n_near == n || known_count > 0, op, "known has no pixels");
  require(n == 0 || n_views > 0, op, "there are no views");
  Tensor rays_o = empty_like_type(u, {n, 3}, type), rays_d = empty_like_type(u, {n, 3}, type),
         view = empty_like_type(u, {n}, whole), index = empty_like_type(u, {n}, whole);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, n,
               DrawRaysBody<T>{n, n_near, near, known, n_views, height, width, in<T>(u), in<T>(m), in<T>(o),
                               out<T>(rays_o), out<T>(rays_d), out<int64_t>(view), out<int64_t>(index)});
  });
  return {rays_o, rays_d, view, index};
}

// Pixels of the photos' codes, as bytes, words or floats.
std::tuple<Tensor, Tensor, Tensor, Tensor> read_pixels(Tensor codes, Tensor index, Tensor view, Tensor exposures,
                                                       Tensor backgrounds, Tensor edge_starts, Tensor edge_ends,
                                                       Tensor edge_shift, Tensor edge_behind) {
  const char* op = "read_pixels";
  const Kind type = real_kind(op, "exposures", exposures), number = type.with(ScalarType::Long);
  const ScalarType code = codes.scalar_type();
  require(code == ScalarType::Byte || code == ScalarType::Short || code == ScalarType::Float, op,
          "codes must be uint8, int16 or float32, got " + describe(code));
  const Tensor c = checked(op, "codes", codes, {kAny, 4}, type.with(code)),
               i = checked(op, "index", index, {kAny}, number), v = checked(op, "view", view, {i.size(0)}, number),
               factors = checked(op, "exposures", exposures, {kAny, 3}, type),
               random = checked(op, "backgrounds", backgrounds, {i.size(0), 3}, type);
  const Tensor starts = checked(op, "edge_starts", edge_starts, {kAny}, number),
               ends = checked(op, "edge_ends", edge_ends, {starts.size(0)}, number),
               shift = checked(op, "edge_shift", edge_shift, {starts.size(0)}, number),
               behind = checked(op, "edge_behind", edge_behind, {kAny, 3}, type.with(ScalarType::Byte));
  const int64_t n = i.size(0);
  require(n == 0 || (c.size(0) > 0 && factors.size(0) > 0), op, "there are no photos");
  require(starts.size(0) == 0 || behind.size(0) > 0, op, "edge_behind has no colours");
  if (type.on_cpu()) {
    require(all_below<int64_t>(i, c.size(0)), op, "index must hold numbers of pixels");
    require(all_below<int64_t>(v, factors.size(0)), op, "view must hold numbers of photos");
  }
  const EdgeRuns edges{in<int64_t>(starts), in<int64_t>(ends), in<int64_t>(shift),
                       in<uint8_t>(behind), starts.size(0),    behind.size(0)};
  Tensor target = empty_like_type(i, {n, 4}, type), exposure = empty_like_type(i, {n, 3}, type),
         background = empty_like_type(i, {n, 3}, type), whole = empty_like_type(i, {n}, ScalarType::Bool);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    const auto read = [&](auto sample) {
      using Code = decltype(sample);
      device.run(op, n,
                 ReadPixelsBody<T, Code>{in<Code>(c), c.size(0), factors.size(0), edges, in<int64_t>(i), in<int64_t>(v),
                                         in<T>(factors), in<T>(random), out<T>(target), out<T>(exposure),
                                         out<T>(background), out<bool>(whole)});
    };
    if (code == ScalarType::Byte) return read(uint8_t{});
    if (code == ScalarType::Short) return read(int16_t{});
    read(float{});
  });
  return {target, exposure, background, whole};
}

std::tuple<Tensor, Tensor> probe_points(Tensor random, int64_t n_anywhere, double box, double deviation) {
  const char* op = "probe_points";
  const Kind type = real_kind(op, "random", random);
  const Tensor u = checked(op, "random", random, {kAny}, type);
  const int64_t n_shifts = (u.size(0) - 3 * n_anywhere) / 4;
  require(n_anywhere >= 0 && n_shifts >= 0 && 3 * n_anywhere + 4 * n_shifts == u.size(0), op,
          "random must hold three numbers for each point and four for each shift");
  Tensor anywhere = empty_like_type(u, {n_anywhere, 3}, type), shifts = empty_like_type(u, {n_shifts, 3}, type);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, n_anywhere + n_shifts,
               ProbesBody<T>{n_anywhere, n_shifts, T(box), T(deviation), in<T>(u), out<T>(anywhere), out<T>(shifts)});
  });
  return {anywhere, shifts};
}

std::tuple<Tensor, Tensor, Tensor> place_samples(Tensor rays_o, Tensor rays_d, Tensor ray_indices, Tensor t_starts,
                                                 Tensor t_ends, Tensor offsets, Tensor anywhere, Tensor chosen,
                                                 Tensor shifts, int64_t room) {
  const char* op = "place_samples";
  const Kind type = real_kind(op, "rays_o", rays_o), whole = type.with(ScalarType::Long);
  const Tensor o = checked(op, "rays_o", rays_o, {kAny, 3}, type),
               d = checked(op, "rays_d", rays_d, {o.size(0), 3}, type);
  const Tensor r = checked(op, "ray_indices", ray_indices, {kAny}, whole);
  const int64_t n = r.size(0), n_room = std::max(n, room);
  const Tensor begin = checked(op, "t_starts", t_starts, {n}, type), end = checked(op, "t_ends", t_ends, {n}, type);
  const Tensor ends_of_rays = checked(op, "offsets", offsets, {o.size(0) + 1}, whole);
  const Tensor points = checked(op, "anywhere", anywhere, {kAny, 3}, type),
               which = checked(op, "chosen", chosen, {kAny}, type);
  const Tensor apart = checked(op, "shifts", shifts, {which.size(0), 3}, type);
  const int64_t n_anywhere = points.size(0), n_beside = n > 0 ? which.size(0) : 0;
  if (type.on_cpu()) require(all_below<int64_t>(r, o.size(0)), op, "ray_indices must hold numbers of rays");
  Tensor positions = empty_like_type(o, {n_room + n_anywhere + n_beside, 3}, type),
         directions = empty_like_type(o, {n_room, 3}, type), beside = empty_like_type(o, {n_beside}, whole);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(
        op, positions.size(0),
        PlaceSamplesBody<T>{o.size(0), n, n_room, n_anywhere, in<T>(o), in<T>(d), in<int64_t>(r),
                            in<int64_t>(ends_of_rays) + o.size(0), in<T>(begin), in<T>(end), in<T>(points),
                            in<T>(which), in<T>(apart), out<T>(positions), out<T>(directions), out<int64_t>(beside)});
  });
  return {positions, directions, beside};
}

}  // namespace

STABLE_TORCH_LIBRARY_FRAGMENT(splitnerf, m) {
  m.def(
      "draw_rays(Tensor random, int n_near, Tensor near_last, Tensor near_shift, int near_count, Tensor known_last, "
      "Tensor known_shift, int known_count, Tensor matrices, Tensor origins, int height, int width) -> (Tensor, "
      "Tensor, "
      "Tensor, Tensor)");
  m.def(
      "read_pixels(Tensor codes, Tensor index, Tensor view, Tensor exposures, Tensor backgrounds, Tensor edge_starts, "
      "Tensor edge_ends, Tensor edge_shift, Tensor edge_behind) -> (Tensor, Tensor, Tensor, Tensor)");
  m.def("probe_points(Tensor random, int n_anywhere, float box, float deviation) -> (Tensor, Tensor)");
  m.def(
      "place_samples(Tensor rays_o, Tensor rays_d, Tensor ray_indices, Tensor t_starts, Tensor t_ends, Tensor "
      "offsets, Tensor anywhere, Tensor chosen, Tensor shifts, int room) -> (Tensor, Tensor, Tensor)");
}

SPLITNERF_IMPLEMENT(m) {
  m.impl("draw_rays", TORCH_BOX(&draw_rays));
  m.impl("read_pixels", TORCH_BOX(&read_pixels));
  m.impl("probe_points", TORCH_BOX(&probe_points));
  m.impl("place_samples", TORCH_BOX(&place_samples));
}

}  // namespace splitnerf::glue
