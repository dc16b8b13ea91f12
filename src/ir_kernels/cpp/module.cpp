// The one extension module: every .cpp file registers its functions here. No state, nothing but batch functions.
#include <pybind11/numpy.h>

#include <cstring>
#include <string>

#include "bindings.hpp"
#include "lanes.hpp"

namespace {

// Whether this processor has all that `features` (comma separated) names; an unknown name counts as missing.
bool cpu_supports_all(const std::string& features) {
  std::size_t begin = 0;
  while (begin < features.size()) {
    std::size_t end = features.find(',', begin);
    if (end == std::string::npos) end = features.size();
    const std::string name = features.substr(begin, end - begin);
    bool supported = false;
#if defined(__x86_64__)
#define IR_FEATURE(text) \
  if (name == text) supported = __builtin_cpu_supports(text);
    IR_FEATURE("popcnt") IR_FEATURE("sse3") IR_FEATURE("ssse3") IR_FEATURE("sse4.1") IR_FEATURE("sse4.2")
    IR_FEATURE("sse4a") IR_FEATURE("avx") IR_FEATURE("fma") IR_FEATURE("fma4") IR_FEATURE("xop") IR_FEATURE("bmi")
    IR_FEATURE("bmi2") IR_FEATURE("avx2") IR_FEATURE("avx512f") IR_FEATURE("avx512dq") IR_FEATURE("avx512cd")
    IR_FEATURE("avx512bw") IR_FEATURE("avx512vl") IR_FEATURE("avx512ifma") IR_FEATURE("avx512vbmi")
    IR_FEATURE("avx512vbmi2") IR_FEATURE("avx512vnni") IR_FEATURE("avx512bitalg") IR_FEATURE("avx512vpopcntdq")
#undef IR_FEATURE
#endif
    if (!supported) return false;
    begin = end + 1;
  }
  return true;
}

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
  // Asked of the baseline build, which runs anywhere: may the native build of the same set-up be loaded here?
  m.def("native_runs_here", [] { return cpu_supports_all(IR_NATIVE_FEATURES); });
  m.attr("native_features") = IR_NATIVE_FEATURES;
  m.def("all_finite", &all_finite);
  bind_geometry(m);
  bind_dynamics(m);
  bind_inverse_kinematics(m);
  bind_spline(m);
  bind_search(m);
}
