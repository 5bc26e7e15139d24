#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "apps/lapservo/calibrate_inputs.h"
#include "apps/lapservo/camera_report.h"
#include "apps/lapservo/frame_input.h"
#include "apps/lapservo/input_files.h"
#include "apps/lapservo/interrupt.h"
#include "apps/lapservo/progress.h"
#include "apps/lapservo/subcommands.h"
#include "lapservo/calibration/camera_calibration.h"
#include "lapservo/core/atomic_file.h"
#include "lapservo/core/error.h"
#include "lapservo/io/frame_source.h"
#include "lapservo/rig/rig_updater.h"
#include "lapservo/rig/rig_writer.h"

namespace lapservo::app {
using namespace internal;
namespace {
namespace fs = std::filesystem;

struct CameraOptions {
  std::vector<std::string> inputs;
  std::string rig, out, camera_info, board, dictionary, report, image_topic;
  double square_mm = 0;
  std::optional<double> marker_mm;
  std::size_t views = 30;

  // Where the rig goes; empty without one.
  const std::string& rig_out() const { return rig.empty() || !out.empty() ? out : rig; }
  std::string input() const {
    return inputs.size() == 1 ? inputs.front() : fmt::format("{} and others", inputs.front());
  }
};

Board board_of(const CameraOptions& options) {
  Board board;
  const char* const end = options.board.data() + options.board.size();
  const auto [times, first] = std::from_chars(options.board.data(), end, board.columns);
  bool read = first == std::errc() && times != end && (*times == 'x' || *times == 'X');
  if (read) {
    const auto [rest, second] = std::from_chars(times + 1, end, board.rows);
    read = second == std::errc() && rest == end;
  }
  const auto usual = [](int count) { return count >= 3 && count <= 50; };
  if (!read || !usual(board.columns) || !usual(board.rows))
    throw InputError("--board", "corners", options.board,
                     "COLUMNSxROWS of inner corners, 3 to 50 each, for example 9x6");
  board.square_m = 1e-3 * options.square_mm;
  board.dictionary = options.dictionary;
  if (options.dictionary.empty()) {
    if (options.marker_mm) throw InputError("--marker-mm", "is of a ChArUco board, expected --aruco with it");
    return board;
  }
  constexpr double usual_share = 0.75;
  board.marker_m = options.marker_mm ? 1e-3 * *options.marker_mm : usual_share * board.square_m;
  if (board.marker_m >= board.square_m)
    throw InputError("--marker-mm", "width", fmt::format("{}", *options.marker_mm),
                     fmt::format("less than a square's {} mm", options.square_mm));
  if (const std::string problem = board_problem(board); !problem.empty()) throw InputError("--aruco", problem);
  return board;
}

void check_files(const CameraOptions& options, const std::optional<Rig>& rig) {
  if (options.rig.empty() && options.out.empty() && options.camera_info.empty())
    throw InputError("calibrate camera", "has no place for its result, expected --rig, --out or --camera-info");
  InputFiles files;
  std::error_code error;
  for (const std::string& input : options.inputs) {
    files.add(input);
    if (fs::is_directory(input, error)) files.add_pictures_in(input);
  }
  std::vector<fs::path> places;
  for (const std::string& place : {options.rig_out(), options.camera_info, options.report}) {
    if (place.empty()) continue;
    files.refuse_as_output(place);
    const fs::path canonical = fs::weakly_canonical(place, error);
    if (std::find(places.begin(), places.end(), canonical) != places.end())
      throw InputError(place, "is the place for two results, expected a place for each");
    places.push_back(canonical);
  }
  if (!rig) return;
  files.add_rig(options.rig, *rig);
  files.refuse_as_output(options.camera_info), files.refuse_as_output(options.report);
}

struct Seen {
  int looked_at = 0, flawed = 0;
  std::vector<std::string> without_board;
  bool stopped = false;
};

// Every picture of a folder; of videos and cameras those that differ, a few a second.
void look_at(const std::string& input, const std::string& image_topic, BoardViews& views, std::optional<cv::Size>& size,
             std::string& whose, Seen& seen) {
  const auto source = open_frames(input, 30, image_topic);
  const bool pictures = source->kind() == FrameSource::Kind::image || source->kind() == FrameSource::Kind::folder;
  const bool live = source->kind() == FrameSource::Kind::live;
  const int every = pictures || live ? 1 : std::max(1, static_cast<int>(source->frames_per_second() / 4));
  Progress progress(source->frame_count());
  std::string said;
  int read = 0;
  while (!(seen.stopped = interrupted())) {
    const auto frame = source->next();
    if (!frame) break;
    const std::string name = frame->file.empty() ? fmt::format("frame {}", frame->index) : frame->file.string();
    if (!size) size = frame->bgr.size(), whose = name;
    check_size(*frame, input, *size, whose);
    if (read++ % every != 0) continue;
    if (frame->flaw) {
      ++seen.flawed;
      continue;
    }
    ++seen.looked_at;
    if (!views.add(name, frame->bgr, pictures) && pictures) seen.without_board.push_back(name);
    progress.show(read, fmt::format(", {} views", views.views().size()));
    if (!live) continue;
    const std::string wanted = views.views().empty() ? "show the board" : advice(views.views(), *size);
    if (wanted != said) std::fprintf(stderr, "lapservo: %zu views: %s\n", views.views().size(), wanted.c_str());
    said = wanted;
    if (views.full() || (wanted.empty() && views.views().size() >= 12)) break;
  }
  // A camera is stopped when there are enough views: that is how its calibration ends.
  if (live) seen.stopped = false;
  say_complaint(input, *source);
}

int refuse(const CameraOptions& options, const std::string& why) {
  std::fprintf(stderr, "lapservo: %s: %s; nothing was written\n", options.input().c_str(), why.c_str());
  return 1;
}

void print_result(const std::vector<BoardView>& views, const CameraCalibration& calibration) {
  const Camera& camera = calibration.camera;
  const CameraSigmas& sigmas = calibration.sigmas;
  std::printf("%zu views; edges miss the fit by %.3f px rms\n", views.size(), calibration.rms_px);
  for (std::size_t i = 0; i < views.size(); ++i)
    std::printf("  %-40s %4zu corners   %.3f px\n", views[i].name.c_str(), views[i].corners.size(),
                calibration.view_rms_px[i]);
  const auto row = [](const char* name, double value, double sigma) {
    std::printf("  %-24s %12.6f   sigma %.6f\n", name, value, sigma);
  };
  row("fx [px]", camera.fx_px, sigmas.fx_px), row("fy [px]", camera.fy_px, sigmas.fy_px);
  row("cx [px]", camera.cx_px, sigmas.cx_px), row("cy [px]", camera.cy_px, sigmas.cy_px);
  constexpr std::array names{"k1", "k2", "p1", "p2", "k3"};
  for (std::size_t i = 0; i < names.size(); ++i) row(names[i], camera.distortion[i], sigmas.distortion[i]);
  row("magnification of blue", camera.chromatic_aberration.blue, sigmas.blue);
  row("magnification of red", camera.chromatic_aberration.red, sigmas.red);
  if (!calibration.response) {
    std::printf("response: as it was, these pictures don't tell it\n");
    return;
  }
  const ResponseFit& response = *calibration.response;
  std::printf("response: %s, seen from values of %.0f to %.0f, sigma %.4f of the full value\n",
              camera.response.kind == Response::Kind::table ? "a table" : response.nearest.c_str(), 255 * response.low,
              255 * response.high, response.sigma);
  if (response.sharpening > 0)
    std::printf("the pictures are sharpened (by %.2f over %.1f px): switch it off where the camera can\n",
                response.sharpening, response.sharpening_px);
}

void write_results(const CameraOptions& options, const CameraCalibration& calibration) {
  const std::string fields = measured_camera_yaml(calibration.camera, calibration.sigmas);
  if (!options.camera_info.empty()) {
    write_file(options.camera_info, fields);
    std::printf("camera: %s\n", options.camera_info.c_str());
  }
  if (options.rig.empty()) {
    if (options.out.empty()) return;
    write_file(options.out, fields);
    std::printf("camera: %s\n", options.out.c_str());
    return;
  }
  write_file(options.rig_out(), updated_rig_yaml(options.rig, calibration.camera, calibration.sigmas));
  std::printf("rig: %s\n", options.rig_out().c_str());
}

int run_camera(const CameraOptions& options) {
  const Board board = board_of(options);
  std::optional<Rig> rig;
  if (!options.rig.empty()) rig = load_rig(options.rig);
  check_files(options, rig);
  watch_for_interrupts();

  BoardViews chosen(board, options.views);
  Seen seen;
  std::optional<cv::Size> size;
  std::string whose = "the rig's camera";
  if (rig) size = cv::Size(rig->camera.width_px, rig->camera.height_px);
  for (const std::string& input : options.inputs) {
    look_at(input, options.image_topic, chosen, size, whose, seen);
    if (seen.stopped) return refuse(options, "stopped");
  }
  const std::vector<BoardView> views = chosen.take();
  if (views.empty())
    return refuse(options,
                  fmt::format("the board is in none of {} pictures{}: look at --board (inner corners), show it "
                              "wholly, sharp, with a white margin",
                              seen.looked_at, seen.flawed ? fmt::format(" ({} are damaged)", seen.flawed) : ""));
  const Camera before = rig ? rig->camera : Camera{};
  CameraCalibration calibration;
  {
    Progress progress(std::nullopt);
    int step = 0;
    calibration =
        calibrate_camera(board, views, before, [&](const std::string& what) { progress.show(++step, ", " + what); });
  }
  if (!calibration.refusal.empty()) return refuse(options, calibration.refusal);
  for (const std::string& name : seen.without_board) std::printf("left out, there is no board: %s\n", name.c_str());
  print_result(views, calibration);
  if (const std::string more = advice(views, *size); !more.empty()) std::printf("better still: %s\n", more.c_str());
  if (!options.report.empty()) {
    write_camera_report(options.report, before, views, calibration);
    std::printf("report: %s\n", options.report.c_str());
  }
  write_results(options, calibration);
  if (rig && std::any_of(rig->instruments.begin(), rig->instruments.end(),
                         [](const Instrument& instrument) { return instrument.camera_from_rcm.has_value(); }))
    std::printf("camera_from_rcm is as it was: where it was measured with another camera, measure it again\n");
  return 0;
}

}  // namespace

void add_calibrate_camera(Command parent, Run& run_later) {
  auto options = std::make_shared<CameraOptions>();
  Command command = parent.add_subcommand(
      "camera", "Measure a camera with a chessboard: matrix, distortion, lateral chromatic aberration, response.");
  command
      .add_option("input", options->inputs,
                  "Pictures of the board from different sides: pictures, folders, a video, a bag, a camera or a stream")
      .required();
  add_image_topic_option(command, options->image_topic);
  command.add_option("--board", options->board, "Inner corners of the board, COLUMNSxROWS, for example 9x6").required();
  command.add_option("--square-mm", options->square_mm, "Width of a square").required().number_between(0.1, 1000.0);
  command.add_option("--aruco", options->dictionary, "For a ChArUco board: its markers' dictionary, as DICT_4X4_50");
  command.add_option("--marker-mm", options->marker_mm, "For a ChArUco board: a marker's width; else 3/4 of a square")
      .number_between(0.05, 1000.0);
  command.add_option("--rig", options->rig, "The rig that has this camera: its response is where the search starts");
  command.add_option("--out", options->out,
                     "With --rig: the rig to write, else the rig itself is replaced. Without: the camera's file");
  command.add_option("--camera-info", options->camera_info,
                     "The camera alone, as a ROS camera_info, which a rig's camera may name");
  command.add_option("--report", options->report, "HTML page: coverage, what edges miss the fit by, the response");
  command.add_option("--views", options->views, "Views to choose from a video or a camera at most")
      .shows_default()
      .whole_number_between(4, 200);
  command.footer(
      "Show the whole board, flat and sharp, in 12 or more pictures: in every part of the picture, near, and tilted "
      "by\n"
      "20 to 40 degrees to all sides; fix exposure and focus. A camera is looked at until its views suffice, or "
      "Ctrl-C.\n"
      "All numbers are written with one standard deviation each (sigma_...).\n"
      "Example:\n  lapservo calibrate camera boards/ --board 9x6 --square-mm 5 --rig rig.yaml --report camera.html");
  command.runs(run_later, [options] { return run_camera(*options); });
}

}  // namespace lapservo::app
