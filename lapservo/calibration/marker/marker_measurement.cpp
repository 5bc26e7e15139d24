#include "lapservo/calibration/marker/marker_measurement.h"

#include <utility>

#include <fmt/format.h>

#include "lapservo/calibration/check/frame_diagnosis.h"
#include "lapservo/calibration/registration/seam_registration.h"
#include "lapservo/core/error.h"

namespace lapservo::internal {

MarkerMeasurement measure_marker(const Rig& rig, std::size_t index, const FrameRecording& recording,
                                 const std::optional<JointsOfTurn>& joints, const JobWatch& watch) {
  constexpr int enough = 400;  // frames of a video lie close together: more of them add no information
  const Instrument& instrument = rig.instruments[index];
  KeyFrames key_frames(rig, index);
  FrameDiagnosis diagnosis(rig);
  MarkerMeasurement measured;
  measured.read =
      read_frames(recording, rig, every_of(recording.source, enough), watch, [&](const cv::Mat& bgr, double time_s) {
        const int before = key_frames.found();
        key_frames.add(bgr, time_s);
        if (key_frames.found() == before) diagnosis.add(bgr, {});
        return fmt::format(", {} in {}", instrument.name, key_frames.found());
      });
  measured.found = key_frames.found();
  if (measured.read.stopped) return measured.calibration.refusal = "stopped", measured;
  if (measured.found == 0) {
    measured.calibration.refusal =
        fmt::format("{} is in none of {} frames{}: look at the rig's hues_deg and diameter_m{}", instrument.name,
                    measured.read.looked_at, measured.read.remark_on_damaged(), diagnosis.cause());
    return measured;
  }
  const auto progress = [&](int round, int most) {
    watch.tell(std::nullopt, round, fmt::format(" of at most {} rounds of fitting", most));
  };
  measured.calibration = calibrate_marker(rig, index, key_frames.take(), progress, watch.is_stopped);
  if (!measured.calibration.refusal.empty() && 2 * measured.found < measured.read.looked_at && !watch.stopped())
    measured.calibration.refusal += diagnosis.cause();
  if (measured.read.jpegs == measured.read.looked_at) measured.calibration.seam_may_lag = false;
  if (!joints || !measured.calibration.refusal.empty()) return measured;
  const SeamRegistration seam = register_seam(instrument, measured.calibration, joints->recording);
  if (!seam.refusal.empty()) throw InputError(joints->source, seam.refusal);
  measured.calibration.marker.seam_rad = seam.seam_rad;
  measured.calibration.marker.sigmas.seam_rad = seam.sigma_rad;
  return measured;
}

void expect_registration(const Instrument& instrument, const std::string& rig, const std::string& joints_option) {
  for (const auto& [there, key] : {std::pair{instrument.camera_from_rcm.has_value(), "camera_from_rcm"},
                                   {instrument.joints.has_value(), "joints"}})
    if (!there)
      throw InputError(
          rig, fmt::format("{} needs {} of {}, which the rig lacks: leave it out, or calibrate registration before",
                           joints_option, key, instrument.name));
}

std::vector<CalibratedNumber> calibrated_numbers(const Marker& before, const Marker& after, bool with_seam) {
  std::vector<CalibratedNumber> numbers;
  const auto add = [&](const std::string& name, double was, double is, double sigma) {
    numbers.push_back({name, 1e3 * was, 1e3 * is, 1e3 * sigma});
  };
  const MarkerSigmas& sigmas = after.sigmas;
  for (std::size_t i = 0; i < 3; ++i)
    add(fmt::format("bands_upper_m[{}] [mm]", i), before.bands_upper_m[i], after.bands_upper_m[i],
        (*sigmas.bands_upper_m)[i]);
  for (std::size_t i = 0; i < 3; ++i)
    add(fmt::format("bands_lower_m[{}] [mm]", i), before.bands_lower_m[i], after.bands_lower_m[i],
        (*sigmas.bands_lower_m)[i]);
  add("wrap_m [mm]", before.wrap_m, after.wrap_m, sigmas.wrap_m.value());
  add("skew_m [mm]", before.skew_m, after.skew_m, sigmas.skew_m.value());
  add("gap_rad [mrad]", before.gap_rad, after.gap_rad, sigmas.gap_rad.value());
  if (with_seam) add("seam_rad [mrad]", before.seam_rad, after.seam_rad, sigmas.seam_rad.value());
  return numbers;
}

}  // namespace lapservo::internal
