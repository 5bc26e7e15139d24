#pragma once
#include <pybind11/pybind11.h>
#include <set>

#include "lapservo/robot/robot.h"
#include "lapservo/stream/image_stream.h"

namespace lapservo::python {

/// A run() that goes on, in any thread. Robot and images are its own meanwhile. SIGTERM and SIGHUP that would end the
/// process at once end all runs first, and count after their brakes; a second one ends the process at once. The
/// process's end waits for runs of other threads, which then end, too. All calls need Python's lock.
class Running {
 public:
  /// Throws InputError for a robot or images of another run.
  Running(const Robot& robot, const ImageStream& images);
  ~Running();
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;
  /// Whether the process ends, or the main thread has ended.
  bool is_to_end() const;

 private:
  std::set<const void*> ports_;
  pybind11::object main_thread_;  ///< none: this is it
};

}  // namespace lapservo::python
