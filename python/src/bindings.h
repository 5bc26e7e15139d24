#pragma once
#include <pybind11/pybind11.h>
#include <string>

namespace lapservo::python {

/// For a port without a trampoline, whose methods C++ calls whatever Python overrides: a class statement that derives
/// from it raises TypeError. `instead`: the ports from which to derive.
inline void refuse_subclasses(pybind11::object port, const std::string& instead) {
  const auto name = port.attr("__name__").cast<std::string>();
  const auto refuse = [=](const pybind11::args&, const pybind11::kwargs&) {
    throw pybind11::type_error("run() would not call the methods of a subclass of " + name + ": subclass " + instead +
                               ", and pass calls on to a " + name);
  };
  port.attr("__init_subclass__") = pybind11::staticmethod(pybind11::cpp_function(refuse));
}

/// The part of the module that each file adds.
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
