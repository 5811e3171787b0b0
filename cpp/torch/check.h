// Argument checks and allocation for the operators. Errors read
//   hash_encode: positions must be [n, 3] float32, got [8, 2] float64
#pragma once

#include <torch/csrc/stable/device.h>
#include <torch/csrc/stable/library.h>
#include <torch/csrc/stable/ops.h>
#include <torch/csrc/stable/tensor.h>
#include <torch/headeronly/core/ScalarType.h>

#include <initializer_list>
#include <optional>
#include <stdexcept>
#include <string>

namespace splitnerf::glue {

using torch::headeronly::DeviceType;
using torch::headeronly::ScalarType;
using torch::stable::Device;
using torch::stable::Tensor;

inline std::string describe(ScalarType type) {
  switch (type) {
    case ScalarType::Float:
      return "float32";
    case ScalarType::Double:
      return "float64";
    case ScalarType::Half:
      return "float16";
    case ScalarType::BFloat16:
      return "bfloat16";
    case ScalarType::Long:
      return "int64";
    case ScalarType::Int:
      return "int32";
    case ScalarType::Short:
      return "int16";
    case ScalarType::Byte:
      return "uint8";
    case ScalarType::Bool:
      return "bool";
    default:
      return "another dtype";
  }
}

inline constexpr int64_t kAny = -1;  // a dimension that may have any size

// What an operator computes in: a dtype on one device, those of its first tensor.
struct Kind {
  ScalarType type;
  Device device{DeviceType::CPU};

  Kind(ScalarType type) : type(type) {}  // on the CPU
  Kind(ScalarType type, Device device) : type(type), device(device) {}
  operator ScalarType() const { return type; }
  Kind with(ScalarType other) const { return {other, device}; }
  bool on_cpu() const { return device.type() == DeviceType::CPU; }
};

inline std::string describe(const Device& device) {
  if (device.type() == DeviceType::CPU) return "the CPU";
  return (device.type() == DeviceType::CUDA ? "CUDA device " : "device ") + std::to_string(device.index());
}

// The tensor as a contiguous one of the given shape, dtype and device, or std::invalid_argument.
inline Tensor checked(const char* op, const char* name, const Tensor& t, std::initializer_list<int64_t> shape,
                      Kind kind) {
  const Device device = t.device();
  const bool here = device.type() == kind.device.type() && (kind.on_cpu() || device.index() == kind.device.index());
  bool fits = t.scalar_type() == kind.type && t.dim() == static_cast<int64_t>(shape.size()) && here;
  int64_t axis = 0;
  for (int64_t size : shape) {
    if (!fits) break;
    fits = size == kAny || t.size(axis) == size;
    ++axis;
  }
  if (!fits) {
    std::string wanted, got;
    for (int64_t size : shape) wanted += (wanted.empty() ? "" : ", ") + (size == kAny ? "n" : std::to_string(size));
    for (int64_t i = 0; i < t.dim(); ++i) got += (got.empty() ? "" : ", ") + std::to_string(t.size(i));
    throw std::invalid_argument(std::string(op) + ": " + name + " must be [" + wanted + "] " + describe(kind.type) +
                                " on " + describe(kind.device) + ", got [" + got + "] " + describe(t.scalar_type()) +
                                (here ? "" : " on " + describe(device)));
  }
  const Tensor dense = torch::stable::contiguous(t);
  // The kernels read several values at once, where a view may begin between two such groups.
  const bool aligned = kind.on_cpu() || reinterpret_cast<uintptr_t>(dense.const_data_ptr()) % 16 == 0;
  return aligned ? dense : torch::stable::clone(dense);
}

// The floating dtype and the device that an operator computes in: those of its first tensor.
inline Kind real_kind(const char* op, const char* name, const Tensor& t) {
  const ScalarType type = t.scalar_type();
  if (type != ScalarType::Float && type != ScalarType::Double)
    throw std::invalid_argument(std::string(op) + ": " + name + " must be float32 or float64, got " + describe(type));
  return {type, t.device()};
}

inline void require(bool condition, const char* op, const std::string& what) {
  if (!condition) throw std::invalid_argument(std::string(op) + ": " + what);
}

template <class T> const T* in(const Tensor& t) { return static_cast<const T*>(t.const_data_ptr()); }
template <class T> const T* in_or_null(const std::optional<Tensor>& t) { return t ? in<T>(*t) : nullptr; }
template <class T> T* out(Tensor& t) { return static_cast<T*>(t.mutable_data_ptr()); }

// Whether all numbers of a tensor on the CPU lie in [0, high): kernels read without a check.
template <class T> bool all_below(const Tensor& t, int64_t high) {
  const T* values = in<T>(t);
  T least = 0, most = -1;
  for (int64_t i = 0, n = t.numel(); i < n; ++i) {
    least = values[i] < least ? values[i] : least;
    most = values[i] > most ? values[i] : most;
  }
  return least >= 0 && int64_t(most) < high;
}
inline void check_indices(const char* op, const char* name, const Tensor& t, int64_t high) {
  require(all_below<int32_t>(t, high), op,
          std::string(name) + " must hold numbers in [0, " + std::to_string(high) + ")");
}

inline Tensor empty_like_type(const Tensor& like, std::initializer_list<int64_t> shape, ScalarType type) {
  return torch::stable::new_empty(like, shape, type);
}

// Calls body(T{}) with T = float or double.
template <class Body> void dispatch_real(ScalarType type, Body&& body) {
  if (type == ScalarType::Float) {
    body(float{});
  } else {
    body(double{});
  }
}

}  // namespace splitnerf::glue
