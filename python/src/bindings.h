#pragma once
#include <pybind11/pybind11.h>

/// The part of the module that each file adds.
namespace lapservo::python {
void bind_rig(pybind11::module_& m);
void bind_tracker(pybind11::module_& m);
void bind_table(pybind11::module_& m);
void bind_marker(pybind11::module_& m);
void bind_kinematics(pybind11::module_& m);
void bind_servo(pybind11::module_& m);
void bind_ros2(pybind11::module_& m);
void bind_simulation(pybind11::module_& m);
void bind_calibration(pybind11::module_& m);
}  // namespace lapservo::python
