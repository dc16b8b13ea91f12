// A module of its own that runs on any processor: may the native build be loaded on this one?
#include <pybind11/pybind11.h>

#include <string>

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

}  // namespace

PYBIND11_MODULE(_processor, m) {
  m.doc() = "Which instructions the native build needs, and whether this processor has them.";
  m.def("native_runs_here", [] { return cpu_supports_all(IR_NATIVE_FEATURES); });
  m.attr("native_features") = IR_NATIVE_FEATURES;
}
