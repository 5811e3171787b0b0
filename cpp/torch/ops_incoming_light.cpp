// incoming_light as a torch operator: on the CPU, where meshes are traced.
#include "splitnerf/incoming_light.h"

#include <tuple>

#include "device.h"

namespace splitnerf::glue {
namespace {

Tensor checked_map(const char* op, const char* name, const Tensor& map, int64_t channels) {
  const Tensor texels = checked(op, name, map, {kAny, kAny, channels}, ScalarType::Float);
  require(texels.size(0) > 0 && texels.size(1) > 0, op, std::string(name) + " must not be empty");
  return texels;
}

// Refers to the map, which must live as long.
Texture texture(const Tensor& map) {
  return {in<float>(map), static_cast<int>(map.size(0)), static_cast<int>(map.size(1))};
}

std::tuple<Tensor, Tensor, Tensor, Tensor> incoming_light(int64_t scene, Tensor positions, Tensor geometric_normals,
                                                          Tensor normals, Tensor view_dirs, Tensor albedo,
                                                          Tensor roughness, Tensor metallic, Tensor vertex_normals,
                                                          Tensor tangents, Tensor uv, Tensor albedo_map,
                                                          Tensor roughness_metallic_map, Tensor normal_map,
                                                          Tensor environment, int64_t n_directions, int64_t max_bounces,
                                                          double clamp_indirect, int64_t seed) {
  const char* op = "incoming_light";
  const std::shared_ptr<const Scene> mesh = get_scene(scene);
  const auto points = [&](const char* name, const Tensor& t, int64_t channels) {
    return checked(op, name, t, {positions.size(0), channels}, ScalarType::Float);
  };
  const auto vertices = [&](const char* name, const Tensor& t, int64_t channels) {
    return checked(op, name, t, {mesh->n_vertices(), channels}, ScalarType::Float);
  };
  const Tensor x = checked(op, "positions", positions, {kAny, 3}, ScalarType::Float);
  const Tensor g = points("geometric_normals", geometric_normals, 3), n = points("normals", normals, 3);
  const Tensor v = points("view_dirs", view_dirs, 3), a = points("albedo", albedo, 3);
  const Tensor rho = points("roughness", roughness, 1), m = points("metallic", metallic, 1);
  const Tensor vn = vertices("vertex_normals", vertex_normals, 3), vt = vertices("tangents", tangents, 4);
  const Tensor st = vertices("uv", uv, 2), sky = checked_map(op, "environment", environment, 3);
  const Tensor albedo_texels = checked_map(op, "albedo_map", albedo_map, 3);
  const Tensor other_texels = checked_map(op, "roughness_metallic_map", roughness_metallic_map, 2);
  const Tensor normal_texels = checked_map(op, "normal_map", normal_map, 3);
  require(n_directions > 1 && n_directions <= 1 << 16, op, "n_directions must be in [2, 65536]");
  require(max_bounces >= 0 && max_bounces <= 64, op, "max_bounces must be in [0, 64]");
  require(clamp_indirect >= 0, op, "clamp_indirect must not be negative");

  SurfaceMaterial material;
  material.albedo_texture = texture(albedo_texels);
  material.roughness_metallic_texture = texture(other_texels);
  material.normal_texture = texture(normal_texels);
  check_material(op, material);
  const std::vector<float> ones(mesh->n_vertices() * 3, 1.f);
  const std::vector<int32_t> ids(mesh->n_triangles(), 0);
  Surface surface{ones.data(), ones.data(), ones.data(), in<float>(vn)};
  surface.materials = &material;
  surface.n_materials = 1;
  surface.material_ids = ids.data();
  surface.uv = in<float>(st);
  surface.tangents = in<float>(vt);

  Tensor directions = empty_like_type(x, {x.size(0), n_directions, 3}, ScalarType::Float);
  Tensor solid_angles = empty_like_type(x, {x.size(0), n_directions}, ScalarType::Float);
  Tensor visible = empty_like_type(x, {x.size(0), n_directions}, ScalarType::Float);
  Tensor sent = empty_like_type(x, {x.size(0), n_directions, 3}, ScalarType::Float);
  splitnerf::incoming_light(
      *mesh, surface, {in<float>(sky), static_cast<int>(sky.size(0)), static_cast<int>(sky.size(1))},
      {x.size(0), in<float>(x), in<float>(g), in<float>(n), in<float>(v), in<float>(a), in<float>(rho), in<float>(m)},
      {static_cast<int>(n_directions), static_cast<int>(max_bounces), static_cast<uint32_t>(seed),
       static_cast<float>(clamp_indirect)},
      {out<float>(directions), out<float>(solid_angles), out<float>(visible), out<float>(sent)});
  return {directions, solid_angles, visible, sent};
}

}  // namespace

SPLITNERF_CPU_OPERATORS(op) {
  op(SPLITNERF_OP(incoming_light),
     "scene positions geometric_normals normals view_dirs albedo roughness metallic vertex_normals tangents uv "
     "albedo_map roughness_metallic_map normal_map environment n_directions max_bounces clamp_indirect seed");
}

}  // namespace splitnerf::glue
