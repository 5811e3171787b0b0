// The pybind11 module splitnerf._core: what is no tensor operator.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <array>

#include "bindings.h"
#include "splitnerf/environment.h"
#include "splitnerf/hash_grid.h"
#include "splitnerf/kernels.h"
#include "splitnerf/sampling.h"
#include "splitnerf/split_sum.h"

namespace py = pybind11;

PYBIND11_MODULE(_core, m) {
  m.doc() = "Embree scenes, the path tracer, marching cubes and build information of SplitNeRF.";

  m.def(
      "hash_grid_levels",
      [](int64_t n_levels, int64_t n_features, int64_t base_resolution, double growth, int64_t log2_table_size) {
        const std::string error =
            splitnerf::hash_shape_error(n_levels, n_features, base_resolution, growth, log2_table_size);
        if (!error.empty()) throw py::value_error("hash_grid_levels: " + error);
        const splitnerf::HashGridShape shape{static_cast<int>(n_levels), static_cast<int>(n_features),
                                             static_cast<int>(base_resolution), growth,
                                             static_cast<int>(log2_table_size)};
        std::array<splitnerf::HashLevel, splitnerf::kMaxLevels> levels;
        splitnerf::hash_levels(shape, levels.data());
        py::list out;
        for (int l = 0; l < n_levels; ++l)
          out.append(py::make_tuple(levels[l].resolution, levels[l].offset, levels[l].n_entries, levels[l].dense));
        return out;
      },
      py::arg("n_levels"), py::arg("n_features"), py::arg("base_resolution"), py::arg("growth"),
      py::arg("log2_table_size"),
      "Geometry of a hash grid: a list of (resolution, offset, n_entries, dense), one per level.");

  m.def(
      "brdf_lut",
      [] {
        constexpr int n = splitnerf::kLutSize, channels = splitnerf::kLutChannels;
        py::array_t<float> lut({n, n, channels});
        std::copy_n(splitnerf::brdf_lut(), n * n * channels, lut.mutable_data());
        return lut;
      },
      "F1, F2, chi and E_d over (roughness, sqrt(n.v)) as a [32, 32, 4] float32 array.");

  m.def(
      "fibonacci_sphere",
      [](uint32_t n) {
        py::array_t<double> points({static_cast<py::ssize_t>(n), static_cast<py::ssize_t>(3)});
        for (uint32_t i = 0; i < n; ++i)
          splitnerf::store3(points.mutable_data(i, 0), splitnerf::fibonacci_sphere<double>(i, n));
        return points;
      },
      py::arg("n"), "The n-point Fibonacci lattice on the unit sphere as an [n, 3] float64 array.");

  m.def(
      "equirect_directions",
      [](int height, int width) {
        if (height < 1 || width < 1) throw py::value_error("equirect_directions: height and width must be positive");
        py::array_t<double> directions({height, width, 3});
        for (int row = 0; row < height; ++row)
          for (int column = 0; column < width; ++column)
            splitnerf::store3(directions.mutable_data(row, column, 0),
                              splitnerf::equirect_to_direction(
                                  splitnerf::Vec2<double>{(column + 0.5) / width, (row + 0.5) / height}));
        return directions;
      },
      py::arg("height"), py::arg("width"),
      "Unit directions of the texel centres of an equirectangular map as a [height, width, 3] float64 array.");

  m.def(
      "instruction_set", [] { return splitnerf::kernels<float>().name; },
      "The instruction set that the kernels run on: base, avx2 or avx512.");

  m.def(
      "cuda_architectures", [] { return SPLITNERF_CUDA_ARCHITECTURES; },
      "The GPU architectures that the operators were built for; empty for a build without CUDA.");

  bind_light(m);
  bind_mesh(m);
  bind_photos(m);
  bind_scene(m);
}
