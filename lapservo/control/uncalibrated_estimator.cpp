#include <algorithm>
#include <memory>
#include <optional>
#include <variant>

#include "lapservo/control/estimator.h"
#include "lapservo/control/image_response.h"
#include "lapservo/control/jacobian_estimator.h"
#include "lapservo/control/probing.h"
#include "lapservo/core/angles.h"

namespace lapservo::internal {
namespace {

// By how much the farthest end lies outside the window; 0 inside.
double beyond_px(const ImageWindow& window, const Eigen::Vector4d& ends_px) {
  const Eigen::Array2d u(ends_px[0], ends_px[2]), v(ends_px[1], ends_px[3]);
  return std::max({0.0, window.u_min_px - u.minCoeff(), u.maxCoeff() - window.u_max_px, window.v_min_px - v.minCoeff(),
                   v.maxCoeff() - window.v_max_px});
}

// 4 when all have been probed.
Eigen::Index joint_at(const ProbingConfig& config, double probed_s) {
  return std::min<Eigen::Index>(4, static_cast<Eigen::Index>(probed_s / config.joint_time_s));
}

// Without a model: a small probing motion gives the Jacobian and the delay, and JacobianEstimator keeps learning.
class UncalibratedEstimator : public Estimator {
 public:
  explicit UncalibratedEstimator(const ControllerConfig& config) : config_(config) {}

  HoldReason update(const ImageMeasurement& image, const JointHistory& history) override {
    if (auto* learnt = std::get_if<Learnt>(&state_)) return follow(*learnt, image, history);
    if (std::holds_alternative<Waiting>(state_))
      state_ = Probing{
          ProbingMotion(config_.probing, config_.limits, *history.newest(), side_),
          ProbingFit(config_.scales, config_.observer.delay_s),
          ProbingResponse(ImageResponse::longest_path(), config_.observer.delay_s.value_or(ProbingFit::longest_s))};
    return learn(std::get<Probing>(state_), image, history);
  }
  std::optional<Estimate> at(double, const Eigen::Vector4d& q_joint) const override {
    const auto* learnt = std::get_if<Learnt>(&state_);
    if (!learnt) return std::nullopt;
    Estimate now{learnt->jacobian.at(q_joint)};
    now.q = q_joint;
    now.covariance = config_.scales.features.cwiseAbs2().asDiagonal();
    now.covariance *= learnt->jacobian.variance_at(q_joint);
    return now;
  }
  bool delay_is_known() const override { return config_.observer.delay_s || std::holds_alternative<Learnt>(state_); }
  double delay_s() const override {
    if (config_.observer.delay_s) return *config_.observer.delay_s;
    const auto* learnt = std::get_if<Learnt>(&state_);
    return learnt ? learnt->delay_s : 0;
  }
  std::optional<Eigen::Vector4d> probing_velocity(double time_s) const override {
    const auto* probing = std::get_if<Probing>(&state_);
    if (!probing) return std::nullopt;
    return probing->pace * probing->motion.velocity(probing->probed_s + probing->pace * time_s);
  }
  void advance_probing(double time_s) override {
    constexpr double faster_per_s = 10;
    auto* probing = std::get_if<Probing>(&state_);
    if (!probing) return;
    probing->probed_s += probing->pace * time_s;
    probing->pace = std::min(probing->pace + faster_per_s * time_s, pace_of(*probing));
  }
  std::optional<Unanswered> unanswered() const override { return unanswered_; }
  void interrupt() override { restart_probing(); }
  void restart_probing() override {
    if (std::holds_alternative<Probing>(state_)) state_ = Waiting{};
  }

 private:
  /// For an image, by which the probing motion begins.
  struct Waiting {};
  struct Probing {
    ProbingMotion motion;
    ProbingFit fit;
    ProbingResponse response;
    double probed_s = 0;
    double pace = 0;                ///< of the motion: slower until an image shows the joint's
    Eigen::Index joint = -1;        ///< that is probed
    double beyond_at_first_px = 0;  ///< of the window, in the first image of that joint's motion
  };
  struct Learnt {
    JacobianEstimator jacobian;
    double delay_s;
    double last_image_s;  ///< stamp of the last one used
  };

  HoldReason learn(Probing& probing, const ImageMeasurement& image, const JointHistory& history) {
    unanswered_.reset();
    const Eigen::Index joint = joint_at(config_.probing, probing.probed_s);
    if (joint < 4) probing.response.add(joint, image, history);
    if (joint < 4 && probing.response.is_unanswered()) {
      unanswered_ = Unanswered{joint, 0};
      state_ = Waiting{};
      return HoldReason::image_not_following;
    }
    if (joint < 4 && config_.window) stay_inside(probing, joint, *config_.window, image.ends_px);
    probing.fit.add(image.time_s, image.features, image.ends_px, history);
    if (probing.probed_s < probing.motion.duration_s()) return HoldReason::none;
    const auto model = probing.fit.solve();
    if (!model) {
      state_ = Waiting{};
      return HoldReason::not_learnt;
    }
    state_ = Learnt{JacobianEstimator(config_.jacobian, config_.scales, *model), model->delay_s, image.time_s};
    return HoldReason::none;
  }
  // Nothing is known yet of what a joint does in the image, but one that takes the marker out of the window has to go
  // back, and to the other side next time. It may begin outside, where the one before has left the marker.
  void stay_inside(Probing& probing, Eigen::Index joint, const ImageWindow& window, const Eigen::Vector4d& ends_px) {
    constexpr double noise_px = 1;
    const double beyond = beyond_px(window, ends_px), back_s = probing.motion.way_back_s(probing.probed_s);
    if (joint != probing.joint || probing.response.waits(joint)) probing.beyond_at_first_px = beyond;
    probing.joint = joint;
    if (back_s == probing.probed_s || beyond < probing.beyond_at_first_px + noise_px) return;
    side_[joint] = -side_[joint];
    probing.probed_s = back_s;
  }
  // The largest speed is that of a joint that no image has answered.
  double pace_of(const Probing& probing) const {
    const Eigen::Index joint = joint_at(config_.probing, probing.probed_s);
    if (joint > 3 || probing.response.answers(joint)) return 1;
    if (probing.response.waits(joint)) return 0;
    const double largest = config_.probing.distance[joint] * pi / config_.probing.joint_time_s;
    return std::min(1.0, ImageResponse::unconfirmed_rate(config_.limits)[joint] / largest);
  }
  HoldReason follow(Learnt& learnt, const ImageMeasurement& image, const JointHistory& history) const {
    const auto q_then = history.at(image.time_s - delay_s());
    if (!q_then) return HoldReason::no_history;
    const double interval_s = std::max(0.0, image.time_s - learnt.last_image_s);
    if (!learnt.jacobian.update(*q_then, image.features, image.ends_px, interval_s)) return HoldReason::outlier;
    learnt.last_image_s = image.time_s;
    return HoldReason::none;
  }

  ControllerConfig config_;
  Eigen::Vector4d side_ = Eigen::Vector4d::Ones();  ///< to which the joints are probed
  std::variant<Waiting, Probing, Learnt> state_;
  std::optional<Unanswered> unanswered_;
};

}  // namespace

std::unique_ptr<Estimator> make_uncalibrated_estimator(const ControllerConfig& config) {
  return std::make_unique<UncalibratedEstimator>(config);
}

}  // namespace lapservo::internal
