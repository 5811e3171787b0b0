// Embree scenes and the path tracer on NumPy arrays, see bindings_scene.cpp.
#pragma once

#include <pybind11/pybind11.h>

void bind_scene(pybind11::module_& m);
