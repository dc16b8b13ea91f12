// The one extension module: every .cpp file registers its functions here. No state, nothing but batch functions.
#include <pybind11/numpy.h>

#include "bindings.hpp"
#include "lanes.hpp"

namespace {

// C-contiguous values; 0 x is 0 for finite x alone
bool all_finite(const pybind11::array_t<double, pybind11::array::c_style>& values) {
  const double* x = values.data();
  const pybind11::ssize_t count = values.size();
  ir::Double8 sum[4] = {};  // four, that don't wait for each other
  pybind11::ssize_t k = 0;
  for (; k + 32 <= count; k += 32)
    for (int i = 0; i < 4; ++i) sum[i] += ir::load<ir::Double8>(x + k + 8 * i) * 0.0;
  double rest = 0.0;
  for (; k < count; ++k) rest += x[k] * 0.0;
  return !ir::any(sum[0] + sum[1] + (sum[2] + sum[3]) != 0.0) && rest == 0.0;
}

}  // namespace

PYBIND11_MODULE(IR_MODULE, m) {
  m.doc() = "Batch functions over arrays; see the Python modules of ir_kernels for what is promised.";
  m.def("all_finite", &all_finite);
  bind_geometry(m);
  bind_dynamics(m);
  bind_inverse_kinematics(m);
  bind_spline(m);
  bind_search(m);
  bind_portable(m);
  bind_surfaces(m);
}
