// draw_rays and read_pixels as torch operators.
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

}  // namespace

SPLITNERF_OPERATORS(op) {
  op(SPLITNERF_OP(draw_rays),
     "random n_near near_last near_shift near_count known_last known_shift known_count matrices origins height width");
  op(SPLITNERF_OP(read_pixels), "codes index view exposures backgrounds edge_starts edge_ends edge_shift edge_behind");
}

}  // namespace splitnerf::glue
