// The number of features of a level, and what a table stores, as constants.
#pragma once

#include <type_traits>

namespace splitnerf {

template <int F> struct Features {
  static constexpr int n = F;
};
// Calls body(Features<n_features>{}).
template <class Body> void with_features(int n_features, Body&& body) {
  switch (n_features) {
    case 1:
      return body(Features<1>{});
    case 2:
      return body(Features<2>{});
    case 4:
      return body(Features<4>{});
    case 8:
      return body(Features<8>{});
  }
}

// What a pointer points to.
template <class Pointer> using Pointee = std::remove_const_t<std::remove_pointer_t<Pointer>>;

}  // namespace splitnerf
