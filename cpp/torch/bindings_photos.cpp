// Averages of photos on NumPy arrays: check, call without the GIL.
#include "bindings.h"

#include <cstdint>

#include "splitnerf/photo_average.h"

namespace py = pybind11;

namespace {

template <class Code> using Codes = py::array_t<Code, py::array::c_style>;

template <class Code> py::array_t<uint16_t> average_photo(const Codes<Code>& codes, int64_t factor, bool object_alone) {
  if (codes.ndim() != 3 || codes.shape(2) != 4)
    throw py::value_error("average_photo: codes must be [height, width, 4]");
  const py::ssize_t height = codes.shape(0), width = codes.shape(1);
  if (factor < 1 || factor > height || factor > width)
    throw py::value_error("average_photo: factor must be from 1 to the photo's shorter edge");
  py::array_t<uint16_t> out({py::ssize_t(height / factor), py::ssize_t(width / factor), py::ssize_t(4)});
  uint16_t* values = out.mutable_data();
  py::gil_scoped_release release;
  splitnerf::average_photo(codes.data(), height, width, factor, object_alone, values);
  return out;
}

}  // namespace

void bind_photos(py::module_& m) {
  const char* doc =
      "Means of blocks of factor x factor pixels in linear light, [height // factor, width // factor, 4] uint16.\n\n"
      "codes: [height, width, 4] uint8 or uint16, sRGB, straight alpha.\n"
      "object_alone: whether colours weigh by alpha, and are 0 where alpha is 0; else all weigh the same.";
  m.def("average_photo", &average_photo<uint8_t>, py::arg("codes").noconvert(), py::arg("factor"),
        py::arg("object_alone"), doc);
  m.def("average_photo", &average_photo<uint16_t>, py::arg("codes").noconvert(), py::arg("factor"),
        py::arg("object_alone"), doc);
}
