#pragma once

#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <optional>
#include <vector>

#include "lapservo/control/newton_inverse.h"
#include "lapservo/control/paper_trajectory.h"
#include "lapservo/control/tracking_law.h"
#include "lapservo/control/visual_controller.h"
#include "lapservo/core/random.h"
#include "lapservo/kinematics/feature_map.h"
#include "lapservo/kinematics/test_models.h"

namespace lapservo::testing {
using namespace internal;

/// A rig for tests: the one of the paper's trajectory.
struct TestRig : ImageModel {
  TestRig() : ImageModel(image_models().front()) {}
};

inline std::optional<FeatureState> exact_map(const ImageModel& rig, const Eigen::Vector4d& q) {
  const auto point = feature_map(rig, JointVector::from_vector(q));
  if (!point) return std::nullopt;
  FeatureState state{point->f, point->jacobian, {}, point->ends_jacobian};
  state.ends_px << point->ideal_px[0], point->ideal_px[3];
  return state;
}

inline FeatureModel model_of(const TestRig& rig) {
  return [rig](const Eigen::Vector4d& q) { return exact_map(rig, q); };
}

/// The measurement of a visible marker.
inline ImageMeasurement image_of(const FeatureState& state, double stamp_s) {
  const Eigen::Vector4d variances(1e-7, 0.02, 0.02, 0.02);
  return {true, stamp_s, state.features, variances.asDiagonal(), state.ends_px, {}};
}

/// The model errors between the controller and the instrument.
struct Flaws {
  double latency_s = 0.08;
  bool delay_known = true;
  Eigen::Vector4d offset = Eigen::Vector4d::Zero();    ///< true joints minus measured joints
  Eigen::Vector4d backlash = Eigen::Vector4d::Zero();  ///< full backlash, joint by joint
  double lag_s = 0;                                    ///< of the arm, first order
  Eigen::Vector4d answer = Eigen::Vector4d::Ones();    ///< the instrument's motion per motion of the motors
  Eigen::Vector4d resolution{1e-5, 1e-5, 2e-6, 1e-4};  ///< of the measured joints
  Eigen::Vector4d noise{4e-4, 0.15, 0.15, 0.15};       ///< of the image
  long frame_every = 1;                                ///< control periods a frame
  double dropped = 0;                                  ///< fraction of frames that never come
  std::function<bool(double time_s)> lost = [](double) { return false; };  ///< such a frame never comes
  double jitter_s = 0;                                                     ///< of the steps' times, at most
  std::function<bool(double time_s)> hidden = [](double) { return false; };
  std::function<ImageMeasurement(const ImageMeasurement&)> spoil = [](const ImageMeasurement& m) { return m; };
  std::function<Eigen::Vector4d(double time_s)> misread = [](double) {  // what the measured joints are off by
    return Eigen::Vector4d(Eigen::Vector4d::Zero());
  };
};

struct Moment {
  double time_s = 0;
  Eigen::Vector4d error = Eigen::Vector4d::Zero();  ///< true features minus desired
  Eigen::Vector4d q_true = Eigen::Vector4d::Zero();
  FeatureState truth;
  ControlStep step;
};

/// An arm with lag, offsets and backlash before a camera with latency; 60 periods and frames a second.
class TestSimulator {
 public:
  TestSimulator(const TestRig& rig, const Flaws& flaws, const Eigen::Vector4d& q_measured, std::uint64_t seed)
      : rig_(rig), flaws_(flaws), random_(seed), motor_(q_measured), q_driven_(q_measured), q_instrument_(q_measured) {}

  Eigen::Vector4d q_measured() const {
    return (motor_.cwiseQuotient(flaws_.resolution)).array().round().matrix().cwiseProduct(flaws_.resolution);
  }
  Eigen::Vector4d q_true() const { return q_instrument_ + flaws_.offset; }

  std::vector<Moment> run(VisualController& controller, const Trajectory& trajectory, double duration_s) {
    std::vector<Moment> moments;
    const double period_s = controller.config().period_s;
    const auto periods = static_cast<long>(duration_s / period_s);
    for (long k = 0; k < periods; ++k) {
      const double time_s = start_s_ + static_cast<double>(k) * period_s + flaws_.jitter_s * random_.uniform();
      Moment moment;
      moment.time_s = time_s;
      moment.q_true = q_true();
      moment.truth = exact_map(rig_, q_true()).value();
      const DesiredFeatures desired = trajectory.at(time_s);
      moment.error = feature_error(moment.truth.features, desired.features);
      if (k % flaws_.frame_every == 0 && random_.uniform() >= flaws_.dropped && !flaws_.lost(time_s))
        expose(time_s, moment.truth);
      moment.step = controller.step(time_s, q_measured() + flaws_.misread(time_s), arrived(time_s), desired);
      move(controller, std::max(time_s, moved_s_), start_s_ + static_cast<double>(k + 1) * period_s);
      moments.push_back(moment);
    }
    start_s_ += static_cast<double>(periods) * period_s;
    return moments;
  }

 private:
  void expose(double time_s, const FeatureState& truth) {
    ImageMeasurement image;
    image.time_s = time_s + flaws_.latency_s;
    image.found = !flaws_.hidden(time_s);
    for (int i = 0; i < 4; ++i) image.features[i] = truth.features[i] + flaws_.noise[i] * random_.normal();
    for (int i = 0; i < 4; ++i) image.ends_px[i] = truth.ends_px[i] + 0.15 * random_.normal();
    image.covariance = flaws_.noise.cwiseMax(1e-9).cwiseAbs2().asDiagonal();
    on_the_way_.push_back(flaws_.spoil(image));
  }
  std::optional<ImageMeasurement> arrived(double time_s) {
    std::optional<ImageMeasurement> latest;
    while (!on_the_way_.empty() && on_the_way_.front().time_s <= time_s + 1e-9) {
      latest = on_the_way_.front();
      on_the_way_.pop_front();
    }
    return latest;
  }
  /// Up to the earliest time of the next step.
  void move(const VisualController& controller, double from_s, double to_s) {
    constexpr int parts = 8;
    for (int i = 1; i <= parts; ++i) {
      const Eigen::Vector4d setpoint = controller.path().at(from_s + (to_s - from_s) * i / parts).position;
      const double fraction = flaws_.lag_s > 0 ? -std::expm1(-(to_s - from_s) / parts / flaws_.lag_s) : 1.0;
      motor_ += fraction * (setpoint - motor_);
      const Eigen::Vector4d before = q_driven_;
      q_driven_ = q_driven_.cwiseMax(motor_ - flaws_.backlash / 2).cwiseMin(motor_ + flaws_.backlash / 2);
      q_instrument_ += flaws_.answer.cwiseProduct(q_driven_ - before);
    }
    moved_s_ = to_s;
  }

  TestRig rig_;
  Flaws flaws_;
  Random random_;
  Eigen::Vector4d motor_, q_driven_, q_instrument_;
  std::deque<ImageMeasurement> on_the_way_;
  double start_s_ = 0, moved_s_ = 0;
};

inline ControllerConfig test_config(const Flaws& flaws) {
  ControllerConfig config;
  config.window = ImageWindow{20, 1259, 20, 699};
  if (flaws.delay_known) config.observer.delay_s = flaws.latency_s;
  return config;
}

/// Measured joints within the joint limits at which the true instrument shows well inside the window.
inline Eigen::Vector4d random_start(const TestRig& rig, const ControllerConfig& config, const Flaws& flaws,
                                    Random& random, double margin_px = 30) {
  const ImageWindow& w = config.window.value();
  while (true) {
    Eigen::Vector4d q;  // a statement each: arguments have no order
    q[3] = random.uniform(-3, 3);
    q[2] = random.uniform(0.05, 0.085);
    q[1] = random.uniform(1.35, 1.8);
    q[0] = random.uniform(-0.25, 0.35);
    const auto state = exact_map(rig, q + flaws.offset);
    if (!state || state->features[2] < 80) continue;
    const Eigen::Vector4d& e = state->ends_px;
    const bool inside = std::min(e[0], e[2]) > w.u_min_px + margin_px &&
                        std::max(e[0], e[2]) < w.u_max_px - margin_px &&
                        std::min(e[1], e[3]) > w.v_min_px + margin_px && std::max(e[1], e[3]) < w.v_max_px - margin_px;
    const double tau = feature_map(rig, JointVector::from_vector(q + flaws.offset))->tau_rad;
    if (!inside || tau < 0.5 || tau > two_pi - 0.5) continue;
    const auto goal = newton_inverse(model_of(rig), paper_sinusoids().offset, q + flaws.offset, config.scales);
    if (goal->converged && std::abs(goal->q[3]) < 2.5) return q;
  }
}

}  // namespace lapservo::testing
