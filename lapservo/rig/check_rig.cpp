#include "lapservo/rig/check_rig.h"

#include <cmath>
#include <string>

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
  if (camera.covariance) sum += camera.covariance->sum();
  if (!std::isfinite(sum)) throw InputError("rig", "camera: centre, distortion or covariance", "not finite", "numbers");
}

}  // namespace

std::optional<FieldProblem> hues_problem(const Marker& marker, const Instrument& other) {
  if (same_colour_order(marker, other.marker))
    return FieldProblem{"hues_deg", "like that of " + other.name + " in the middle band and one more",
                        "another order of colours: it is what names the instrument"};
  if (reversed_colour_order(marker, other.marker))
    return FieldProblem{"hues_deg", "like that of " + other.name + " reversed in the middle band and one more",
                        "another middle colour: turned end for end, the two look the same"};
  return std::nullopt;
}

void check_rig(const Rig& rig) {
  check_camera(rig.camera);
  const std::size_t count = rig.instruments.size();
  if (count == 0 || count > most_instruments)
    throw InputError("rig", "instruments", std::to_string(count), "one to eight");
  for (std::size_t i = 0; i < count; ++i) {
    const Instrument& instrument = rig.instruments[i];
    const std::string where = instrument.name + ".";
    for (std::size_t j = 0; j < i; ++j)
      if (const auto problem = hues_problem(instrument.marker, rig.instruments[j]))
        throw InputError("rig", where + "marker." + problem->field, problem->value, problem->expectation);
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
