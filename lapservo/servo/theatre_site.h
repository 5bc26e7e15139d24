#pragma once

#include "lapservo/rig/rig.h"
#include "lapservo/servo/site.h"
#include "lapservo/sim/theatre.h"

namespace lapservo {

/// The simulated theatre as a site. Setpoints reach its arm at `arm_rate_hz`.
class TheatreSite : public Site {
 public:
  /// `rig` is how things really are.
  TheatreSite(const Rig& rig, const TheatreConfig& config, const RcmCoordinates& readings, double arm_rate_hz = 1000)
      : theatre_(rig, config, readings), arm_period_s_(1 / arm_rate_hz) {}

  double now_s() const override { return theatre_.time_s(); }
  ArmReading arm() const override;
  std::optional<SiteFrame> newest_frame() override;
  void follow(const SetpointInterpolator& path, double until_s) override;
  void wait(double until_s) override;
  std::optional<Eigen::Vector4d> true_q() const override { return theatre_.true_q().vector(); }

  Theatre& theatre() { return theatre_; }

 private:
  Theatre theatre_;
  double arm_period_s_;
};

}  // namespace lapservo
