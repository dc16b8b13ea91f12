// Arrays as the bindings take and give them, and the check of what has not been checked in Python.
#pragma once

#include <pybind11/numpy.h>

#include <cstdint>
#include <stdexcept>
#include <vector>

namespace ir {

using Array = pybind11::array_t<double, pybind11::array::c_style | pybind11::array::forcecast>;
using Indices = pybind11::array_t<std::int64_t, pybind11::array::c_style | pybind11::array::forcecast>;

inline void expect(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(what);
}

inline Array empty(std::initializer_list<pybind11::ssize_t> shape) {
  return Array(std::vector<pybind11::ssize_t>(shape));
}

// The numbers of an attribute, whatever its shape.
inline std::vector<double> flat(const pybind11::object& data, const char* name) {
  const Array array = data.attr(name).cast<Array>();
  return {array.data(), array.data() + array.size()};
}

}  // namespace ir
