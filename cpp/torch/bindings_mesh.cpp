// Marching cubes on NumPy arrays: check, call without the GIL, hand the vectors over.
#include "bindings_mesh.h"

#include <pybind11/numpy.h>

#include <algorithm>
#include <string>
#include <vector>

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

template <class T> py::array_t<T> as_array(const std::vector<T>& values, py::ssize_t columns) {
  py::array_t<T> out({py::ssize_t(values.size()) / columns, columns});
  std::copy(values.begin(), values.end(), out.mutable_data());
  return out;
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
        return as_array(found, 1).reshape({py::ssize_t(found.size())});
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
        return py::make_tuple(as_array(mesh.vertices, 3), as_array(mesh.triangles, 3));
      },
      py::arg("values").noconvert(), py::arg("index").noconvert(), py::arg("origin"), py::arg("spacing"),
      "The zero level set as (vertices [n, 3] float32, triangles [m, 3] int32), outward where values < 0 is inside.\n\n"
      "values: [n, 4, 4, 4] float32, the nodes of the blocks that have values.\n"
      "index: [k, k, k] int32, the row of each block in values, or OUTSIDE_BLOCK or INSIDE_BLOCK, the sign of all of\n"
      "its nodes. Node (i, j, k) lies at origin + spacing (i, j, k). Cells that a block without values shares hold no\n"
      "triangle: fill first what blocks_to_open names, until it names nothing.");
}
