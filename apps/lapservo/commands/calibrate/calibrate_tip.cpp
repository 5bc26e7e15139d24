#include <cmath>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "apps/lapservo/cli/subcommands.h"
#include "apps/lapservo/commands/calibrate/calibrate_inputs.h"
#include "apps/lapservo/inputs/frame_input.h"
#include "apps/lapservo/inputs/joint_input.h"
#include "lapservo/calibration/camera/camera_measurement.h"
#include "lapservo/calibration/registration/registration_measurement.h"
#include "lapservo/calibration/tip/tip_fit.h"
#include "lapservo/calibration/tip/touch_measurement.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/csv.h"
#include "lapservo/core/error.h"
#include "lapservo/core/rounded_covariance.h"
#include "lapservo/core/statistics.h"

namespace lapservo::app {
using namespace internal;
namespace {

struct CalibrateTipOptions : CalibrateOptions {
  std::string pivot, touches, calliper;
  BoardOptions board;
};

TipCalibration by_pivot(const CalibrateTipOptions& options, const Rig& rig, std::size_t index, const Tool& tool) {
  const auto frames = open_frames(options.input, options, &rig.camera);
  // A wrist has to stand still: whatever the delay, its readings are the same.
  const WristInput wrist = find_wrist_input(options, rig, index, *frames, false);
  const MeasuredPoses poses = poses_in_frames(rig, index, {*frames, options.input, options.deinterlace}, watched_job());
  if (!poses.none.empty()) return {.refusal = poses.none};
  say_complaint(options.input, poses.read.complaint);
  if (tool.wrist.empty()) return pivoted_tip(tool, std::vector<double>(), poses.all);
  if (!wrist.readings) {
    std::printf("the joints of the wrist count as 0 rad: %s has no readings that are theirs for certain\n",
                options.input.c_str());
    return pivoted_tip(tool, std::vector<double>(tool.wrist.size(), 0), poses.all);
  }
  std::vector<TipSighting> sightings;
  for (const TimedPose& pose : poses.all)
    if (auto wrist_rad = wrist_at(wrist, rig.instruments[index], pose.time_s); !wrist_rad.empty())
      sightings.push_back({pose, std::move(wrist_rad)});
  return pivoted_tip(tool, sightings);
}

TipCalibration by_touch(const CalibrateTipOptions& options, const Rig& rig, std::size_t index, const Tool& tool) {
  if (options.board.corners.empty() || !options.board.square_mm)
    throw InputError("--touch", "needs --board and --square-mm, for example --board 9x6 --square-mm 5");
  const Board board = board_of(options.board);
  const auto open = [&](const std::string& image) { return open_frames(image, options, &rig.camera); };
  const auto measured = measure_touches(rig, index, tool, board, read_touches(options.input, board, tool), open,
                                        options.deinterlace, watched_job());
  for (const std::string& image : measured.without_marker) std::printf("left out: %s\n", image.c_str());
  return measured.calibration;
}

// MM[:SIGMA].
TipCalibration by_calliper(const CalibrateTipOptions& options, const Rig& rig, std::size_t index, const Tool& tool) {
  constexpr double usual_sigma_mm = 0.1, most_mm = 500;
  const std::size_t colon = options.calliper.find(':');
  const auto distance_mm = parse_finite(options.calliper.substr(0, colon));
  const auto sigma_mm = colon == std::string::npos ? usual_sigma_mm : parse_finite(options.calliper.substr(colon + 1));
  if (!distance_mm || !sigma_mm || *distance_mm < 0 || *distance_mm > most_mm || !(*sigma_mm > 0) || *sigma_mm > 5)
    throw InputError("--calliper", "distance", options.calliper,
                     "0 to 500 mm, or with its standard deviation of 5 mm at most MM:SIGMA, for example 21.4:0.1");
  return {.tool = placed_by_calliper(tool, rig.instruments[index].marker, 1e-3 * *distance_mm, 1e-3 * *sigma_mm)};
}

void print(const TipCalibration& calibration) {
  const Tool& tool = calibration.tool;
  const TipInMarker tip = tip_in_marker(tool, std::vector<double>(tool.wrist.size(), 0));
  std::printf("\n%-36s %10s   %8s\n", "", "", "sigma");
  const auto line = [](const std::string& name, double value, double variance, double unit) {
    std::printf("  %-34s %10.4f   %8.4f\n", name.c_str(), unit * value, unit * std::sqrt(variance));
  };
  for (Eigen::Index i = 0; i < 3; ++i)
    line(fmt::format("tip in the marker's frame {} [mm]", "xyz"[i]), tip.marker_from_tip.translation[i],
         tip.of_place(i, i), 1e3);
  const auto& covariance = tool.place->covariance;
  if (!tool.wrist.empty()) line("azimuth of the wrist [degrees]", tool.place->azimuth_rad, covariance(3, 3), 180 / pi);
  for (std::size_t i = 0; i < tool.wrist.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(4 + i);
    line(fmt::format("offset of {} [degrees]", tool.wrist[i].name), tool.wrist[i].offset_rad, covariance(k, k),
         180 / pi);
  }
  if (!calibration.misses_m.empty())
    std::printf("\nthe tip misses its point by %.3f mm rms in %zu images, %.1f times their noise\n",
                1e3 * rms(calibration.misses_m), calibration.misses_m.size(), calibration.noise);
  if (!calibration.fault.empty()) print_faults({calibration.fault});
  if (!tool.wrist.empty() && !calibration.with_offsets)
    std::printf("azimuth and offsets of the wrist are as they were: --touch with a bent wrist measures them\n");
}

int calibrate_tip(CalibrateTipOptions options, const Command& command) {
  if (!options.pivot.empty() + !options.touches.empty() + !options.calliper.empty() != 1)
    throw InputError("calibrate tip", "takes one way to measure it, expected --pivot, --touch or --calliper");
  if (options.touches.empty())
    command.refuse({"--board", "--square-mm", "--aruco", "--marker-mm"}, "is of a board, expected --touch with it");
  if (!options.calliper.empty())
    command.refuse(frame_option_names(), "is of images, expected --pivot or --touch with it");
  if (options.pivot.empty()) command.refuse({"--joint-topic"}, "is of a bag, expected --pivot with it");
  options.input = options.pivot + options.touches;  // the one that is given
  InstrumentJob job(options, false);
  job.begin();
  const Tool tool = job.instrument().tool.value_or(Tool{});
  say_axis_tip(job.instrument());
  const auto way = !options.pivot.empty() ? by_pivot : !options.touches.empty() ? by_touch : by_calliper;
  const TipCalibration calibration = way(options, job.rig, job.index, tool);
  if (!calibration.refusal.empty()) return job.refuse(calibration.refusal);
  print(calibration);
  Tool& measured = job.rig.instruments[job.index].tool.emplace(calibration.tool);
  measured.place->covariance = rounded_covariance(measured.place->covariance);
  return job.write();
}

}  // namespace

void add_calibrate_tip(Command parent) {
  auto [command, options] = parent.add_subcommand<CalibrateTipOptions>(
      "tip", "Measure where the instrument ends: the tip in the marker's frame, and a wrist's place behind it.",
      calibrate_tip);
  command.add_option(
      "--pivot", options.pivot,
      "The tip rests in a dimple, its wrist straight, while the shaft is tilted to all sides and rolled: "
      "a folder, a video, a bag (which brings the wrist's readings along), a camera or a stream of 20 s");
  command.add_option("--touch", options.touches,
                     "CSV of images of touches: file, column and row of the inner corner of a board that the tip is "
                     "on, and a column in rad for each joint of the wrist; an image without column and row shows the "
                     "board alone");
  command.add_option("--calliper", options.calliper,
                     "MM[:SIGMA]: distance of the marker's distal edge from the wrist's axis, or from a straight "
                     "tool's tip, by callipers; sigma is 0.1 mm if not given");
  add_board_options(command, options.board, false);
  add_joint_topic_option(command, options.joint_topic);
  add_calibrate_options(command, options);
  command.footer(
      "The rig's camera and marker must be calibrated; a rig without a tool gets a straight one. With --pivot, tilt "
      "by\n"
      "20 degrees or more to all sides; with --touch, touch 5 corners or more (10 with the wrist bent differently),\n"
      "the shaft tilted and rolled differently.\n"
      "Example:\n  lapservo calibrate tip --pivot pivot.mp4 --rig rig.yaml --out rig.yaml");
}

}  // namespace lapservo::app
