#pragma once

#include <optional>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "lapservo/control/setpoint_interpolator.h"
#include "lapservo/robot/arm_port.h"

namespace lapservo {

struct SiteFrame {
  double stamp_s = 0;  ///< when it arrived
  cv::Mat bgr;
};

/// Where the loop is connected to: an arm, an endoscope and their clock.
class Site {
 public:
  virtual ~Site() = default;
  virtual double now_s() const = 0;
  virtual ArmReading arm() const = 0;
  /// The newest frame that arrived since the last call.
  virtual std::optional<SiteFrame> newest_frame() = 0;
  /// Lets time pass until `until_s`; the arm follows the path at its own rate.
  virtual void follow(const SetpointInterpolator& path, double until_s) = 0;
  /// Lets time pass; the arm gets nothing.
  virtual void wait(double until_s) = 0;
  /// Where the instrument truly is: only a simulation knows.
  virtual std::optional<Eigen::Vector4d> true_q() const { return std::nullopt; }
};

}  // namespace lapservo
