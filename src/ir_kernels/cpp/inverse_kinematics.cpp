#include "bindings.hpp"

void bind_inverse_kinematics(pybind11::module_&) {}
