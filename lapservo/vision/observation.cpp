#include "lapservo/vision/observation.h"

#include "lapservo/core/words.h"

namespace lapservo {
using namespace internal;

constexpr auto status_words = std::to_array<Word<Status>>({{Status::ok, "ok"},
                                                           {Status::no_marker, "no_marker"},
                                                           {Status::cut, "cut"},
                                                           {Status::occluded, "occluded"},
                                                           {Status::ambiguous, "ambiguous"},
                                                           {Status::poor_fit, "poor_fit"},
                                                           {Status::uncertain, "uncertain"},
                                                           {Status::marker_mismatch, "marker_mismatch"},
                                                           {Status::damaged, "damaged"},
                                                           {Status::interlaced, "interlaced"},
                                                           {Status::blended, "blended"}});
static_assert(names_all(status_words, Status::blended));

std::string_view to_string(Status status) {
  return word_of(status_words, status);
}

std::optional<Observation::Tip> tip_of(const Observation& seen, const Tool& tool, std::span<const double> wrist_rad) {
  const bool is_read = tool.wrist.empty() || !wrist_rad.empty();
  if (seen.status != Status::ok || !seen.marker || !tool.place || !is_read) return std::nullopt;
  const TipInMarker tip = tip_in_marker(tool, wrist_rad);
  const Rigid3& camera_from_marker = seen.marker->camera_from_marker;
  const TipInMarker exact{tip.marker_from_tip};
  const auto position_sigma_m = [](const TipInMarker::Covariance& covariance) {
    return std::sqrt(covariance.topLeftCorner<3, 3>().trace());
  };
  Observation::Tip result;
  result.camera_from_tip = camera_from_marker * tip.marker_from_tip;
  result.covariance = tip_covariance_in_camera(camera_from_marker, seen.marker->covariance, tip);
  result.sigma_shaft_m = position_sigma_m(tip_covariance_in_camera(camera_from_marker, seen.marker->covariance, exact));
  result.sigma_place_m = position_sigma_m(tip.of_place);
  result.sigma_readings_m = position_sigma_m(tip.of_readings);
  return result;
}

}  // namespace lapservo
