#include "lapservo/rig/check_rig.h"

#include <cmath>
#include <string>

#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace {

void check_camera(const Camera& camera) {
  const std::string size = std::to_string(camera.width_px) + "x" + std::to_string(camera.height_px);
  if (camera.width_px < 16 || camera.height_px < 16)
    throw InputError("rig", "camera: image size", size, "16 px and more");
  for (const double focal_px : {camera.fx_px, camera.fy_px})
    if (!(focal_px > 0) || !std::isfinite(focal_px))
      throw InputError("rig", "camera: focal length", std::to_string(focal_px), "above 0 px");
  double sum = camera.cx_px + camera.cy_px;
  for (const double coefficient : camera.distortion) sum += coefficient;
  if (!std::isfinite(sum)) throw InputError("rig", "camera: centre or distortion", "not finite", "numbers");
}

}  // namespace

void check_rig(const Rig& rig) {
  check_camera(rig.camera);
  if (rig.instruments.empty()) throw InputError("rig", "instruments", "none", "one and more");
  for (const Instrument& instrument : rig.instruments) {
    const std::string where = instrument.name + ".";
    if (const auto problem = marker_problem(instrument.marker))
      throw InputError("rig", where + "marker." + problem->field, problem->value, problem->expectation);
    const auto& transform = instrument.camera_from_rcm;
    if (transform && !(transform->translation.allFinite() && transform->rotation.coeffs().allFinite()))
      throw InputError("rig", where + "camera_from_rcm", "not finite", "numbers");
    if (instrument.registration_covariance && !instrument.registration_covariance->allFinite())
      throw InputError("rig", where + "camera_from_rcm.covariance", "not finite", "numbers");
  }
}

}  // namespace lapservo::internal
