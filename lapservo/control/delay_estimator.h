#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"
#include "lapservo/control/joint_history.h"

namespace lapservo::internal {

struct DelayEstimate {
  double delay_s = 0;
  double sigma_s = 0;
};

/// How old the image is, from the data: the image's joint positions are compared with the measured joints at each of a
/// grid of delays. The offset between both is removed as a running mean; what remains is, for each candidate, a sum of
/// squares, and the lowest sum is the likeliest delay, refined by a parabola through its neighbours. Its curvature is
/// the information: without motion all candidates are alike, sigma is large and there is no estimate. Sigma counts what
/// a wrong model does to the delay, where it shows.
class DelayEstimator {
 public:
  static constexpr double step_s = 0.005;
  static constexpr std::size_t candidates = 61;  ///< 0 to 300 ms
  static constexpr double longest_s = step_s * (candidates - 1);

  explicit DelayEstimator(const DelayEstimatorConfig& config = {}) : config_(config) {}

  /// One image, stamped `stamp_s`, that shows joint positions `q_image` (with the covariance of their noise). Ignored
  /// while the history does not reach back to the longest delay.
  void add(double stamp_s, const Eigen::Vector4d& q_image, const Eigen::Matrix4d& covariance,
           const JointHistory& history);

  /// The offset jumped: keeps what is known, but compares nothing across.
  void interrupt() { since_ = 0; }

  /// The image stamped t shows the joints at t - delay.
  std::optional<DelayEstimate> estimate() const;

  /// Another delay than this one explains the images better: by four sigmas, and four times the largest of estimate().
  bool contradicts(double delay_s) const;

  /// No delay makes images and joints agree, although the joints' motion would determine it several times over.
  bool is_contradicted() const;

 private:
  struct Candidate {
    Eigen::Vector4d mean = Eigen::Vector4d::Zero();  ///< of q_image - q_joint
    double squares = 0;
    Eigen::Matrix4d mixed = Eigen::Matrix4d::Zero();  ///< the weighted rest by where the joints are
  };
  /// The lowest sum of squares, between its candidate and a neighbour, and its variance by noise; of the squares, their
  /// curvature by the delay.
  struct Lowest {
    std::size_t candidate;
    double curvature, shift_s, delay_s, by_noise_s2;
  };
  /// nullopt before min_time_s, and where all delays are alike.
  std::optional<Lowest> lowest() const;
  double variance_by_model(const Lowest& at) const;

  DelayEstimatorConfig config_;
  std::array<Candidate, candidates> grid_;
  double last_stamp_s_ = 0;
  double seen_s_ = 0;
  double weight_ = 0;                               ///< number of frames, forgotten likewise
  double since_ = 0;                                ///< frames since the last interruption
  Eigen::Vector4d mean_ = Eigen::Vector4d::Zero();  ///< of q_image
  double squares_ = 0;                              ///< of q_image less its mean
  /// Products of the joints' places in the image, for each pair of joints that may be off by them, forgotten likewise.
  Eigen::Matrix<double, 16, 16> by_model_ = Eigen::Matrix<double, 16, 16>::Zero();
  double information_per_s2_ = 0;  ///< that the joints' motion gives of a delay, forgotten likewise
};

}  // namespace lapservo::internal
