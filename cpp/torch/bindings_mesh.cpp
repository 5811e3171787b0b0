// Marching cubes on NumPy arrays: check, call without the GIL, hand the vectors over.
#include "bindings.h"

#include <string>

#include "splitnerf/marching_cubes.h"

namespace py = pybind11;

namespace {

using splitnerf::BlockGrid;
using Values = py::array_t<float, py::array::c_style>;
using Index = py::array_t<int32_t, py::array::c_style>;

BlockGrid checked_grid(const char* function, const Values& values, const Index& index) {
  const int b = splitnerf::kMeshBlock;
  const bool blocks = values.ndim() == 4 && values.shape(1) == b && values.shape(2) == b && values.shape(3) == b;
  const bool cube = index.ndim() == 3 && index.shape(0) == index.shape(1) && index.shape(1) == index.shape(2);
  if (!blocks || !cube)
    throw py::value_error(std::string(function) + ": values must be [n, 4, 4, 4] and index a cube [k, k, k]");
  int64_t rows = 0;
  for (py::ssize_t i = 0; i < index.size(); ++i) {
    const int32_t row = index.data()[i];
    if (row < splitnerf::kInsideBlock || row >= values.shape(0))
      throw py::value_error(std::string(function) + ": index holds " + std::to_string(row) + ", values have " +
                            std::to_string(values.shape(0)) + " blocks");
    rows += row >= 0;
  }
  if (rows != values.shape(0))
    throw py::value_error(std::string(function) + ": index must name each block of values once");
  return {int(index.shape(0)), index.data(), values.data()};
}

}  // namespace

void bind_mesh(py::module_& m) {
  m.attr("MESH_BLOCK") = splitnerf::kMeshBlock;
  m.attr("OUTSIDE_BLOCK") = splitnerf::kOutsideBlock;
  m.attr("INSIDE_BLOCK") = splitnerf::kInsideBlock;

  m.def(
      "blocks_to_open",
      [](const Values& values, const Index& index) {
        const BlockGrid grid = checked_grid("blocks_to_open", values, index);
        std::vector<int64_t> found;
        {
          py::gil_scoped_release release;
          found = splitnerf::blocks_to_open(grid);
        }
        return to_array<int64_t>(found, {py::ssize_t(found.size())});
      },
      py::arg("values").noconvert(), py::arg("index").noconvert(),
      "Flat indices [n] int64 of the blocks without values that the surface enters; arguments as marching_cubes.");

  m.def(
      "marching_cubes",
      [](const Values& values, const Index& index, double origin, double spacing) {
        const BlockGrid grid = checked_grid("marching_cubes", values, index);
        splitnerf::TriangleMesh mesh;
        {
          py::gil_scoped_release release;
          mesh = splitnerf::marching_cubes(grid, origin, spacing);
        }
        const py::ssize_t n = mesh.vertices.size() / 3, m = mesh.triangles.size() / 3, corners = 3;
        return py::make_tuple(to_array<float>(mesh.vertices, {n, corners}),
                              to_array<int32_t>(mesh.triangles, {m, corners}));
      },
      py::arg("values").noconvert(), py::arg("index").noconvert(), py::arg("origin"), py::arg("spacing"),
      "The zero level set as (vertices [n, 3] float32, triangles [m, 3] int32), outward where values < 0 is inside.\n\n"
      "values: [n, 4, 4, 4] float32, the nodes of the blocks that have values.\n"
      "index: [k, k, k] int32, the row of each block in values, or OUTSIDE_BLOCK or INSIDE_BLOCK, the sign of all of\n"
      "its nodes. Node (i, j, k) lies at origin + spacing (i, j, k). Cells that a block without values shares hold no\n"
      "triangle: fill first what blocks_to_open names, until it names nothing.");
}
