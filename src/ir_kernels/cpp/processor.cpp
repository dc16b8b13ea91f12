// A module of its own that runs on any processor: may the native build be loaded on this one?
// Plain C interface of Python: this module is compiled for two functions.
#include <Python.h>

#include <algorithm>
#include <string_view>

namespace {

// Whether this processor has all that `features` (comma separated) names; an unknown name counts as missing.
bool cpu_supports_all(std::string_view features) {
  while (!features.empty()) {
    const std::string_view name = features.substr(0, features.find(','));
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
    features.remove_prefix(std::min(name.size() + 1, features.size()));
  }
  return true;
}

PyObject* native_runs_here(PyObject*, PyObject*) { return PyBool_FromLong(cpu_supports_all(IR_NATIVE_FEATURES)); }

PyMethodDef functions[] = {
    {"native_runs_here", native_runs_here, METH_NOARGS, "Whether this processor has all that the native build needs."},
    {nullptr, nullptr, 0, nullptr},
};
PyModuleDef module = {
    PyModuleDef_HEAD_INIT,
    "_processor",
    "Which instructions the native build needs, and whether this processor has them.",
    -1,
    functions,
    nullptr,
    nullptr,
    nullptr,
    nullptr,
};

}  // namespace

PyMODINIT_FUNC PyInit__processor() {
  PyObject* created = PyModule_Create(&module);
  if (created != nullptr && PyModule_AddStringConstant(created, "native_features", IR_NATIVE_FEATURES) < 0)
    Py_CLEAR(created);
  return created;
}
