#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"
#include "lapservo/robot/backlash.h"

namespace lapservo::internal {

struct BacklashEstimate {
  double width = 0;  ///< full backlash, rad or m
  double sigma = 0;
};

/// Estimates the widths of the gaps between motors and instrument. The difference between image and measured joints is
/// compared with the response of each of a grid of widths to the measured joints so far; the lowest sum of squares is
/// the likeliest width, refined by a parabola. Each sum is the minimum over other causes of a difference: an offset (a
/// running mean is removed from everything alike), a wrong model (it adds multiples of the joints' positions) and a
/// wrong delay (a multiple of the joint's velocity, which differs from backlash in shape only). Measured joints that
/// never reverse make all widths alike: then there is no estimate.
class BacklashEstimator {
 public:
  static constexpr std::size_t candidates = 21;  ///< 0 to the largest

  BacklashEstimator(const BacklashEstimatorConfig& config, const Scales& scales) : config_(config), scales_(scales) {}

  /// Measured joints, in order of time, up to those of the image in add().
  void follow(const Eigen::Vector4d& q_joint);
  /// An image that shows `q_image` (with the covariance of its noise) when the measured joints were the last ones
  /// followed and changed at `rate`.
  void add(double time_s, const Eigen::Vector4d& rate, const Eigen::Vector4d& q_image,
           const Eigen::Matrix4d& covariance);
  /// The offset jumped, or measured joints are missing: keeps what is known, but compares nothing across.
  void interrupt() { followed_ = false; }

  std::optional<BacklashEstimate> estimate(int joint) const;

 private:
  /// Causes of a difference other than backlash: the joints' positions and the joint's own velocity.
  using Nuisance = Eigen::Matrix<double, 5, 1>;
  struct Candidate {
    Backlash backlash;
    double mean = 0;                    ///< of what image and this backlash differ by
    double squares = 0;                 ///< of the rest
    Nuisance mixed = Nuisance::Zero();  ///< the rest by nuisances
  };
  struct Joint {
    std::array<Candidate, candidates> grid;
    bool pressed = false;  ///< far enough in one direction that every candidate's side is known
    double lowest = 0, highest = 0;
    Nuisance mean = Nuisance::Zero();
    Eigen::Matrix<double, 5, 5> normal = Eigen::Matrix<double, 5, 5>::Zero();
    double since = 0;   ///< frames since the last interruption
    double weight = 0;  ///< number of frames, forgotten likewise
    double last_s = 0;
  };

  double width(int joint, std::size_t candidate) const {
    return config_.largest[joint] * static_cast<double>(candidate) / (candidates - 1);
  }

  BacklashEstimatorConfig config_;
  Scales scales_;
  std::array<Joint, 4> joints_;
  Eigen::Vector4d q_joint_ = Eigen::Vector4d::Zero();
  bool followed_ = false;
};

}  // namespace lapservo::internal
