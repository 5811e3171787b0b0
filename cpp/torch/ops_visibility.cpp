// visibility_bits, vertex_grids and cached_occlusion as torch operators.
#include <tuple>

#include "device.h"

namespace splitnerf::glue {
namespace {

constexpr int64_t kMaxDirections = 1 << 16;

void check_directions(const char* op, int64_t n) {
  require(n > 0 && n % kBitsPerWord == 0 && n <= kMaxDirections, op,
          "directions must hold a multiple of 32 in [32, 65536]");
}

std::tuple<Tensor, Tensor> visibility_bits(int64_t scene, Tensor positions, Tensor normals, Tensor directions,
                                           double offset, bool with_hits) {
  const char* op = "visibility_bits";
  const Tensor x = checked(op, "positions", positions, {kAny, 3}, ScalarType::Float);
  const Tensor n = checked(op, "normals", normals, {x.size(0), 3}, ScalarType::Float);
  const Tensor d = checked(op, "directions", directions, {kAny, 3}, ScalarType::Float);
  check_directions(op, d.size(0));
  Tensor bits = empty_like_type(x, {x.size(0), 2, d.size(0) / kBitsPerWord}, ScalarType::Int);
  Tensor hits = empty_like_type(x, {x.size(0), with_hits ? d.size(0) : 0}, ScalarType::Int);
  cpu::visibility_bits(*get_scene(scene), x.size(0), in<float>(x), in<float>(n), d.size(0), in<float>(d),
                       static_cast<float>(offset), out<uint32_t>(bits), with_hits ? out<int32_t>(hits) : nullptr);
  return {bits, hits};
}

std::tuple<Tensor, Tensor> vertex_grids(Tensor vertices, double radius, int64_t n_levels) {
  const char* op = "vertex_grids";
  const Kind type = real_kind(op, "vertices", vertices);
  const Tensor v = checked(op, "vertices", vertices, {kAny, 3}, type);
  require(radius > 0 && n_levels > 0 && n_levels <= 16, op, "radius must be positive and n_levels in [1, 16]");
  require(v.size(0) < int64_t(1) << 30, op, "at most 2^30 vertices");
  int64_t n_buckets = 1;
  while (n_buckets < v.size(0)) n_buckets *= 2;
  Tensor starts = empty_like_type(v, {n_levels, n_buckets + 1}, ScalarType::Int);
  Tensor order = empty_like_type(v, {n_levels, v.size(0)}, ScalarType::Int);
  dispatch_real(type, [&](auto zero) {
    using T = decltype(zero);
    cpu::build_vertex_grids(v.size(0), in<T>(v), T(radius), static_cast<int>(n_levels), n_buckets, out<int32_t>(starts),
                            out<int32_t>(order));
  });
  return {starts, order};
}

// The cache as both readers take it.
struct Cache {
  Kind type;
  Tensor vertices, normals, starts, order, bits, hits, radiance, directions;
  double radius;

  Cache(const char* op, Kind type, const Tensor& v, const Tensor& vn, const Tensor& s, const Tensor& o, double r,
        const Tensor& b, const Tensor& h, const Tensor& c, const Tensor& w)
      : type(type), vertices(checked(op, "vertices", v, {kAny, 3}, type)),
        normals(checked(op, "vertex_normals", vn, {vertices.size(0), 3}, type)),
        starts(checked(op, "starts", s, {kAny, kAny}, type.with(ScalarType::Int))),
        order(checked(op, "order", o, {starts.size(0), vertices.size(0)}, type.with(ScalarType::Int))),
        bits(checked(op, "bits", b, {vertices.size(0), 2, kAny}, type.with(ScalarType::Int))),
        hits(checked(op, "hits", h, {vertices.size(0), kAny}, type.with(ScalarType::Int))),
        radiance(checked(op, "radiance", c, {kAny, 3}, type)),
        directions(checked(op, "directions", w, {kAny, 3}, type)), radius(r) {
    check_directions(op, n_directions());
    checked(op, "bits", bits, {vertices.size(0), 2, n_directions() / kBitsPerWord}, type.with(ScalarType::Int));
    if (indirect()) checked(op, "hits", hits, {vertices.size(0), n_directions()}, type.with(ScalarType::Int));
    require(n_buckets() > 0 && (n_buckets() & (n_buckets() - 1)) == 0 && radius > 0, op,
            "starts must be [levels, 2^k + 1] and radius positive");
    if (!type.on_cpu()) return;  // to look at the numbers would mean waiting for the GPU
    require(vertices.size(0) > 0, op, "vertices must hold at least one");
    check_indices(op, "starts", starts, vertices.size(0) + 1);
    check_indices(op, "order", order, vertices.size(0));
  }

  bool indirect() const { return hits.size(1) > 0; }
  int64_t n_directions() const { return directions.size(0); }
  int64_t n_buckets() const { return starts.size(1) - 1; }

  template <class T> VisibilityCache<T> get(const T* light) const {
    return {{in<T>(vertices), in<T>(normals), in<int32_t>(starts), in<int32_t>(order), vertices.size(0), n_buckets(),
             static_cast<int>(starts.size(0)), T(radius)},
            in<uint32_t>(bits),
            indirect() ? in<int32_t>(hits) : nullptr,
            in<T>(radiance),
            radiance.size(0),
            n_directions(),
            in<T>(directions),
            light};
  }
};

std::tuple<Tensor, Tensor, Tensor, Tensor> cached_occlusion(Tensor positions, Tensor normals, Tensor lobe_dirs,
                                                            Tensor roughness, Tensor vertices, Tensor vertex_normals,
                                                            Tensor starts, Tensor order, double radius, Tensor bits,
                                                            Tensor hits, Tensor radiance, Tensor directions,
                                                            Tensor light) {
  const char* op = "cached_occlusion";
  const Kind type = real_kind(op, "positions", positions);
  const Tensor x = checked(op, "positions", positions, {kAny, 3}, type);
  const Tensor n = checked(op, "normals", normals, {x.size(0), 3}, type);
  const Tensor d = checked(op, "lobe_dirs", lobe_dirs, {x.size(0), 3}, type);
  const Tensor rho = checked(op, "roughness", roughness, {x.size(0), 1}, type);
  const Cache cache(op, type, vertices, vertex_normals, starts, order, radius, bits, hits, radiance, directions);
  const Tensor l = checked(op, "light", light, {cache.n_directions(), 3}, type);
  Tensor o_d = empty_like_type(x, {x.size(0), 3}, type), o_s = empty_like_type(x, {x.size(0), 3}, type);
  Tensor i_d = empty_like_type(x, {cache.indirect() ? x.size(0) : 0, 3}, type);
  Tensor i_s = empty_like_type(x, {cache.indirect() ? x.size(0) : 0, 3}, type);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, x.size(0),
               CachedOcclusionBody<T>{cache.get(in<T>(l)), in<T>(x), in<T>(n), in<T>(d), in<T>(rho), out<T>(o_d),
                                      out<T>(o_s), out<T>(i_d), out<T>(i_s)});
  });
  return {o_d, o_s, i_d, i_s};
}

std::tuple<Tensor, Tensor> cached_visibility(Tensor positions, Tensor normals, Tensor vertices, Tensor vertex_normals,
                                             Tensor starts, Tensor order, double radius, Tensor bits, Tensor hits,
                                             Tensor radiance, Tensor directions) {
  const char* op = "cached_visibility";
  const Kind type = real_kind(op, "positions", positions);
  const Tensor x = checked(op, "positions", positions, {kAny, 3}, type);
  const Tensor n = checked(op, "normals", normals, {x.size(0), 3}, type);
  const Cache cache(op, type, vertices, vertex_normals, starts, order, radius, bits, hits, radiance, directions);
  Tensor visible = empty_like_type(x, {x.size(0), cache.n_directions()}, type);
  Tensor arriving = empty_like_type(x, {cache.indirect() ? x.size(0) : 0, cache.n_directions(), 3}, type);
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    device.run(op, x.size(0),
               CachedVisibilityBody<T>{cache.get<T>(nullptr), in<T>(x), in<T>(n), out<T>(visible), out<T>(arriving)});
  });
  return {visible, arriving};
}

}  // namespace

SPLITNERF_OPERATORS(op) {
  op(SPLITNERF_OP(cached_occlusion),
     "positions normals lobe_dirs roughness vertices vertex_normals starts order radius bits hits radiance directions "
     "light");
  op(SPLITNERF_OP(cached_visibility),
     "positions normals vertices vertex_normals starts order radius bits hits radiance directions");
}

// Rays are traced on the CPU.
SPLITNERF_CPU_OPERATORS(op) {
  op(SPLITNERF_OP(visibility_bits), "scene positions normals directions offset with_hits");
  op(SPLITNERF_OP(vertex_grids), "vertices radius n_levels");
}

}  // namespace splitnerf::glue
