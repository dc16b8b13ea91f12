#include "bindings.hpp"

void bind_dynamics(pybind11::module_&) {}
