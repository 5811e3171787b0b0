// Averages of photos on NumPy arrays, see bindings_photos.cpp.
#pragma once

#include <pybind11/pybind11.h>

void bind_photos(pybind11::module_& m);
