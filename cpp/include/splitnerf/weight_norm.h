// Weight normalisation: a row of weights w = length u, u = d / |d|, whose length is learned beside its direction d.
// Source: Salimans and Kingma 2016, Eq. (2) and (3).
#pragma once

#include <cmath>

#include "splitnerf/group.h"

namespace splitnerf {

// 1 / |d| of a row of n numbers; infinite for zeros.
template <class T, class Group> SPLITNERF_HD T inverse_norm(const Group& group, int64_t n, const T* direction) {
  T squares = T(0);
  for (int64_t k = group.lane(); k < n; k += Group::size) squares += direction[k] * direction[k];
  return T(1) / std::sqrt(group.sum(squares));
}

// With g the gradient to w: grad_length = u.g,  grad_d = length / |d| (g - u (u.g)). grad_direction may be the memory of g.
template <class T, class Group>
SPLITNERF_HD void weight_norm_backward(const Group& group, int64_t n, const T* direction, T length, const T* grad,
                                       T* grad_direction, T* grad_length) {
  const T inverse = inverse_norm(group, n, direction);
  T along = T(0);
  for (int64_t k = group.lane(); k < n; k += Group::size) along += direction[k] * inverse * grad[k];
  along = group.sum(along);
  for (int64_t k = group.lane(); k < n; k += Group::size)
    grad_direction[k] = length * inverse * (grad[k] - direction[k] * inverse * along);
  if (group.lane() == 0) *grad_length = along;
}

}  // namespace splitnerf
