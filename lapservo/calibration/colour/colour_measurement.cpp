#include "lapservo/calibration/colour/colour_measurement.h"

#include <cmath>
#include <string>

#include <fmt/format.h>
#include <opencv2/core.hpp>

#include "lapservo/calibration/check/frame_diagnosis.h"
#include "lapservo/core/rounded_sigma.h"

namespace lapservo::internal {

ColourMeasurement measure_colour(const Rig& rig, std::size_t instrument, const FrameRecording& recording,
                                 bool replace_response, const JobWatch& watch) {
  constexpr std::size_t most = 48;
  SpreadFrames kept(most);
  const bool live = recording.source.kind() == FrameSource::Kind::live;
  ColourMeasurement measured;
  measured.read = read_frames(recording, rig, live ? 10 : 1, watch, [&](const cv::Mat& bgr, double) {
    kept.add(bgr);
    return fmt::format(", {} kept", kept.frames().size());
  });
  if (measured.read.stopped) return measured.calibration.refusal = "stopped", measured;
  measured.frames = kept.frames().size();
  const bool is_named = recording.source.is_srgb();
  const bool keep_response = is_named || (!replace_response && rig.camera.response.sigma.has_value());
  int step = 0;
  measured.calibration = calibrate_colour(rig, instrument, kept.frames(), keep_response, [&](const std::string& what) {
    watch.tell(std::nullopt, ++step, ": " + what);
  });
  if (is_named) measured.calibration.response_found = "as it is: the recording names how it encodes light";
  if (!measured.calibration.refusal.empty() &&
      2 * measured.calibration.found_before < static_cast<int>(measured.frames)) {
    FrameDiagnosis diagnosis(rig);
    for (const cv::Mat& bgr : kept.frames()) diagnosis.add(bgr, {});
    measured.calibration.refusal += diagnosis.cause();
  }
  return measured;
}

std::vector<CalibratedNumber> calibrated_numbers(const Marker& before, const ColourCalibration& calibration) {
  std::vector<CalibratedNumber> numbers;
  for (std::size_t i = 0; i < 3; ++i)
    numbers.push_back({fmt::format("hues_deg[{}] [deg]", i), before.hues_deg[i], calibration.hues_deg[i],
                       calibration.sigma_hues_deg[i]});
  return numbers;
}

Rig with_colour(Rig rig, std::size_t instrument, const ColourCalibration& calibration) {
  Marker& marker = rig.instruments[instrument].marker;
  marker.sigmas.hues_deg.emplace();
  for (std::size_t i = 0; i < 3; ++i) {
    marker.hues_deg[i] = std::round(100 * calibration.hues_deg[i]) / 100;
    (*marker.sigmas.hues_deg)[i] = rounded_sigma(calibration.sigma_hues_deg[i]);
  }
  if (calibration.response) rig.camera.response = *calibration.response, rig.camera_file.clear();
  return rig;
}

}  // namespace lapservo::internal
