// take_rows, put_rows and clear_unless_ as torch operators.
#include <algorithm>
#include <vector>

#include "device.h"
#include "splitnerf/bodies/rows.h"

namespace splitnerf::glue {
namespace {

Tensor checked_index(const char* op, const Tensor& index, const Kind& type, int64_t n) {
  const Tensor numbers = checked(op, "index", index, {kAny}, type.with(ScalarType::Long));
  if (type.on_cpu()) require(all_below<int64_t>(numbers, n), op, "index must hold numbers of rows");
  require(numbers.size(0) == 0 || n > 0, op, "there are no rows to take");
  return numbers;
}

void check_count(const char* op, size_t n) {
  require(n > 0 && n <= kMostRowArrays, op, "tensors must be 1 to " + std::to_string(kMostRowArrays));
}

std::vector<Tensor> take_rows(std::vector<Tensor> tensors, Tensor index) {
  const char* op = "take_rows";
  check_count(op, tensors.size());
  const Kind type = real_kind(op, "tensors", tensors[0]);
  int64_t fewest = -1;
  for (Tensor& t : tensors) {
    t = checked(op, "tensors", t, {kAny, kAny}, type);
    fewest = fewest < 0 ? t.size(0) : std::min(fewest, t.size(0));
  }
  const Tensor numbers = checked_index(op, index, type, fewest);
  const int64_t m = numbers.size(0);
  std::vector<Tensor> taken;
  for (const Tensor& t : tensors) taken.push_back(empty_like_type(t, {m, t.size(1)}, type));
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    RowArrays<T> arrays;
    for (size_t k = 0; k < tensors.size(); ++k)
      arrays.add(m, tensors[k].size(0), tensors[k].size(1), in<T>(tensors[k]), out<T>(taken[k]));
    device.run(op, arrays.count(), TakeRowsBody<T>{in<int64_t>(numbers), arrays});
  });
  return taken;
}

std::vector<Tensor> put_rows(std::vector<Tensor> tensors, Tensor index, std::vector<int64_t> n_rows) {
  const char* op = "put_rows";
  check_count(op, tensors.size());
  require(n_rows.size() == tensors.size(), op, "n_rows must hold a number for each tensor");
  const Kind type = real_kind(op, "tensors", tensors[0]);
  const int64_t fewest = *std::min_element(n_rows.begin(), n_rows.end());
  require(fewest >= 0, op, "n_rows must not be negative");
  const Tensor numbers = checked_index(op, index, type, fewest);
  const int64_t m = numbers.size(0);
  std::vector<Tensor> sums;
  for (size_t k = 0; k < tensors.size(); ++k) {
    tensors[k] = checked(op, "tensors", tensors[k], {m, kAny}, type);
    sums.push_back(empty_like_type(tensors[k], {n_rows[k], tensors[k].size(1)}, type));
  }
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    RowArrays<T> all, given;
    for (size_t k = 0; k < tensors.size(); ++k) {
      const int64_t columns = tensors[k].size(1);
      all.add(n_rows[k], n_rows[k], columns, nullptr, out<T>(sums[k]));
      given.add(m, n_rows[k], columns, in<T>(tensors[k]), out<T>(sums[k]));
    }
    device.run(op, all.count(), ClearArraysBody<T>{all});
    device.run(op, given.count(), AddRowsBody<T>{in<int64_t>(numbers), given});
  });
  return sums;
}

void clear_unless(std::vector<Tensor> tensors, Tensor kept) {
  const char* op = "clear_unless_";
  check_count(op, tensors.size());
  const Kind type = real_kind(op, "tensors", tensors[0]);
  const Tensor flag = checked(op, "kept", kept, {}, type.with(ScalarType::Bool));
  for (const Tensor& t : tensors) {
    require(t.is_contiguous(), op, "tensors must be contiguous, as they are written to");
    require(t.scalar_type() == type.type && t.device() == type.device, op, "tensors must have one dtype and device");
  }
  on_device(type, [&](auto zero, const auto& device) {
    using T = decltype(zero);
    RowArrays<T> arrays;
    for (Tensor& t : tensors) arrays.add(t.numel(), t.numel(), 1, nullptr, out<T>(t));
    device.run(op, arrays.count(), ClearUnlessBody<T>{in<bool>(flag), {arrays}});
  });
}

}  // namespace

STABLE_TORCH_LIBRARY_FRAGMENT(splitnerf, m) {
  m.def("take_rows(Tensor[] tensors, Tensor index) -> Tensor[]");
  m.def("clear_unless_(Tensor(a!)[] tensors, Tensor kept) -> ()");
  m.def("put_rows(Tensor[] tensors, Tensor index, int[] n_rows) -> Tensor[]");
}

SPLITNERF_IMPLEMENT(m) {
  m.impl("take_rows", TORCH_BOX(&take_rows));
  m.impl("clear_unless_", TORCH_BOX(&clear_unless));
  m.impl("put_rows", TORCH_BOX(&put_rows));
}

}  // namespace splitnerf::glue
