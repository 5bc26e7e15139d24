#include <filesystem>
#include <memory>
#include <optional>
#include <pybind11/functional.h>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "lapservo/control/paper_trajectory.h"
#include "lapservo/control/trajectory.h"
#include "lapservo/core/error.h"
#include "lapservo/crtk/arm_limits.h"
#include "lapservo/crtk/joint_map.h"
#include "lapservo/robot/robot.h"
#include "lapservo/robot/steady_clock.h"
#include "lapservo/servo/controller_file.h"
#include "lapservo/servo/image_features.h"
#include "lapservo/servo/image_window.h"
#include "lapservo/servo/run.h"
#include "lapservo/tool/wrist.h"
#include "python/src/bindings.h"
#include "python/src/controller.h"
#include "python/src/conversions.h"
#include "python/src/observed.h"
#include "python/src/python_frames.h"
#include "python/src/running.h"

namespace lapservo::python {
namespace {

Blocked blocked_of(const std::string& word) {
  if (const auto blocked = blocked_from_string(word)) return *blocked;
  throw InputError("JointState", "blocked", word, "none or a reason of docs/statuses.md, for example busy");
}

OperatingState operating_state_of(const std::string& word) {
  if (const auto state = operating_state_from_string(word)) return *state;
  throw InputError("JointState", "operating_state", word, "DISABLED, ENABLED, PAUSED or FAULT");
}

// Converts so many items of a Python method's result.
py::sequence sequence_of(const py::object& given, std::size_t size, const char* method, const char* expected) {
  if (!py::isinstance<py::sequence>(given) || py::len(given) != size)
    throw InputError(method, "value", py::str(py::type::of(given)).cast<std::string>(), expected);
  return py::reinterpret_borrow<py::sequence>(given);
}

// The result of a Python method. For one of another type, pybind's own message does not name the method.
template <typename Ask>
auto given_by(const char* method, const char* expected, const Ask& ask) {
  try {
    return ask();
  } catch (const py::builtin_exception&) {
    throw InputError(method, std::string("gives another type, expected ") + expected);
  }
}

// The ports, implemented in Python.
class PythonRobot : public Robot {
 public:
  JointState state() override {
    const Asking loop;
    return given_by("Robot.state()", "lapservo.JointState",
                    [&]() -> JointState { PYBIND11_OVERRIDE_PURE(JointState, Robot, state); });
  }
  std::vector<JointReading> readings() override {
    const py::gil_scoped_acquire mine;
    const py::function method = py::get_override(static_cast<const Robot*>(this), "readings");
    if (!method) return Robot::readings();
    const Asking loop;
    using Time = Number<"Robot.readings()", Numbers::any>;
    using Reading = Array<"Robot.readings()", 4, 1, Numbers::any>;
    std::vector<JointReading> readings;
    const auto given = given_by("Robot.readings()", "[(time_s, q), ...]",
                                [&] { return method().cast<std::vector<std::pair<Time, Reading>>>(); });
    for (const auto& [time_s, q] : given) readings.push_back({time_s.value, JointVector::from_vector(q.value)});
    return readings;
  }
  void send(const JointPath& path) override { PYBIND11_OVERRIDE_PURE(void, Robot, send, path); }
  void release() override { PYBIND11_OVERRIDE(void, Robot, release); }
  bool is_simulated() const override { PYBIND11_OVERRIDE(bool, Robot, is_simulated); }

 private:
  struct Asking {
    bool before = std::exchange(loop_asks, true);
    ~Asking() { loop_asks = before; }
  };
};

class PythonClock : public Clock {
 public:
  double now_s() const override {
    return given_by("Clock.now_s()", "seconds", [&]() -> double { PYBIND11_OVERRIDE_PURE(double, Clock, now_s); });
  }
  double suspended_s() const override { PYBIND11_OVERRIDE(double, Clock, suspended_s); }
  void sleep_until(double time_s) override { PYBIND11_OVERRIDE_PURE(void, Clock, sleep_until, time_s); }
};

// newest() gives (time_s, image) or None. The image is copied: the array may be written to again.
class PythonImageStream : public ImageStream {
 public:
  std::optional<StampedImage> newest() override {
    const py::gil_scoped_acquire mine;
    const py::function method = py::get_override(static_cast<const ImageStream*>(this), "newest");
    if (!method) throw py::type_error("ImageStream.newest() is not implemented");
    const py::object given = method();
    if (given.is_none()) return std::nullopt;
    const auto pair = sequence_of(given, 2, "ImageStream.newest()", "(time_s, uint8[H, W, 3]) or None");
    return StampedImage{number_of(pair[0], "ImageStream.newest()", Numbers::any),
                        view_of(pair[1], "ImageStream.newest()").clone()};
  }
  bool take_second_sender() override { PYBIND11_OVERRIDE(bool, ImageStream, take_second_sender); }
};

void bind_ports(py::module_& m) {
  py::class_<JointState>(m, "JointState", "State of an arm.")
      .def(py::init([](const Number<"time_s", Numbers::any>& time_s, const Array<"q", 4, 1, Numbers::any>& q,
                       const std::string& operating_state, bool follows, bool started, const std::string& blocked,
                       const std::vector<double>& wrist_rad) {
             return JointState{.time_s = time_s.value,
                               .q = JointVector::from_vector(q.value),
                               .operating_state = operating_state_of(operating_state),
                               .follows = follows,
                               .started = started,
                               .blocked = blocked_of(blocked),
                               .wrist_rad = wrist_rad};
           }),
           py::arg("time_s"), py::arg("q"), py::arg("operating_state") = "ENABLED", py::arg("follows") = true,
           py::arg("started") = false, py::arg("blocked") = "none", py::arg("wrist_rad") = std::vector<double>(),
           "time_s: when the joints were read, on the loop's clock; q: float[4], theta, phi [rad], rho [m], psi [rad]; "
           "operating_state: CRTK's word; follows: False where nothing that is sent moves the arm, and the loop only "
           "says what it would do; started: the operator has said start since the last state, which a held loop waits "
           "for; blocked: why else the arm must not be moved, for example 'busy' or 'not_homed'; wrist_rad: readings "
           "of the instrument's wrist_joints, in their order, without which its tip is not known.")
      .def_readonly("time_s", &JointState::time_s)
      .def_property_readonly("q", read_only<JointState>([](const JointState& self) { return self.q.vector(); }),
                             "float[4]")
      .def_property_readonly("operating_state",
                             [](const JointState& self) { return std::string(to_string(self.operating_state)); })
      .def_readonly("follows", &JointState::follows)
      .def_readonly("started", &JointState::started)
      .def_property_readonly("blocked", [](const JointState& self) { return std::string(to_string(self.blocked)); })
      .def_property_readonly("wrist_rad", read_only<JointState>(&JointState::wrist_rad),
                             "tuple[float]; empty where the arm does not measure them");

  py::class_<JointPath>(m, "JointPath",
                        R"(Setpoints over time. Where no newer path comes it brakes to rest by itself.)")
      .def("copy", [](const JointPath& self) { return JointPath(self); })
      .def(
          "at",
          [](const JointPath& self, const Number<"time_s", Numbers::any>& time_s) {
            const MotionState state = self.at(time_s.value);
            return std::pair(state.position, state.velocity);
          },
          py::arg("time_s"), "(float[4] positions, float[4] velocities) at a time of the loop's clock.");

  py::class_<Robot, PythonRobot>(m, "Robot", R"(The port to an arm: subclass it.

The calls come from the loop's thread once a control tick and must return at once. An arm samples the last path at its
own rate, and forgets it as soon as it is not enabled.)")
      .def(py::init<>())
      .def("state", &Robot::state, py::call_guard<py::gil_scoped_release>(), "JointState: the latest reading.")
      .def(
          "readings", [](Robot& self) { return pairs_of(unlocked([&] { return self.readings(); })); },
          "list of (time_s, float[4]): of the joints, all since the last call, for an arm that reads them more often "
          "than the loop calls it. May be left out.")
      .def("send", &Robot::send, py::arg("path"), py::call_guard<py::gil_scoped_release>(),
           "Follow this JointPath from now on; it is yours.")
      .def("release", &Robot::release, py::call_guard<py::gil_scoped_release>(),
           "Until the next send() hands or teleoperation may move the arm: it is held. May be left out.")
      .def("is_simulated", &Robot::is_simulated, py::call_guard<py::gil_scoped_release>(),
           "True for an arm that exists in this program only: starts count at once. May be left out.");
  py::class_<ImageStream, PythonImageStream>(m, "ImageStream", "The port to a camera: subclass it.")
      .def(py::init<>())
      .def(
          "newest",
          [](ImageStream& self) -> std::optional<std::pair<double, Image>> {
            const auto image = unlocked([&] { return self.newest(); });
            if (!image) return std::nullopt;
            return std::pair(image->time_s, array_of(image->bgr));
          },
          R"((time_s, uint8[H, W, 3]) that came since the last call, or None. Must not block: with own_thread
it is called up to 2000 times a second.

time_s, on the loop's clock: of the exposure where it is known (then set the controller's delay_s to 0), else of the
arrival.)")
      .def("take_second_sender", &ImageStream::take_second_sender, py::call_guard<py::gil_scoped_release>(),
           "True once when another camera's images come beside this one's, or after them: the loop holds until a "
           "start. May be left out, but for a camera that passes another one's images on.");
  py::class_<Clock, PythonClock>(m, "Clock", "The loop's time: subclass it, or take SteadyClock.")
      .def(py::init<>())
      .def("now_s", &Clock::now_s, py::call_guard<py::gil_scoped_release>(), "Seconds; never backwards.")
      .def("suspended_s", &Clock::suspended_s, py::call_guard<py::gil_scoped_release>(),
           "At least so many seconds now_s() has left out so far because the computer was suspended, after which the "
           "loop holds until a start. May be left out, but for a clock that passes another one's time on.")
      .def("sleep_until", &Clock::sleep_until, py::arg("time_s"), py::call_guard<py::gil_scoped_release>(),
           "Returns at that time, or at once when it has passed.");
  refuse_subclasses(
      py::class_<SteadyClock, Clock>(m, "SteadyClock", "The computer's monotonic clock.").def(py::init<>()), "Clock");
}

DesiredFeatures desired_of(const py::object& given) {
  const auto all = sequence_of(given, 3, "Trajectory.at()", "(features, rates, accelerations), each float[4]");
  const auto four = [&](std::size_t i) -> Eigen::Vector4d {
    return numbers_of(all[i], "Trajectory.at()", 4, 1, Numbers::any);
  };
  return {four(0), four(1), four(2)};
}

// A Python function may be called and let go by any thread.
Trajectory trajectory_of(double duration_s, py::function at) {
  const auto held = std::shared_ptr<py::function>(new py::function(std::move(at)), [](py::function* function) {
    const py::gil_scoped_acquire mine;
    delete function;
  });
  return {duration_s, [held](double time_s) {
            const py::gil_scoped_acquire mine;
            return desired_of((*held)(time_s));
          }};
}

void bind_trajectories(py::module_& m) {
  py::class_<Trajectory>(m, "Trajectory", "Desired features s [rad], r, l, d [px] over time.")
      .def(py::init(&trajectory_of), py::arg("duration_s"), py::arg("at"),
           "at(time_s) gives (features, rates, accelerations), each float[4]; duration_s 0: endless.")
      .def_readonly("duration_s", &Trajectory::duration_s)
      .def(
          "at",
          [](const Trajectory& self, const Number<"time_s", Numbers::any>& time_s) {
            const DesiredFeatures desired = self.at(time_s.value);
            return std::tuple(desired.features, desired.rate, desired.acceleration);
          },
          py::arg("time_s"), "(features, rates, accelerations), each float[4].");
  m.def(
      "set_point", [](const Array<"features", 4>& features) { return set_point(features.value); }, py::arg("features"),
      "Trajectory that stays at float[4].");
  m.def(
      "paper_trajectory", [] { return sinusoids(paper_sinusoids()); }, "Section V-D's.");
  m.def(
      "sinusoids",
      [](const Array<"offset", 4>& offset, const Array<"amplitude", 4>& amplitude,
         const Array<"omega_rad_s", 4>& omega_rad_s, const Array<"phase_rad", 4>& phase_rad) {
        return sinusoids({offset.value, amplitude.value, omega_rad_s.value, phase_rad.value});
      },
      py::arg("offset"), py::arg("amplitude"), py::arg("omega_rad_s"),
      py::arg("phase_rad") = Eigen::Vector4d(Eigen::Vector4d::Zero()), "offset + amplitude sin(omega t + phase).");
  m.def(
      "via_points",
      [](const Array<"points", Eigen::Dynamic, 4>& points, const Array<"max_rate", 4>& max_rate, double dwell_s) {
        return via_points(rows_of(points.value), max_rate.value, dwell_s);
      },
      py::arg("points"), py::arg("max_rate"), py::arg("dwell_s") = 0.0,
      "From point to point, at rest in each, by minimum-jerk motions within max_rate.");
  m.def(
      "load_trajectory", [](const std::filesystem::path& path) { return trajectory_from_csv(path); }, py::arg("path"),
      "A spline through a CSV's rows of time_s,s_rad,r_px,l_px,d_px.");
}

JointLimits joint_limits_of(const py::object& given, const Rig& rig) {
  if (is_path(given)) {
    const auto& joints = rig.instruments.front().joints;
    if (!joints)
      throw InputError("Controller", "rig", "without joints", "the arm's joints, with a file of joint_limits");
    return internal::limits_of_q(*joints, internal::load_arm_limits(given.cast<std::filesystem::path>()));
  }
  if (!py::isinstance<py::sequence>(given) || py::len(given) != 4)
    throw InputError("joint_limits", "a path, or lower, upper, rate and acceleration of q, expected float[4] each");
  const py::sequence rows = given;
  const auto row = [&](py::ssize_t i) { return Array<"joint_limits", 4>::of(rows[static_cast<std::size_t>(i)]).value; };
  return {row(0), row(1), row(2), row(3)};
}

Controller make_controller(const Rig& rig, const std::string& mode, const std::optional<std::filesystem::path>& path,
                           double period_s, const std::optional<Array<"gains_per_s", 4>>& gains_per_s,
                           const std::optional<double>& delay_s, double window_margin_px,
                           const std::optional<py::object>& joint_limits) {
  const auto known = control_mode_from_string(mode);
  if (!known) throw InputError("Controller", "mode", mode, "default, fused, paper or uncalibrated");
  ControllerConfig config = *known == ControlMode::paper ? paper_controller(period_s) : ControllerConfig{};
  config.mode = *known;
  config.period_s = period_s;
  config.window = image_window(rig.camera, window_margin_px);
  if (gains_per_s) config.gains.per_s = gains_per_s->value;
  if (delay_s) config.observer.delay_s = *delay_s;
  std::optional<JointLimits> of_arm;
  if (joint_limits) of_arm = joint_limits_of(*joint_limits, rig);
  return {controller_for_arm(config, path, of_arm), of_arm.has_value(), rig.camera, rig.instruments.front().joints};
}

// A tick as Python keeps it.
struct Tick {
  ControlTick tick;
  std::shared_ptr<const Rig> rig;
  const ControlStep& step() const { return tick.decision.control; }
  /// That of the image that came: after the endoscope moved with another camera_from_rcm, or without.
  std::shared_ptr<const Rig> rig_seen_by() const {
    if (tick.decision.registration == 0 && tick.seen->measurement.registration == 0) return rig;
    auto moved = std::make_shared<Rig>(*rig);
    const bool current = tick.seen->measurement.registration == tick.decision.registration;
    moved->instruments.front().camera_from_rcm = current ? tick.decision.camera_from_rcm : std::nullopt;
    if (current) moved->instruments.front().registration_covariance = tick.decision.registration_covariance;
    return moved;
  }
};

class PythonObserver : public RunObserver {
 public:
  PythonObserver(py::object on_tick, std::shared_ptr<const Rig> rig, const Running& running)
      : on_tick_(std::move(on_tick)), rig_(std::move(rig)), running_(running) {}
  // False ends the run; so does Ctrl-C.
  bool on_tick(const ControlTick& tick) override {
    const py::gil_scoped_acquire mine;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (running_.is_to_end()) return false;
    if (on_tick_.is_none()) return true;
    const py::object answer = on_tick_(Tick{tick, rig_});
    return answer.is_none() || answer.cast<bool>();
  }

 private:
  py::object on_tick_;
  std::shared_ptr<const Rig> rig_;
  const Running& running_;
};

// A member of the estimate for now; None without one.
template <typename Member>
auto of_estimate(Member member) {
  return read_only<Tick>([member](const Tick& self) {
    const auto& estimate = self.step().estimate;
    return estimate ? std::optional(*estimate.*member) : std::nullopt;
  });
}

void bind_tick(py::module_& m) {
  py::class_<Tick>(m, "ControlTick", "One control tick: what the loop went by and what it decided.")
      .def_property_readonly("time_s", [](const Tick& self) { return self.tick.input.time_s; })
      .def_property_readonly(
          "joints", [](const Tick& self) { return self.tick.input.joints; }, "JointState")
      .def_property_readonly("desired",
                             read_only<Tick>([](const Tick& self) { return self.tick.input.desired.features; }),
                             "float[4]: s, r, l, d")
      .def_property_readonly(
          "action", [](const Tick& self) { return std::string(to_string(self.step().action)); },
          "'track', 'probe' or 'hold'")
      .def_property_readonly(
          "hold_reason", [](const Tick& self) { return std::string(to_string(self.step().reason)); },
          "'none' unless it holds")
      .def_property_readonly("error", read_only<Tick>([](const Tick& self) {
                               return self.step().estimate ? std::optional(self.step().error) : std::nullopt;
                             }),
                             "float[4]: estimated features less the desired ones; None without an estimate")
      .def_property_readonly("features", of_estimate(&Estimate::features),
                             "float[4]: estimated for now; None without an estimate")
      .def_property_readonly("q", of_estimate(&Estimate::q), "float[4]: estimated for now; None without an estimate")
      .def_property_readonly("velocity", read_only<Tick>([](const Tick& self) { return self.step().velocity; }),
                             "float[4], of the joints: rad/s, m/s")
      .def_property_readonly(
          "delay_s", [](const Tick& self) { return self.step().delay_s; }, "of the images, estimated")
      .def_property_readonly("registration_contradicted",
                             [](const Tick& self) { return self.tick.decision.registration_contradicted; })
      .def_property_readonly(
          "remedy", [](const Tick& self) { return self.tick.decision.remedy; },
          "The fault and its remedy, where a person has to act; else empty")
      .def_property_readonly("sent", [](const Tick& self) { return self.tick.decision.send; })
      .def_property_readonly(
          "image", read_only<Tick>([](const Tick& self) -> std::optional<Image> {
            if (!self.tick.seen) return std::nullopt;
            return array_of(self.tick.seen->image.bgr);
          }),
          "uint8[H, W, 3] that came since the tick before, or None. It can't be written: the loop compares the next "
          "image with it, so draw in a copy. A tick that is kept keeps it")
      .def_property_readonly("observations", read_only<Tick>([](const Tick& self) {
                               if (!self.tick.seen) return std::vector<Observed>{};
                               return observed(self.tick.seen->observations, self.rig_seen_by(),
                                               self.tick.seen->image.time_s);
                             }),
                             "tuple[Observation] of that image");
}

void run_loop(Robot& robot, ImageStream& images, Clock& clock, const std::shared_ptr<Rig>& rig,
              const Trajectory& trajectory, double duration_s, const std::optional<Controller>& controller,
              const std::optional<Array<"rcm_px", 2>>& rcm_px, bool own_thread, py::object on_tick) {
  const Instrument& steered = rig->instruments.front();
  if (const auto* arm = dynamic_cast<const ArmOf*>(&robot)) {
    const Instrument& moved = arm->instrument;
    if (moved.name != steered.name)
      throw InputError("run", "rig.instruments[0]", steered.name, moved.name + ", which the robot moves");
    if (moved.joints != steered.joints || internal::wrist_names(moved.tool) != internal::wrist_names(steered.tool))
      throw InputError("run", "rig.instruments[0].joints", "others",
                       "those by which the robot reads its arm: make the robot of this rig");
  }
  RunConfig config;
  config.rig = *rig;
  const Controller used =
      controller ? *controller : make_controller(*rig, "fused", {}, ControllerConfig{}.period_s, {}, {}, 20, {});
  used.expect_own(*rig, "run");
  config.controller = used;
  if (used.has_joint_limits) config.arm_limits = used.limits;
  if (used.mode == ControlMode::uncalibrated) {
    config.rcm_px = rcm_px ? std::optional(rcm_px->value) : rcm_image_px(config.rig, {});
    if (!config.rcm_px)
      throw InputError("run", "rcm_px", "None",
                       "the RCM's image, of a rig without camera_from_rcm: see estimate_rcm()");
    config.rig.instruments.front().camera_from_rcm.reset();
  } else if (rcm_px) {
    throw InputError("run", "rcm_px", "given", "None, or a controller of mode 'uncalibrated'");
  }
  config.tracking_thread = own_thread ? TrackingThread::own : TrackingThread::callers;
  if (config.controller.mode == ControlMode::paper) config.tracker.method = Method::centerline;
  const Running running(robot, images);
  PythonObserver observer(std::move(on_tick), std::make_shared<const Rig>(config.rig), running);
  const py::gil_scoped_release others_run;
  run(robot, images, clock, config, trajectory, duration_s, observer);
}

}  // namespace

void bind_servo(py::module_& m) {
  bind_ports(m);
  bind_trajectories(m);
  py::class_<Controller>(m, "Controller", "How a loop steers the rig of which it is made.")
      .def(py::init(&make_controller), py::arg("rig"), py::kw_only(), py::arg("mode") = "fused",
           py::arg("path") = py::none(), py::arg("period_s") = ControllerConfig{}.period_s,
           py::arg("gains_per_s") = py::none(), py::arg("delay_s") = py::none(), py::arg("window_margin_px") = 20.0,
           py::arg("joint_limits") = py::none(),
           "mode: 'fused', 'paper' or 'uncalibrated'; path: a controller.yaml, read over the rest; delay_s: known, "
           "else estimated; joint_limits: the path of a file of the arm's, as configs/joint_limits/psm-classic.yaml, "
           "or lower, upper, rate and acceleration of q, float[4] each, in rad and m.")
      .def_property_readonly("mode", [](const Controller& self) { return std::string(to_string(self.mode)); })
      .def_property_readonly("period_s", [](const Controller& self) { return self.period_s; })
      .def(
          "to_yaml", [](const Controller& self) { return controller_yaml(self); }, "Its text as a controller.yaml.")
      .def("__repr__", [](const Controller& self) {
        return fmt::format("<lapservo.Controller {} every {:.4f} s>", to_string(self.mode), self.period_s);
      });
  bind_tick(m);
  m.def("run", &run_loop, py::arg("robot"), py::arg("images"), py::arg("clock"), py::arg("rig"), py::arg("trajectory"),
        py::arg("duration_s"), py::kw_only(), py::arg("controller") = py::none(), py::arg("rcm_px") = py::none(),
        py::arg("own_thread") = false, py::arg("on_tick") = py::none(),
        R"(The servo loop: reads the joints, measures, decides, sends, then calls on_tick, once every period.

It holds by itself, within the tick, on a missing or stale image, a lost marker, an outlier or numbers that are not
finite, and goes on when all is well again within 2 s. After anything else, above all an arm that was not enabled, it
holds until JointState.started; this call is the first start, and counts when the arm has been ready for 0.5 s.
Where Robot.is_simulated() is False, the controller needs joint_limits.
rcm_px: float[2], the RCM's image in ideal pixels, for mode 'uncalibrated' only, which uses no camera_from_rcm but for
the default of rcm_px.
own_thread: vision in a thread of its own, so that setpoints never wait for it (for real arms). on_tick(ControlTick) may
return False, which ends the run. However it ends, also by Ctrl-C, SIGTERM or SIGHUP, the arm brakes to rest. A run in
another thread than the main one ends with the main thread, not by Ctrl-C. One robot or camera is in one run at a time.

InputError before anything moves: a trajectory that no image shows or that, with camera_from_rcm, can't be followed from
the arm's joints by reach, limits or the image's window; missing joint_limits; joints or images ahead of the clock.)");
}

}  // namespace lapservo::python
