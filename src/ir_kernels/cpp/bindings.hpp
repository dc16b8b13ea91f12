// What each source file offers to module.cpp.
//
// Both builds of the module can be imported by one process, so a bound class needs py::module_local().
// Functions take their arrays as py::array_t<double, py::array::c_style | py::array::forcecast>, check shapes,
// then release the GIL around the loop; what Python sees as checked is done in the Python module that calls them.
#pragma once

#include <pybind11/pybind11.h>

void bind_geometry(pybind11::module_& m);
void bind_dynamics(pybind11::module_& m);
void bind_inverse_kinematics(pybind11::module_& m);
void bind_spline(pybind11::module_& m);
void bind_search(pybind11::module_& m);
void bind_portable(pybind11::module_& m);
void bind_surfaces(pybind11::module_& m);
