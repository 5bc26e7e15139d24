#pragma once

#include <vector>

#include "lapservo/core/random.h"
#include "lapservo/kinematics/feature_map.h"

namespace lapservo::testing {
using namespace internal;

/// Rigs that differ in camera, marker and where the RCM lies: outside the image, inside it, and behind the camera.
/// The first is configs/paper.yaml.
inline std::vector<ImageModel> image_models() {
  const auto transform = [](double w, double x, double y, double z, Eigen::Vector3d t) {
    return Rigid3{Eigen::Quaterniond(w, x, y, z).normalized(), t};
  };
  ImageModel paper;
  paper.camera = Camera{1280, 720, 1100, 1100, 639.5, 359.5, {}, {}};
  paper.marker.diameter_m = 0.0084;
  paper.marker.bands_upper_m = {0.005, 0.005, 0.025};
  paper.marker.bands_lower_m = {0.014, 0.014, 0.007};
  paper.camera_from_rcm =
      transform(0.647311937403, 0.683756495442, 0.180213914393, 0.284582599073, {-0.0623, -0.0494, 0.09});

  ImageModel inside = paper;  // non-square pixels, a wide lens, the RCM within the image
  inside.camera = Camera{1920, 1080, 1050, 1010, 955, 548, {-0.3, 0.1, 0, 0, 0}, {}};
  inside.marker.diameter_m = 0.005;
  inside.marker.bands_upper_m = {0.012, 0.006, 0.004};
  inside.marker.bands_lower_m = {0.003, 0.003, 0.016};
  inside.marker.seam_rad = 2.5;
  inside.camera_from_rcm = transform(0.6, 0.1, 0.75, -0.2, {-0.02, 0.015, 0.11});

  ImageModel behind = paper;  // ports side by side: the RCM behind the focal plane
  behind.marker.seam_rad = -1;
  behind.camera_from_rcm = transform(0.55, -0.5, 0.5, 0.4, {0.05, 0.03, -0.02});
  return {paper, inside, behind};
}

/// A configuration whose marker lies within the ideal image, at a sensible distance; phi is anywhere but at the poles.
inline JointVector visible_configuration(const ImageModel& model, Random& random) {
  while (true) {
    const double depth_m = random.uniform(0.05, 0.16);
    const Eigen::Vector3d proximal = depth_m * model.camera.ray_from_ideal({random.uniform(0, model.camera.width_px),
                                                                            random.uniform(0, model.camera.height_px)});
    auto q = configuration_through(model.camera_from_rcm, proximal);
    if (!q || q->rho_m < 0.02 || std::sin(q->phi_rad) < 0.05) continue;
    q->psi_rad = random.uniform(-pi, pi);
    const auto point = feature_map(model, *q);
    if (!point || point->f[2] < 40 || point->f[1] < 5) continue;
    if (model.camera.contains(point->ideal_px[0]) && model.camera.contains(point->ideal_px[3])) return *q;
  }
}

}  // namespace lapservo::testing
