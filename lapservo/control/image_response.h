#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>

#include <Eigen/Core>

#include "lapservo/control/control_step.h"
#include "lapservo/control/controller_config.h"
#include "lapservo/control/image_measurement.h"
#include "lapservo/control/joint_history.h"

namespace lapservo::internal {

/// Tests whether the image answers the measured joints: the motion that images show, as motion of q, is regressed on
/// each joint's measured motion over the last points of the path, at each delay from 0 to 300 ms. A joint is confirmed
/// once the image has moved with it. It is unanswered when, over some part of the path up to now, its slope is below a
/// half at every delay, by three standard deviations. Backlash is allowed for, and so is the motion of other joints
/// that a wrong model attributes to a joint. No allocation.
class ImageResponse {
 public:
  /// Path of a joint (rad, m) from rest within which an image has to move with it.
  static Eigen::Vector4d longest_path();
  /// Speed of a joint that no image has answered yet: small enough for that path, whatever the delay.
  static Eigen::Vector4d unconfirmed_rate(const JointLimits& limits);

  explicit ImageResponse(const ControllerConfig& config);

  /// Nothing is confirmed or known of a path.
  void restart();
  /// Images before and after are not compared. Confirmed joints stay confirmed.
  void interrupt();
  /// A found image, and the derivative of its features by q there.
  void add(const ImageMeasurement& image, const Eigen::Matrix4d& jacobian, const JointHistory& history);
  /// The image has moved with each joint, by another test.
  void confirm_all() { confirmed_.fill(true); }
  /// Found by another test.
  void set_unanswered(const Unanswered& found) { unanswered_ = found; }

  /// Until restart().
  const std::optional<Unanswered>& unanswered() const { return unanswered_; }
  /// Largest speeds, rad/s and m/s: the limits' of joints that are confirmed, else unconfirmed_rate(). One that is not
  /// answered is held within 20 mrad, 3 mm or 0.1 rad of roll.
  Eigen::Vector4d rate() const;

 private:
  static constexpr std::size_t delays = 13, points = 64;
  static constexpr double delay_step_s = 0.025;
  struct Point {
    Eigen::Vector4d seen = Eigen::Vector4d::Zero(), variance = Eigen::Vector4d::Zero();  ///< by the image
    std::array<Eigen::Vector4d, delays> moved, driven;  ///< measured, and behind the backlash
  };
  /// Sums over a part of the path, of each joint at one delay.
  struct Sums {
    Eigen::Array4d count = Eigen::Array4d::Zero(), x = count, y = count, xx = count, xy = count, lower = count,
                   upper = count;
    /// `counts`: 1 for joints that the point counts for, else 0.
    void add(const Eigen::Array4d& at, const Eigen::Array4d& seen, const Eigen::Array4d& counts);
  };
  /// The image's motion per motion of a joint, with its largest errors.
  struct Slope {
    double value = 0, noise = 0;
    double of_elements = 0, of_scales = 0;  ///< others' motion mixed into it, per error of the model
    double error(double model_error, double mixed) const {
      return noise + std::min(model_error * of_elements, mixed * of_scales);
    }
  };

  void doubt();
  const Point& point(std::size_t back) const { return ring_[(next_ + points - 1 - back) % points]; }
  void test();
  bool is_unanswered(const std::array<Sums, delays>& sums, Eigen::Index joint, double variance);
  std::optional<Slope> slope(const Sums& sums, Eigen::Index joint, double variance, double path) const;
  Eigen::Array4d pressed(const Point& at, std::size_t delay) const;

  ControllerConfig config_;
  Eigen::Array4d backlash_;
  std::array<bool, 4> confirmed_{};
  std::optional<Unanswered> unanswered_;
  bool started_ = false;
  Eigen::Vector4d features_ = Eigen::Vector4d::Zero();  ///< of the image before
  Eigen::Matrix4d jacobian_ = Eigen::Matrix4d::Zero();  ///< of the features, as it was some motion ago
  Eigen::Matrix4d mixed_ = Eigen::Matrix4d::Zero();     ///< into a joint's motion from others', per error of the model
  std::array<Eigen::Vector4d, delays> q_{};             ///< the measured joints at the image before
  Point now_;
  std::array<Point, points> ring_;
  std::size_t next_ = 0, size_ = 0;
  std::array<std::size_t, 4> likely_{};  ///< delay, by its number, at which a joint was answered last
};

}  // namespace lapservo::internal
