#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"
#include "lapservo/control/image_measurement.h"
#include "lapservo/control/joint_history.h"

namespace lapservo::internal {

/// The eight numbers of an image: s_rad, r_px, l_px, d_px, then the end points e0 u, v, e3 u, v.
using ImageVector = Eigen::Matrix<double, 8, 1>;

/// Least squares of y = y0 + G x for four inputs and eight outputs, all in units of their scale.
class AffineFit {
 public:
  struct Solution {
    ImageVector at_zero = ImageVector::Zero();
    Eigen::Matrix<double, 8, 4> gradient = Eigen::Matrix<double, 8, 4>::Zero();
    Eigen::Matrix<double, 5, 5> covariance = Eigen::Matrix<double, 5, 5>::Zero();  ///< of (y0, G row), unit noise
    double squares = 0;                                                            ///< sum of squared residuals
  };

  void add(const Eigen::Vector4d& x, const ImageVector& y);
  /// nullopt when the inputs do not span all four directions.
  std::optional<Solution> solve() const;

 private:
  Eigen::Matrix<double, 5, 5> normal_ = Eigen::Matrix<double, 5, 5>::Zero();
  Eigen::Matrix<double, 5, 8> mixed_ = Eigen::Matrix<double, 5, 8>::Zero();
  double squares_ = 0;
  int samples_ = 0;
};

/// The small motion by which an uncalibrated controller learns what its joints do in the image: x(t) = distance / 2
/// (1 - cos(2 pi t / T)), joint after joint, away from the nearer joint limit; then rest until the last of it has
/// been seen.
class ProbingMotion {
 public:
  /// `side`: of each joint, 1, or -1 for towards the nearer limit.
  ProbingMotion(const ProbingConfig& config, const JointLimits& limits, const Eigen::Vector4d& q_joint,
                const Eigen::Vector4d& side = Eigen::Vector4d::Ones());

  Eigen::Vector4d velocity(double time_s) const;
  double duration_s() const;

  /// When the joint that moves then is there again on its way back; the same time where it is on that way already, or
  /// all joints rest.
  double way_back_s(double time_s) const;

 private:
  Eigen::Vector4d distance_ = Eigen::Vector4d::Zero();  ///< signed
  double joint_time_s_ = 1;
};

/// An affine image model learnt from a probing motion, together with the delay.
struct ProbedModel {
  Eigen::Vector4d q = Eigen::Vector4d::Zero();  ///< where x = 0
  AffineFit::Solution fit;                      ///< in scales, x = (q - this->q) / joint scales
  double delay_s = 0;
};

/// Fits the model at each of a grid of delays at once: the right one leaves the smallest residuals.
class ProbingFit {
 public:
  static constexpr double step_s = 0.01;
  static constexpr std::size_t candidates = 31;  ///< 0 to 300 ms
  static constexpr double longest_s = step_s * (candidates - 1);

  /// With a known delay, only that one is fitted.
  ProbingFit(const Scales& scales, std::optional<double> delay_s) : scales_(scales), known_delay_s_(delay_s) {}

  /// Ignored while the history does not reach back to the longest delay.
  void add(double stamp_s, const Eigen::Vector4d& features, const Eigen::Vector4d& ends_px,
           const JointHistory& history);
  /// nullopt when the motion was too small or the delay lies beyond the grid.
  std::optional<ProbedModel> solve() const;

 private:
  double candidate_s(std::size_t i) const { return known_delay_s_ ? *known_delay_s_ : step_s * static_cast<double>(i); }
  std::size_t used() const { return known_delay_s_ ? 1 : candidates; }

  Scales scales_;
  std::optional<double> known_delay_s_;
  bool started_ = false;
  Eigen::Vector4d first_q_ = Eigen::Vector4d::Zero();
  Eigen::Vector4d first_features_ = Eigen::Vector4d::Zero();
  Eigen::Vector4d first_ends_px_ = Eigen::Vector4d::Zero();
  std::array<AffineFit, candidates> fits_;
};

/// Whether the image moves with the joint that is probed, whatever it does there: some feature's regression on the
/// joint, at some delay, is plain beside the images' noise.
class ProbingResponse {
 public:
  /// `path`: of each joint, after which the image has to have moved; `longest_delay_s`: of the images.
  ProbingResponse(const Eigen::Vector4d& path, double longest_delay_s) : path_(path), longest_s_(longest_delay_s) {}

  /// An image while `joint` is probed.
  void add(Eigen::Index joint, const ImageMeasurement& image, const JointHistory& history);
  /// The next image may still show the joint before.
  bool waits(Eigen::Index joint) const { return joint == joint_ && waits_; }
  bool answers(Eigen::Index joint) const { return joint == joint_ && answered_; }
  bool is_unanswered() const { return unanswered_; }

 private:
  static constexpr std::size_t candidates = 7;  ///< delays from 0 to 300 ms
  struct Sums {
    double x = 0, xx = 0;
    Eigen::Array4d y = Eigen::Array4d::Zero(), xy = Eigen::Array4d::Zero();
  };
  double delay_s(std::size_t candidate) const { return longest_s_ * static_cast<double>(candidate) / (candidates - 1); }
  void begin(Eigen::Index joint, const ImageMeasurement& image, const JointHistory& history);

  Eigen::Vector4d path_;
  double longest_s_;
  Eigen::Index joint_ = -1;
  double begun_s_ = 0, q_first_ = 0, count_ = 0;
  Eigen::Vector4d features_ = Eigen::Vector4d::Zero();
  std::array<Sums, candidates> sums_;
  double plainest_ = 0, delay_s_ = 0;  ///< of the regressions: in standard deviations, and at which delay
  bool waits_ = false, answered_ = false, unanswered_ = false;
};

}  // namespace lapservo::internal
