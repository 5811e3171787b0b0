// Embree scenes and the path tracer on NumPy arrays: check, allocate, call without the GIL.
#include "bindings.h"

#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "splitnerf/path_tracer.h"
#include "splitnerf/scene.h"

namespace py = pybind11;

namespace {

using splitnerf::Hit;
using splitnerf::Scene;

template <class T> using Array = py::array_t<T, py::array::c_style>;

constexpr py::ssize_t kAny = -1;

std::string shape_text(const std::vector<py::ssize_t>& shape, const char* any) {
  std::string text = "[";
  for (size_t i = 0; i < shape.size(); ++i) {
    text += (i ? ", " : "") + (shape[i] == kAny ? std::string(any) : std::to_string(shape[i]));
  }
  return text + "]";
}

// `values` as a contiguous array of exactly this dtype and shape (kAny matches every length), or a
// ValueError that names the function, the argument, what was expected and what came.
template <class T>
Array<T> checked(const char* function, const char* argument, const py::object& values,
                 const std::vector<py::ssize_t>& shape) {
  const std::string expected = std::string(function) + ": " + argument + " must be " + shape_text(shape, "n") + " " +
                               py::cast<std::string>(py::str(py::dtype::of<T>())) + ", got ";
  if (!py::isinstance<py::array>(values)) {
    throw py::value_error(expected + py::cast<std::string>(py::type::of(values).attr("__name__")));
  }
  const auto array = py::reinterpret_borrow<py::array>(values);
  const std::vector<py::ssize_t> got(array.shape(), array.shape() + array.ndim());
  bool good = array.dtype().equal(py::dtype::of<T>()) && got.size() == shape.size();
  for (size_t i = 0; good && i < shape.size(); ++i) good = shape[i] == kAny || shape[i] == got[i];
  if (!good)
    throw py::value_error(expected + shape_text(got, "") + " " + py::cast<std::string>(py::str(array.dtype())));
  return Array<T>::ensure(array);
}

// A scene registered for as long as the Python object lives.
struct PyScene {
  PyScene(const py::object& vertices, const py::object& triangles) {
    const auto v = checked<float>("Scene", "vertices", vertices, {kAny, 3});
    const auto t = checked<int32_t>("Scene", "triangles", triangles, {kAny, 3});
    py::gil_scoped_release release;
    scene = std::make_shared<const Scene>(v.data(), v.shape(0), t.data(), t.shape(0));
    handle = splitnerf::register_scene(scene);
  }
  ~PyScene() { splitnerf::release_scene(handle); }
  PyScene(const PyScene&) = delete;
  PyScene& operator=(const PyScene&) = delete;

  std::shared_ptr<const Scene> scene;
  int64_t handle = 0;
};

py::array_t<bool> trace_visibility(const PyScene& self, const py::object& origins, const py::object& directions,
                                   float t_far) {
  const auto o = checked<float>("trace_visibility", "origins", origins, {kAny, 3});
  const auto d = checked<float>("trace_visibility", "directions", directions, {o.shape(0), 3});
  py::array_t<bool> visible(o.shape(0));
  auto* out = reinterpret_cast<uint8_t*>(visible.mutable_data());
  py::gil_scoped_release release;
  self.scene->trace_visibility(o.data(), d.data(), o.shape(0), t_far, out);
  return visible;
}

py::tuple trace_closest(const PyScene& self, const py::object& origins, const py::object& directions) {
  const auto o = checked<float>("trace_closest", "origins", origins, {kAny, 3});
  const auto d = checked<float>("trace_closest", "directions", directions, {o.shape(0), 3});
  const py::ssize_t n = o.shape(0);
  py::array_t<float> u(n), v(n);
  py::array_t<int64_t> triangle(n);
  std::vector<Hit> hits(n);
  {
    py::gil_scoped_release release;
    self.scene->trace_closest(o.data(), d.data(), n, std::numeric_limits<float>::infinity(), hits.data());
  }
  for (py::ssize_t i = 0; i < n; ++i) {
    triangle.mutable_data()[i] = hits[i].t < 0 ? -1 : int64_t(hits[i].triangle);
    u.mutable_data()[i] = hits[i].u;
    v.mutable_data()[i] = hits[i].v;
  }
  return py::make_tuple(triangle, u, v);
}

// The checked materials of a Surface, and what keeps their arrays alive.
struct PyMaterials {
  // materials: objects with the attributes of splitnerf.data.asset.Material.
  explicit PyMaterials(const py::list& list) {
    for (const auto& item : list) {
      splitnerf::SurfaceMaterial m;
      m.albedo = vector(item, "albedo");
      m.roughness = item.attr("roughness").cast<float>();
      m.metallic = item.attr("metallic").cast<float>();
      m.emission = vector(item, "emission");
      m.albedo_texture = texture(item, "albedo_texture", 3);
      m.roughness_metallic_texture = texture(item, "roughness_metallic_texture", 2);
      m.normal_texture = texture(item, "normal_texture", 3);
      m.emission_texture = texture(item, "emission_texture", 3);
      splitnerf::check_material("render", m);
      materials.push_back(m);
    }
  }
  static splitnerf::Vec3<float> vector(py::handle item, const char* name) {
    const auto v = item.attr(name).cast<std::array<float, 3>>();
    return {v[0], v[1], v[2]};
  }
  splitnerf::Texture texture(py::handle item, const char* name, int channels) {
    const py::object values = item.attr(name);
    if (values.is_none()) return {};
    arrays.push_back(checked<float>("render", name, values, {kAny, kAny, channels}));
    return {arrays.back().data(), int(arrays.back().shape(0)), int(arrays.back().shape(1))};
  }
  std::vector<splitnerf::SurfaceMaterial> materials;
  std::vector<Array<float>> arrays;
};

splitnerf::PixelFilter pixel_filter(const std::string& name) {
  if (name == "box") return splitnerf::PixelFilter::kBox;
  if (name == "blackman-harris") return splitnerf::PixelFilter::kBlackmanHarris;
  throw py::value_error("render: pixel_filter must be 'box' or 'blackman-harris', got '" + name + "'");
}

py::array_t<float> pixel_filter_offsets(const py::object& u, const std::string& filter) {
  const auto shares = checked<float>("pixel_filter_offsets", "u", u, {kAny});
  const splitnerf::PixelFilterSampler sampler(pixel_filter(filter));
  py::array_t<float> offsets(shares.shape(0));
  for (py::ssize_t i = 0; i < shares.shape(0); ++i) offsets.mutable_data()[i] = sampler(shares.data()[i]);
  return offsets;
}

// Runs Python's handlers of signals that came meanwhile, so that Ctrl-C ends a long call.
void raise_what_signals_ask() {
  py::gil_scoped_acquire acquire;
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

py::dict render(const PyScene& self, const py::object& albedo, const py::object& roughness, const py::object& metallic,
                const py::object& environment, const py::object& camera_to_world, float fx, float fy, float cx,
                float cy, int width, int height, const py::object& normals, const PyMaterials* materials,
                const py::object& material_ids, const py::object& uv, const py::object& tangents, int spp,
                int max_bounces, uint32_t seed, float clamp_indirect, const std::string& filter,
                const std::optional<float>& catcher_height) {
  const py::ssize_t n = self.scene->n_vertices();
  const auto albedos = checked<float>("render", "albedo", albedo, {n, 3});
  const auto roughnesses = checked<float>("render", "roughness", roughness, {n});
  const auto metallics = checked<float>("render", "metallic", metallic, {n});
  const auto map = checked<float>("render", "environment", environment, {kAny, kAny, 3});
  const auto pose = checked<float>("render", "camera_to_world", camera_to_world, {3, 4});
  Array<float> shading;
  if (!normals.is_none()) shading = checked<float>("render", "normals", normals, {self.scene->n_vertices(), 3});
  if (width <= 0 || height <= 0) {
    throw py::value_error("render: width and height must be positive, got " + std::to_string(width) + " x " +
                          std::to_string(height));
  }

  splitnerf::Camera camera{{}, fx, fy, cx, cy, width, height};
  std::copy_n(pose.data(), 12, camera.camera_to_world);
  splitnerf::Surface surface{albedos.data(), roughnesses.data(), metallics.data(),
                             normals.is_none() ? nullptr : shading.data()};
  Array<int32_t> ids;
  Array<float> uvs, frames;
  if (materials) {
    ids = checked<int32_t>("render", "material_ids", material_ids, {self.scene->n_triangles()});
    surface.material_ids = ids.data();
    surface.materials = materials->materials.data();
    surface.n_materials = int(materials->materials.size());
  }
  if (!uv.is_none()) {
    uvs = checked<float>("render", "uv", uv, {self.scene->n_vertices(), 2});
    surface.uv = uvs.data();
  }
  if (!tangents.is_none()) {
    frames = checked<float>("render", "tangents", tangents, {self.scene->n_vertices(), 4});
    surface.tangents = frames.data();
  }
  const splitnerf::EnvironmentMap light{map.data(), int(map.shape(0)), int(map.shape(1))};
  splitnerf::PathTracerParams params{spp, max_bounces, seed};
  params.clamp_indirect = clamp_indirect, params.filter = pixel_filter(filter);
  params.shadow_catcher = catcher_height.has_value(), params.catcher_height = catcher_height.value_or(0.f);

  py::dict images;
  const auto allocate = [&](const char* name, int channels) {
    std::vector<py::ssize_t> shape{height, width};
    if (channels == 3) shape.push_back(3);
    py::array_t<float> image(shape);
    images[name] = image;
    return image.mutable_data();
  };
  const splitnerf::RenderTargets targets{
      allocate("radiance", 3),      allocate("alpha", 1),    allocate("albedo", 3),
      allocate("roughness", 1),     allocate("metallic", 1), allocate("normal", 3),
      allocate("smooth_normal", 3), allocate("depth", 1),    catcher_height ? allocate("shadow", 1) : nullptr};
  {
    py::gil_scoped_release release;
    splitnerf::render(*self.scene, surface, light, camera, params, targets, raise_what_signals_ask);
  }
  return images;
}

// Traces with embreex where the library was built without Embree. The embreex scene is built with
// the first rays and stays with the scene.
void trace_with_embreex(const Scene& scene, std::shared_ptr<void>& tracer, const float* origins,
                        const float* directions, int64_t n_rays, float t_far, Hit* hits) {
  py::gil_scoped_acquire acquire;
  if (!tracer) {
    py::object built = py::module_::import("embreex.rtcore_scene").attr("EmbreeScene")();
    py::module_::import("embreex.mesh_construction")
        .attr("TriangleMesh")(built, Array<float>({scene.n_vertices(), int64_t(3)}, scene.vertices()),
                              Array<int32_t>({scene.n_triangles(), int64_t(3)}, scene.triangles()));
    tracer = std::shared_ptr<void>(new py::object(std::move(built)), [](void* p) {
      py::gil_scoped_acquire acquire_to_destroy;
      delete static_cast<py::object*>(p);
    });
  }
  Array<float> t_fars(n_rays);
  std::fill_n(t_fars.mutable_data(), n_rays, t_far);
  const py::dict found =
      static_cast<py::object*>(tracer.get())
          ->attr("run")(Array<float>({n_rays, int64_t(3)}, origins), Array<float>({n_rays, int64_t(3)}, directions),
                        py::arg("dists") = t_fars, py::arg("query") = "INTERSECT", py::arg("output") = true);
  const Array<float> t(found["tfar"]), u(found["u"]), v(found["v"]);
  const Array<int32_t> triangle(found["primID"]);
  for (int64_t i = 0; i < n_rays; ++i) {
    const bool hit = triangle.data()[i] >= 0;
    hits[i] = {hit ? t.data()[i] : -1.f, hit ? uint32_t(triangle.data()[i]) : 0, u.data()[i], v.data()[i]};
  }
}

}  // namespace

void bind_scene(py::module_& m) {
  splitnerf::set_trace_callback(trace_with_embreex);

  py::class_<PyScene>(
      m, "Scene", "A triangle mesh ready for ray tracing: vertices [n, 3] float32, triangles [m, 3] int32 (copied).")
      .def(py::init<const py::object&, const py::object&>(), py::arg("vertices"), py::arg("triangles"))
      .def_readonly("handle", &PyScene::handle, "The integer that names the scene to torch operators while it lives.")
      .def("trace_visibility", &trace_visibility, py::arg("origins"), py::arg("directions"), py::arg("t_far"),
           "[n] bool: True where the segment origin + t direction, t in (0, t_far), meets nothing.\n\n"
           "origins, directions: [n, 3] float32. Neighbours in the arrays should be neighbours in space.")
      .def("trace_closest", &trace_closest, py::arg("origins"), py::arg("directions"),
           "The nearest hits as (triangle [n] int64, u [n] float32, v [n] float32); triangle = -1 for a miss.\n\n"
           "u and v are the barycentric coordinates of the triangle's second and third vertex.");

  py::class_<PyMaterials>(
      m, "Materials",
      "Checked materials for render, from a list of splitnerf.data.asset.Material. ValueError where a\n"
      "factor or a texture lies outside its range.")
      .def(py::init<const py::list&>(), py::arg("materials"));

  m.def(
      "render", &render, py::arg("scene"), py::arg("albedo"), py::arg("roughness"), py::arg("metallic"),
      py::arg("environment"), py::arg("camera_to_world"), py::arg("fx"), py::arg("fy"), py::arg("cx"), py::arg("cy"),
      py::arg("width"), py::arg("height"), py::kw_only(), py::arg("normals") = py::none(),
      py::arg("materials") = py::none(), py::arg("material_ids") = py::none(), py::arg("uv") = py::none(),
      py::arg("tangents") = py::none(), py::arg("spp") = 64, py::arg("max_bounces") = 4, py::arg("seed") = 0,
      py::arg("clamp_indirect") = 0.f, py::arg("pixel_filter") = "box", py::arg("catcher_height") = py::none(),
      "Path-traces the scene: see splitnerf.render.path_traced.AssetRenderer.render, which calls it; float32 arrays in "
      "and out.\n\n"
      "albedo [n_vertices, 3], roughness and metallic [n_vertices] in [0, 1], linear, are multiplied with what the\n"
      "materials say. normals: [n_vertices, 3], or None for flat shading. Maps of the first hit are means over the\n"
      "sub-samples that hit.");

  m.def(
      "pixel_filter_offsets", &pixel_filter_offsets, py::arg("u"), py::arg("pixel_filter") = "blackman-harris",
      "Offsets from a pixel's centre, in pixels, at which shares u [n] float32 in [0, 1) of the filter lie below; see "
      "render.");

  m.def(
      "embree_version", [] { return std::string(splitnerf::embree_version()); },
      "The version of Embree in use, or '' where the library was built without it (rays go to embreex then).");
}
