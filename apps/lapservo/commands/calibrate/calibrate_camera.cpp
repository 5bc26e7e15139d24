#include <algorithm>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "apps/lapservo/cli/interrupt.h"
#include "apps/lapservo/cli/subcommands.h"
#include "apps/lapservo/commands/calibrate/calibrate_inputs.h"
#include "apps/lapservo/inputs/frame_input.h"
#include "apps/lapservo/inputs/input_files.h"
#include "lapservo/calibration/camera/camera_measurement.h"
#include "lapservo/core/atomic_file.h"
#include "lapservo/core/error.h"
#include "lapservo/io/frame_source.h"
#include "lapservo/rig/rig_writer.h"

namespace lapservo::app {
using namespace internal;
namespace {

void check_files(const CalibrateCameraOptions& options, const std::optional<Rig>& rig) {
  if (options.rig.empty() && options.out.empty() && options.camera_info.empty())
    throw InputError("calibrate camera", "has no place for its result, expected --rig, --out or --camera-info");
  InputFiles files;
  for (const std::string& input : options.inputs) files.add_recording(input);
  for (const std::string& place : {options.rig_out(), options.camera_info}) files.refuse_as_output(place);
  refuse_shared_place({options.rig_out(), options.camera_info});
  for (const std::string& place : {options.camera_info, rig ? std::string() : options.out}) {
    refuse_other_kind(place, ".yaml");
    refuse_part_over_rig(place, "camera");
  }
  if (!rig) return;
  refuse_rig_over_part(options.rig_out());
  files.add_rig(options.rig, *rig);
  files.refuse_as_output(options.camera_info);
}

void look_at(const std::string& input, const CalibrateCameraOptions& options, const Camera* camera,
             BoardRecordings& recordings) {
  const auto source = open_frames(input, options, camera);
  if (source->kind() == FrameSource::Kind::live && &input != &options.inputs.back())
    throw InputError(input, "is a camera, whose Ctrl-C ends what comes after it, expected it as the last input");
  recordings.look_at(*source, input, watched_job(),
                     [](const std::string& wanted) { std::fprintf(stderr, "lapservo: %s\n", wanted.c_str()); });
  say_complaint(input, recordings.read().complaint);
}

void print_result(const CameraCalibration& calibration) {
  const std::vector<BoardView>& views = calibration.views;
  const Camera& camera = calibration.camera;
  std::printf("%zu views; edges miss the fit by %.3f px rms, %.1f times their noise\n", views.size(),
              calibration.rms_px, calibration.noise);
  for (std::size_t i = 0; i < views.size(); ++i)
    fmt::print("  {:40} {:4} corners   {}\n", views[i].name, views[i].corners.size(),
               calibration.view_rms_px[i] ? fmt::format("{:.3f} px", *calibration.view_rms_px[i])
                                          : "no edge can be measured, so it does not count");
  for (const CalibratedNumber& n : calibrated_numbers(Camera{}, calibration))
    std::printf("  %-24s %12.6f   sigma %.6f\n", n.name.c_str(), n.after, n.sigma);
  print_faults(calibration.faults);
  if (!calibration.response) {
    std::printf("response: unchanged, these images don't determine it\n");
    return;
  }
  const ResponseFit& response = *calibration.response;
  std::printf("response: %s, seen from values of %.0f to %.0f, sigma %.4f of the full value\n",
              camera.response.kind == Response::Kind::table ? "a table" : response.nearest.c_str(), 255 * response.low,
              255 * response.high, response.sigma);
  if (response.sharpening > 0)
    std::printf("the images are sharpened (by %.2f over %.1f px): switch it off where the camera can\n",
                response.sharpening, response.sharpening_px);
}

void write_results(const CalibrateCameraOptions& options, std::optional<Rig> rig, const RigAsRead& read,
                   const Camera& camera) {
  std::string rig_text;
  if (rig) {
    read.expect_unchanged(options.rig_out());
    rig->camera = camera, rig->camera_file.clear();
    rig_text = measured_rig_yaml(*rig, options.rig_out());
  }
  for (const std::string& place : {options.camera_info, rig ? std::string() : options.out}) {
    if (place.empty()) continue;
    write_file(place, camera_yaml(camera));
    std::printf("camera: %s\n", place.c_str());
  }
  if (!rig) return;
  write_file(options.rig_out(), rig_text);
  std::printf("rig: %s\n", options.rig_out().c_str());
}

}  // namespace

int calibrate_camera(const CalibrateCameraOptions& options) {
  const Board board = board_of(options.board);
  const RigAsRead read(options.rig);
  std::optional<Rig> rig;
  if (!options.rig.empty()) rig = load_rig(options.rig);
  check_files(options, rig);
  watch_for_interrupts();

  const Camera before = rig ? rig->camera : Camera{};
  BoardRecordings recordings(board, options.views, rig, options.deinterlace);
  for (const std::string& input : options.inputs) {
    look_at(input, options, rig ? &rig->camera : nullptr, recordings);
    if (recordings.read().stopped) break;
  }
  const auto without_board = recordings.without_board();
  const CameraCalibration calibration = measure_camera(board, std::move(recordings), before, watched_job());
  if (!calibration.refusal.empty()) return refuse(options.input(), calibration.refusal + "; nothing was written");
  for (const std::string& name : without_board) std::printf("left out, there is no board: %s\n", name.c_str());
  print_result(calibration);
  if (!calibration.advice.empty()) std::printf("better still: %s\n", calibration.advice.c_str());
  write_results(options, rig, read, measured_camera(calibration));
  if (rig && std::any_of(rig->instruments.begin(), rig->instruments.end(),
                         [](const Instrument& instrument) { return instrument.camera_from_rcm.has_value(); }))
    std::printf("camera_from_rcm is as it was: where it was measured with another camera, measure it again\n");
  return 0;
}

void add_calibrate_camera(Command parent) {
  auto [command, options] = parent.add_subcommand<CalibrateCameraOptions>(
      "camera", "Measure a camera with a chessboard: matrix, distortion, lateral chromatic aberration, response.",
      calibrate_camera);
  command.add_option("input", options.inputs, required(),
                     "Images of the board from different sides: images, folders, a video, a bag, a camera or a stream");
  add_image_topic_option(command, options.image_topic);
  add_video_options(command, options);
  command.add_flag("--deinterlace", options.deinterlace, "For interlaced video: measure the field of the even rows");
  add_board_options(command, options.board, true);
  command.add_option("--rig", options.rig, "The rig that has this camera: its response is where the search starts");
  command.add_option("--out", options.out,
                     "With --rig: the rig to write, else the rig itself is replaced. Without: the camera's file");
  command.add_option("--camera-info", options.camera_info,
                     "The camera alone, as a ROS camera_info, which a rig's camera may name");
  command.add_option("--views", options.views, whole_between(4, 200),
                     "Views to choose from a video or a camera at most");
  command.footer(
      "Show the whole board, flat and sharp, in 12 or more images: in every part of the image, near, and tilted by\n"
      "20 to 40 degrees to all sides; fix exposure and focus. A camera is looked at until its views suffice, or "
      "Ctrl-C.\n"
      "All numbers are written with one standard deviation each (sigma_...), the response's where the images determine "
      "it.\n"
      "Example:\n  lapservo calibrate camera boards/ --board 9x6 --square-mm 5 --rig rig.yaml");
}

}  // namespace lapservo::app
