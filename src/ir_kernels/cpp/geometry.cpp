#include "bindings.hpp"

void bind_geometry(pybind11::module_&) {}
