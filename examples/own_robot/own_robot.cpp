// own_robot RIG.yaml: ten seconds of the loop around an arm and a camera that lapservo knows nothing of. Somebody
// presses the arm's emergency stop, enables it again, and starts.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <lapservo/lapservo.h>
#include <string>
#include <utility>

#include "second_order_arm.h"

using namespace lapservo;

// A camera of one's own: 30 images a second of the arm's place, 50 ms late.
class Camera30 : public ImageStream {
 public:
  Camera30(const Rig& rig, SecondOrderArm& arm)
      : camera_from_rcm_(rig.instruments[0].camera_from_rcm.value()),
        arm_(arm),
        renderer_(rig.camera, {ShaftModel{.marker = rig.instruments[0].marker}},
                  cv::Mat(rig.camera.height_px, rig.camera.width_px, CV_32FC3, cv::Scalar(0.05, 0.06, 0.2))) {}

  std::optional<StampedImage> newest() override {
    if (exposed_ && arm_.time_s() >= exposed_s_ + 0.05) {
      const ShaftPlacement shaft{camera_from_rcm_ * rcm_from_unrolled(*exposed_), exposed_->psi_rad};
      exposed_.reset();
      return StampedImage{arm_.time_s(), renderer_.render({shaft}, ++pictures_)};
    }
    return std::nullopt;
  }
  void expose() {
    if (exposed_ || arm_.time_s() < exposed_s_ + 1.0 / 30) return;
    exposed_ = arm_.state().q;
    exposed_s_ = arm_.time_s();
  }

 private:
  Rigid3 camera_from_rcm_;
  SecondOrderArm& arm_;
  Renderer renderer_;
  std::optional<JointVector> exposed_;
  double exposed_s_ = 0;
  std::uint64_t pictures_ = 0;
};

// The arm's physics pass while the loop sleeps. With a real arm this is lapservo's SteadyClock.
class ArmsClock : public Clock {
 public:
  ArmsClock(SecondOrderArm& arm, Camera30& camera) : arm_(arm), camera_(camera) {}
  double now_s() const override { return arm_.time_s(); }
  void sleep_until(double time_s) override {
    while (arm_.time_s() < time_s - 1e-9) {
      arm_.pass(std::min(0.001, time_s - arm_.time_s()));
      camera_.expose();
    }
  }

 private:
  SecondOrderArm& arm_;
  Camera30& camera_;
};

// An operator stops and starts the arm, and sees the state of the loop and its error in the last second.
class Operator : public RunObserver {
 public:
  Operator(SecondOrderArm& arm, Supervisor& supervisor) : arm_(arm), supervisor_(supervisor) {}

  bool on_tick(const ControlTick& tick) override {
    const double time_s = tick.input.time_s, before_s = std::exchange(time_s_, time_s);
    const auto is_now = [&](double then_s) { return before_s < then_s && then_s <= time_s; };
    if (is_now(3)) arm_.press_emergency_stop();
    if (is_now(3.5)) arm_.enable();  // nothing moves yet
    if (is_now(4)) rested_ = tick.input.joints.q.vector();
    if (is_now(5)) moved_while_held_ = tick.input.joints.q.vector() - rested_;
    if (is_now(5)) supervisor_.start(Commander::program, time_s);
    if (const std::string state = supervisor_.text(); state != state_) {
      state_ = state;
      std::printf("%.2f s  %s\n", time_s, state.empty() ? "armed" : state.c_str());
    }
    if (time_s > 9 && tick.decision.control.estimate)
      sees_ = true, largest_error_ = largest_error_.cwiseMax(tick.decision.control.error.cwiseAbs());
    return true;
  }
  Eigen::Vector4d largest_error_ = Eigen::Vector4d::Zero(), moved_while_held_ = Eigen::Vector4d::Constant(1);
  bool sees_ = false;  // the marker, in the last second

 private:
  SecondOrderArm& arm_;
  Supervisor& supervisor_;
  double time_s_ = 0;
  Eigen::Vector4d rested_ = Eigen::Vector4d::Zero();
  std::string state_;
};

int main(int argc, char** argv) {
  if (argc != 2) return std::puts("own_robot RIG.yaml"), 2;
  const Rig rig = load_rig(argv[1]);
  SecondOrderArm arm({0.05, 1.57, 0.064, 1.2});
  Camera30 camera(rig, arm);
  ArmsClock clock(arm, camera);
  RunConfig config;
  config.rig = rig;
  config.controller.window = image_window(rig.camera, 20);
  config.arm_limits = JointLimits{.lower = {-1, 0.6, 0.03, -4},
                                  .upper = {1, 2.5, 0.2, 4},
                                  .rate = {0.4, 0.4, 0.04, 1.5},
                                  .acceleration = {2, 2, 0.2, 7.5}};
  config.controller.limits = *config.arm_limits;
  Supervisor supervisor(arm, clock);
  Operator person(arm, supervisor);
  run(supervisor, camera, clock, config, sinusoids(paper_sinusoids()), 10, person);
  const Eigen::Vector4d &e = person.largest_error_, &moved = person.moved_while_held_;
  const bool held = (moved.array().abs() < Eigen::Array4d(1e-4, 1e-4, 5e-5, 1e-4)).all();
  const bool converged = person.sees_ && e[0] < 0.005 && e.tail<3>().maxCoeff() < 1;
  std::printf("%s; %s; largest errors in the last second: s %.2f mrad; r %.2f, l %.2f, d %.2f px\n",
              converged ? "converged" : "did not converge", held ? "held until the start" : "moved without a start",
              1000 * e[0], e[1], e[2], e[3]);
  return held && converged ? 0 : 1;
}
