#pragma once

#include <cstdint>

#include "lapservo/sim/scene.h"

namespace lapservo {

/// Casts camera rays at one shaft. Pure geometry and shading of a point; knows nothing of pixels.
class ShaftCaster {
 public:
  ShaftCaster(const ShaftModel& model, const ShaftPlacement& placement, const Lighting& lighting);

  /// What a ray hits: 0 nothing, else a part of the surface; parts differ across every visible edge of colour.
  struct Hit {
    std::uint8_t part = 0;
    double depth_m = 1e9;                             ///< z in the camera frame
    Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< in the cylinder's frame, as the normal
    Eigen::Vector3d normal = Eigen::Vector3d::UnitX();
    double tau_rad = 0;
  };
  /// `ray`: direction in the camera frame with z = 1.
  Hit cast(const Eigen::Vector3d& ray) const;
  Light shade(const Hit& hit) const;

 private:
  bool hit_side(const Eigen::Vector3d& ray, double radius_m, double from_m, double to_m, Hit& hit) const;
  bool hit_disc(const Eigen::Vector3d& ray, double along_m, double inner_m, double outer_m, double facing,
                Hit& hit) const;
  bool hit_tip(const Eigen::Vector3d& ray, Hit& hit) const;
  std::uint8_t marker_part(Hit& hit) const;

  ShaftModel model_;
  ShaftPlacement placement_;
  Lighting lighting_;
  Eigen::Matrix3d cylinder_from_camera_;
  Eigen::Vector3d camera_;  // centre, in the cylinder's frame
  std::array<Eigen::Vector3d, 2> lamps_;
  std::array<Light, 6> albedo_;  // by part
};

/// Linear-light reflectance of a printed hue: HSV(hue, 0.97, 0.83) in sRGB values, b g r.
Light printed_color(double hue_deg);

}  // namespace lapservo
