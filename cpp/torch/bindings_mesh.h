// Marching cubes on NumPy arrays, see bindings_mesh.cpp.
#pragma once

#include <pybind11/pybind11.h>

void bind_mesh(pybind11::module_& m);
