#include "bindings.h"

#include <string>

#include "splitnerf/light_tables.h"
#include "splitnerf/spherical_harmonics.h"

namespace py = pybind11;

namespace {

py::tuple to_tuple(const splitnerf::SparseMatrix& matrix) {
  const auto n = static_cast<py::ssize_t>(matrix.columns.size());
  const auto n_offsets = static_cast<py::ssize_t>(matrix.offsets.size());
  return py::make_tuple(to_array<int64_t>(matrix.offsets, {n_offsets}), to_array<int32_t>(matrix.columns, {n}),
                        to_array<double>(matrix.weights, {n}), matrix.n_columns);
}

void check_side(const char* function, int n) {
  if (n < splitnerf::kCoarsestAverage || n > 4096 || (n & (n - 1)))
    throw py::value_error(std::string(function) + ": the resolution must be a power of 2 in [8, 4096], got " +
                          std::to_string(n));
}

}  // namespace

void bind_light(py::module_& m) {
  m.def(
      "octahedral_solid_angles",
      [](int n) {
        check_side("octahedral_solid_angles", n);
        return to_array<double>(splitnerf::octahedral_solid_angles(n), {n * n});
      },
      py::arg("n"), "Solid angles of the texels of an octahedral map, [n^2] float64.");
  m.def(
      "light_sum_of_levels",
      [](int n) {
        check_side("light_sum_of_levels", n);
        return to_tuple(splitnerf::light_sum_of_levels(n));
      },
      py::arg("n"), "Levels 4^2 ... n^2, interpolated and added: (offsets, columns, weights, n_columns).");
  m.def(
      "light_averages",
      [](int n) {
        check_side("light_averages", n);
        return to_tuple(splitnerf::light_averages(n));
      },
      py::arg("n"), "n^2 texels and their averages down to 8^2: (offsets, columns, weights, n_columns).");
  m.def(
      "light_filter",
      [](int n, int resolution, double roughness) {
        check_side("light_filter", n);
        if (resolution < 2 || resolution > 4096 || resolution % 2 != 0)
          throw py::value_error("light_filter: resolution must be even, in [2, 4096], got " +
                                std::to_string(resolution));
        if (!(roughness >= 0 && roughness <= 1)) throw py::value_error("light_filter: roughness must be in [0, 1]");
        return to_tuple(splitnerf::light_filter(n, resolution, roughness));
      },
      py::arg("n"), py::arg("resolution"), py::arg("roughness"),
      "Rows of light_averages(n) filtered at a quarter of resolution^2 texels: (offsets, columns, weights, "
      "n_columns).");
  m.def(
      "sh_projection",
      [](int n, bool cells) {
        check_side("sh_projection", n);
        return to_array<double>(splitnerf::sh_projection(n, cells), {splitnerf::kShCoefficients, n * n});
      },
      py::arg("n"), py::arg("cells"), "Spherical harmonics of a light of n^2 texels: [169, n^2] float64.");
  m.def(
      "zonal_factors",
      [](double start, int n_rows) {
        if (!(start >= 0.1 && start < 1) || n_rows < 2)
          throw py::value_error("zonal_factors: start must be in [0.1, 1) and n_rows at least 2");
        return to_array<double>(splitnerf::zonal_factors(start, n_rows), {n_rows, splitnerf::kShBands});
      },
      py::arg("start"), py::arg("n_rows"), "Factors of the lobe by degree, roughness start to 1: [n_rows, 13].");
}
