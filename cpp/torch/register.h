// SPLITNERF_OPERATORS(op) { op(SPLITNERF_OP(half_vector), "light_dirs view_dirs"); } defines operators, and registers them for every
// device that this build serves; SPLITNERF_CPU_OPERATORS for the CPU alone. An operator has the name and the types of its C++
// function; the string holds the names of its arguments, with defaults, "table stored=None", and marks of what it writes to, "table(a!)".
#pragma once

#include <torch/csrc/stable/library.h>
#include <torch/csrc/stable/tensor.h>

#include <algorithm>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <tuple>
#include <type_traits>
#include <vector>

namespace splitnerf::glue {

using torch::stable::detail::StableLibrary;

// The type of a schema that stands for a C++ type.
template <class T> struct SchemaType {
  static std::string name() {
    if constexpr (std::is_same_v<T, int64_t>) return "int";
    if constexpr (std::is_same_v<T, double>) return "float";
    if constexpr (std::is_same_v<T, bool>) return "bool";
    if constexpr (std::is_same_v<T, torch::stable::Tensor>) return "Tensor";
    if constexpr (std::is_void_v<T>) return "()";
  }
};
template <class T> struct SchemaType<std::optional<T>> {
  static std::string name() { return SchemaType<T>::name() + "?"; }
};
template <class T> struct SchemaType<std::vector<T>> {
  static std::string name() { return SchemaType<T>::name() + "[]"; }
};
template <class... T> struct SchemaType<std::tuple<T...>> {
  static std::string name() {
    std::string types;
    ((types += ", " + SchemaType<T>::name()), ...);
    return "(" + types.substr(2) + ")";
  }
};

template <class Result, class... Arguments>
std::string schema_of(const char* name, Result (*)(Arguments...), const char* arguments) {
  std::istringstream words(arguments);
  std::string schema, word;
  for (std::string type : {SchemaType<Arguments>::name()...}) {
    if (!(words >> word)) throw std::logic_error(std::string(name) + ": an argument has no name");
    const size_t mark = std::min(word.find('('), word.size());  // stands behind the name of the type in a schema
    schema += ", " + type.insert(std::min(type.find('['), type.size()), word.substr(mark)) + " " + word.substr(0, mark);
  }
  if (words >> word) throw std::logic_error(std::string(name) + ": has no argument " + word);
  return name + ("(" + schema.substr(2)) + ") -> " + SchemaType<Result>::name();
}

#define SPLITNERF_OP(function) #function, &function, TORCH_BOX(&function)

#define SPLITNERF_REGISTER_ON(list, key)                                                       \
  STABLE_TORCH_LIBRARY_IMPL(splitnerf, key, library) {                                         \
    list([&](const char* name, auto, auto boxed, const char*) { library.impl(name, boxed); }); \
  }
#define SPLITNERF_LIST(list, op)                                             \
  template <class Op> static void list(const Op& op);                        \
  STABLE_TORCH_LIBRARY_FRAGMENT(splitnerf, library) {                        \
    list([&](const char* name, auto function, auto, const char* arguments) { \
      library.def(schema_of(name, function, arguments).c_str());             \
    });                                                                      \
  }                                                                          \
  SPLITNERF_REGISTER_ON(list, CPU)
#define SPLITNERF_CPU_OPERATORS(op) \
  SPLITNERF_LIST(cpu_operators, op) \
  template <class Op> static void cpu_operators(const Op& op)
#ifdef SPLITNERF_WITH_CUDA
#define SPLITNERF_OPERATORS(op)          \
  SPLITNERF_LIST(operators, op)          \
  SPLITNERF_REGISTER_ON(operators, CUDA) \
  template <class Op> static void operators(const Op& op)
#else
#define SPLITNERF_OPERATORS(op) \
  SPLITNERF_LIST(operators, op) \
  template <class Op> static void operators(const Op& op)
#endif

}  // namespace splitnerf::glue
