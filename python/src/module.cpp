#include <exception>

#include "lapservo/core/error.h"
#include "python/src/bindings.h"

namespace py = pybind11;

PYBIND11_MODULE(_lapservo, m) {
  using namespace lapservo::python;
  m.attr("__module__") = "lapservo";  // what help() and pickles name
  m.attr("__version__") = LAPSERVO_VERSION;
  py::register_local_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const lapservo::InputError& e) {
      const py::object type = py::module_::import("lapservo._errors").attr("InputError");
      const py::object error = type(e.what(), e.source(), e.field(), e.value(), e.expectation(), e.problem());
      PyErr_SetObject(type.ptr(), error.ptr());
    } catch (const py::cast_error& e) {  // a value of a type that is not expected
      PyErr_SetString(PyExc_TypeError, e.what());
    }
  });
  bind_rig(m);
  bind_tracker(m);
  bind_table(m);
  bind_marker(m);
  bind_kinematics(m);
  bind_servo(m);
  bind_simulation(m);
  bind_calibration(m);
#ifdef LAPSERVO_ROS2
  bind_ros2(m);
#endif
}
