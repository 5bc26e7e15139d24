#include <chrono>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "lapservo/core/error.h"
#include "lapservo/crtk/crtk_arm.h"
#include "lapservo/crtk/crtk_robot.h"
#include "lapservo/crtk/image_decoder.h"
#include "lapservo/crtk/image_receiver.h"
#include "lapservo/rig/rig.h"
#include "lapservo/robot/operating_state.h"
#include "lapservo/robot/steady_clock.h"
#include "python/src/bindings.h"
#include "python/src/controller.h"
#include "python/src/conversions.h"
#include "transports/ros2/ros2_transport.h"

namespace lapservo::python {
namespace {
using namespace internal;

// A node, destroyed after what speaks by it.
struct Node {
  explicit Node(const char* name = "lapservo") : transport(name) {}
  Ros2Transport transport;
};

class Ros2Robot : private Node, public CrtkRobot, public ArmOf {
 public:
  Ros2Robot(const std::string& arm, const Instrument& steered, const InterlockConfig& interlock, const Clock& clock)
      : CrtkRobot(transport, arm, interlock, clock), ArmOf{steered} {}
};

class Ros2Camera : private Node, public ImageStream {
 public:
  Ros2Camera(const std::string& topic, const Camera& camera, const Clock& clock)
      : receiver_(camera.width_px, camera.height_px) {
    const auto sink = [this, &clock](auto&& message) { receiver_.receive(std::move(message), clock.now_s()); };
    subscription_ = topic.ends_with("/compressed") ? transport.subscribe<CompressedImageMessage>(topic, sink)
                                                   : transport.subscribe<ImageMessage>(topic, sink);
  }
  std::optional<StampedImage> newest() override { return receiver_.newest(); }
  bool take_second_sender() override { return receiver_.take_second_sender(); }
  std::string dropped() const { return receiver_.counts().text(); }
  std::string complaint() const { return receiver_.complaint(); }

 private:
  ImageReceiver receiver_;
  Transport::Subscription subscription_;  // last: it uses the receiver
};

class Ros2Arm : private Node, public CrtkArm {
 public:
  Ros2Arm(const std::string& arm, std::vector<std::string> joint_names)
      : Node("lapservo_arm"), CrtkArm(transport, arm, std::move(joint_names)) {}

  void publish(const Eigen::VectorXd& measured, const Eigen::VectorXd& setpoint, const std::string& state,
               bool is_homed, bool is_busy) {
    if (!operating_state_from_string(state))
      throw InputError("Ros2Arm.publish", "operating_state", state, "DISABLED, ENABLED, PAUSED or FAULT");
    say_joints(joints({measured.begin(), measured.end()}), joints({setpoint.begin(), setpoint.end()}));
    say_state({0, state, is_homed, is_busy});
  }
};

class Ros2ImagePublisher : private Node {
 public:
  explicit Ros2ImagePublisher(const std::string& topic)
      : Node("lapservo_images"), publisher_(transport.publisher<ImageMessage>(topic)) {}

  void publish(const cv::Mat& bgr, const std::optional<double>& time_s) {
    constexpr double last_s = 2147483647;  // a stamp's
    if (time_s && !(*time_s >= 0 && *time_s <= last_s))
      throw InputError("Ros2ImagePublisher.publish", "time_s", fmt::format("{}", *time_s), "seconds since 1970");
    publisher_(bgr8_message(bgr, time_s.value_or(transport.stamp_now_s())));
  }

 private:
  Transport::Publisher<ImageMessage> publisher_;
};

// Until the arm's joints are known, so that run() knows where a trajectory begins.
void wait_for_joints(Ros2Robot& robot, const std::string& arm, double wait_s) {
  if (!(wait_s >= 0)) throw InputError("Ros2Robot", "wait_s", fmt::format("{}", wait_s), "0 or more seconds");
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(wait_s);
  while (!(robot.state().time_s > 0)) {
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (std::chrono::steady_clock::now() >= end)
      throw InputError("Ros2Robot",
                       fmt::format("no {} with the rig's joints within {:g} s", topic_of(arm, "measured_js"), wait_s));
    const py::gil_scoped_release others_run;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

std::unique_ptr<Ros2Robot> make_robot(const std::string& arm, const Rig& rig, const Controller& controller,
                                      const SteadyClock& clock, bool enable_motion, std::size_t setpoint_readers,
                                      double wait_s, const std::optional<std::string>& name) {
  const Instrument& instrument = rig.instruments.front();  // run() steers it; another arm's would move the wrong joints
  if (const std::string wanted = name.value_or(instrument_of(arm)); instrument.name != wanted)
    throw InputError(
        "Ros2Robot", "rig.instruments[0]", instrument.name,
        fmt::format("{}, or instrument='{}' where that is the arm's name in the rig", wanted, instrument.name));
  if (!instrument.joints)
    throw InputError("Ros2Robot", "rig", "without joints", "the arm's joints: names, sign, offset");
  controller.expect_own(rig, "Ros2Robot");
  auto robot = std::make_unique<Ros2Robot>(
      arm, instrument, interlock_of(instrument, controller.limits, enable_motion, setpoint_readers), clock);
  wait_for_joints(*robot, arm, wait_s);
  return robot;
}

void bind_loop_side(py::module_& m) {
  py::class_<Ros2Robot, Robot> robot(m, "Ros2Robot", R"(A CRTK arm over ROS 2, behind the interlock of `lapservo servo`.

ROS need not be installed. A thread of its own samples the last path 500 times a second; when anything is amiss nothing
is sent.)");
  robot
      .def(py::init(&make_robot), py::arg("arm"), py::arg("rig"), py::arg("controller"), py::arg("clock"),
           py::kw_only(), py::arg("enable_motion") = false, py::arg("setpoint_readers") = 1, py::arg("wait_s") = 15.0,
           py::arg("instrument") = py::none(), py::keep_alive<1, 5>(),
           "arm: its namespace, 'PSM1'; rig: with the arm's joints, whose first instrument has the arm's name, or that "
           "of `instrument`; controller: of this rig, whose limits no setpoint exceeds, of joint_limits; "
           "enable_motion: else nothing is sent; setpoint_readers: nodes that may read servo_jp, the arm's and others; "
           "wait_s: for the arm's joints, without which InputError is raised.")
      .def(
          "state", [](Ros2Robot& self) { return unlocked([&] { return loop_asks ? self.state() : self.latest(); }); },
          "JointState as it is now, in any thread. A short fault is reported to run() alone, also through the state() "
          "of a Robot that passes this one's on.")
      .def(
          "readings",
          [](Ros2Robot& self) {
            return pairs_of(unlocked([&] { return loop_asks ? self.readings() : self.latest_readings(); }));
          },
          "list of (time_s, float[4]): all since run() took them last, the newest 1000, in any thread. They stay for "
          "run(), also through the readings() of a Robot that passes this one's on.");
  refuse_subclasses(robot, "Robot");
  py::class_<Ros2Camera, ImageStream> camera(m, "Ros2Camera", "The newest image of a topic of ROS 2.");
  camera
      .def(py::init([](const std::string& topic, const Rig& rig, const SteadyClock& clock) {
             return std::make_unique<Ros2Camera>(topic, rig.camera, clock);
           }),
           py::arg("topic"), py::arg("rig"), py::arg("clock"), py::keep_alive<1, 4>(),
           "topic: '/endoscope/image_raw', or '.../compressed'; images must have the size of the rig's camera.")
      .def_property_readonly("dropped", &Ros2Camera::dropped, "counts of images that were not used, or ''")
      .def_property_readonly("complaint", &Ros2Camera::complaint, "why the last of them was not used, or ''");
  refuse_subclasses(camera, "ImageStream");
}

void bind_arm_side(py::module_& m) {
  py::class_<Ros2Arm>(m, "Ros2Arm", R"(The topics of a CRTK arm over ROS 2, for a program that moves another robot.

`lapservo servo --robot ros2:ARM` then steers that robot. ROS need not be installed.)")
      .def(py::init<const std::string&, std::vector<std::string>>(), py::arg("arm"), py::arg("joint_names"),
           "arm: the namespace, 'PSM1'; joint_names: of all joints, the rig's four among them.")
      .def(
          "publish",
          [](Ros2Arm& self, const Array<"measured", Eigen::Dynamic, 1, Numbers::any>& measured,
             const Array<"setpoint", Eigen::Dynamic, 1, Numbers::any>& setpoint, const std::string& operating_state,
             bool is_homed, bool is_busy) {
            const py::gil_scoped_release others_run;
            self.publish(measured.value, setpoint.value, operating_state, is_homed, is_busy);
          },
          py::arg("measured"), py::arg("setpoint"), py::arg("operating_state") = "ENABLED", py::arg("is_homed") = true,
          py::arg("is_busy") = false,
          "measured_js, setpoint_js and operating_state, 100 times a second or more. measured, setpoint: of all "
          "joints, rad and m, where they are and where the robot was last sent; operating_state: DISABLED, ENABLED, "
          "PAUSED or FAULT; is_busy: it moves by itself.")
      .def(
          "new_setpoint", &Ros2Arm::new_setpoint,
          "The newest setpoint of all joints, rad and m, since the last call, or None. The robot goes there at once. A "
          "setpoint expires after 0.7 s, and unless publish() said ENABLED, homed and not busy when it came.")
      .def("new_commands", &Ros2Arm::new_commands,
           "Words of state_command since the last call: enable, disable, pause, resume, home, unhome.")
      .def_property_readonly("malformed", &Ros2Arm::malformed,
                             "count of setpoints of other joints, or not finite, which are dropped");
  py::class_<Ros2ImagePublisher>(m, "Ros2ImagePublisher", "Publishes images on a topic of ROS 2.")
      .def(py::init<const std::string&>(), py::arg("topic"), "topic: '/endoscope/image_raw'.")
      .def(
          "publish",
          [](Ros2ImagePublisher& self, const Picture<"Ros2ImagePublisher.publish">& image,
             const std::optional<double>& time_s) {
            const py::gil_scoped_release others_run;
            self.publish(image.bgr, time_s);
          },
          py::arg("image"), py::arg("time_s") = py::none(),
          "image: uint8[H, W, 3], blue green red; time_s: when it was exposed, in seconds since 1970; else now.");
}

}  // namespace

void bind_ros2(py::module_& m) {
  bind_loop_side(m);
  bind_arm_side(m);
}

}  // namespace lapservo::python
