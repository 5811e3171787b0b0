// What the Python module _core is made of: each function adds its part.
#pragma once

#include <pybind11/numpy.h>

#include <algorithm>
#include <vector>

void bind_light(pybind11::module_& m);
void bind_mesh(pybind11::module_& m);
void bind_photos(pybind11::module_& m);
void bind_scene(pybind11::module_& m);

// A NumPy array of numbers, in this shape.
template <class To, class From>
pybind11::array_t<To> to_array(const std::vector<From>& values, pybind11::array::ShapeContainer shape) {
  pybind11::array_t<To> out(std::move(shape));
  std::copy(values.begin(), values.end(), out.mutable_data());
  return out;
}
