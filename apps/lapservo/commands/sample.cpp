#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <string>
#include <system_error>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "apps/lapservo/cli/interrupt.h"
#include "apps/lapservo/cli/output_folder.h"
#include "apps/lapservo/cli/progress.h"
#include "apps/lapservo/cli/subcommands.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/atomic_file.h"
#include "lapservo/core/error.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/io/image_file.h"
#include "lapservo/io/video/video_writer.h"
#include "lapservo/rig/joint_conversion.h"
#include "lapservo/rig/rig_writer.h"
#include "lapservo/sim/boards.h"
#include "lapservo/sim/endoscope.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/renderer.h"
#include "lapservo/sim/tissue.h"

namespace lapservo::app {
using namespace internal;
namespace {
namespace fs = std::filesystem;

constexpr int boards = 12, turn_images = 48, swing_images = 100;
constexpr double image_fps = 8, video_fps = 30, swing_s = swing_images / image_fps;
constexpr int video_frames = static_cast<int>(swing_s * video_fps);
const double delay_s = EndoscopeConfig().latency_s;  // so that the simulator's camera is as late as the rig found here
constexpr std::uint64_t seed = 3;
constexpr std::uintmax_t needed_bytes = 256 << 20;

// Data sheets, callipers, and the bands that `marker design` prints for them.
constexpr auto designed_rig = R"(camera:
  image_width: 960
  image_height: 540
  camera_matrix: {rows: 3, cols: 3, data: [800, 0, 479.5, 0, 800, 269.5, 0, 0, 1]}
instruments:
  - name: PSM1
    marker:
      diameter_m: 0.0084
      hues_deg: [90, 180, 270]
      bands_upper_m: [0.0068355, 0.0078645, 0.0103]
      bands_lower_m: [0.01023, 0.01177, 0.003]
      seam_rad: 0
    joints:
      names: [yaw, pitch, insertion, roll]
      sign: [1, 1, 1, 1]
      offset: [0, 0, 0, 0]
)";

// Limits of the simulated arm, in the order of the rig's joints.
constexpr const char* joint_limits = R"(lower: [-1.5, -1.5, 0.01, -7]
upper: [1.5, 1.5, 0.24, 7]
rate: [0.4, 0.4, 0.04, 1.5]
acceleration: [2, 2, 0.2, 7.5]
)";

// The same as made and mounted: another lens, other inks, a print cut by hand, an arm with encoders of its own.
Rig mounted(Rig rig) {
  rig.camera.fx_px = rig.camera.fy_px = 825;
  rig.camera.cx_px = 474.3, rig.camera.cy_px = 272.8;
  Instrument& instrument = rig.instruments[0];
  instrument.marker.hues_deg = {116, 209, 294};
  const std::array<double, 3> upper_m{0.14e-3, -0.09e-3, -0.05e-3}, lower_m{-0.1e-3, 0.1e-3, 0};
  for (std::size_t i = 0; i < 3; ++i)
    instrument.marker.bands_upper_m[i] += upper_m[i], instrument.marker.bands_lower_m[i] += lower_m[i];
  const Eigen::Vector3d rcm_m(-0.078, 0.067, 0.059), marker_m(-0.02, 0.01, 0.1);
  instrument.camera_from_rcm = Rigid3{rotation_between(Eigen::Vector3d::UnitX(), marker_m - rcm_m), rcm_m};
  instrument.joints->sign = {1, -1, 1, 1};
  instrument.joints->offset = {0, 1.5, -0.012, 0.4};
  instrument.image_delay_s = delay_s;
  return rig;
}

// About the axis by a little more than a full rotation.
JointVector turning(double time_s) {
  return {0.02 * std::sin(time_s), 1.57, 0.089, -3 + 1.05 * two_pi * time_s * image_fps / turn_images};
}

JointVector swinging(double time_s) {
  return {0.22 * std::sin(0.9 * time_s), 1.57 + 0.18 * std::sin(1.3 * time_s + 1),
          0.089 + 0.008 * std::sin(0.7 * time_s), 3.3 * std::sin(0.6 * time_s + 2)};
}

class Sample {
 public:
  explicit Sample(const fs::path& path)
      : path_(path),
        rig_(parse_rig(designed_rig, "rig.yaml")),
        truth_(mounted(rig_)),
        folder_(empty(path), rig_, {}, false, needed_bytes) {}

  void make() {
    write_file(folder_ / "rig.yaml", designed_rig);
    write_file(folder_ / "truth.yaml", rig_yaml(truth_));
    write_file(folder_ / "joint_limits.yaml", joint_limits);
    show_boards();
    record("turn", turn_images, turning);
    record("swing", swing_images, swinging);
    film();
    folder_.commit();
  }

 private:
  static const fs::path& empty(const fs::path& path) {
    std::error_code error;
    if (fs::exists(path, error) && !fs::is_empty(path, error))
      throw InputError(path.string(), "is not empty, expected a new or an empty folder");
    return path;
  }

  void show_boards() {
    fs::create_directory(folder_ / "boards");
    for (const Rigid3& pose : board_poses({}, truth_.camera, boards, seed)) {
      write_image(folder_ / fmt::format("boards/{:02}.png", done_),
                  render_board({}, truth_.camera, pose, seed + done_));
      count();
    }
  }

  void show_motion(int frames, double fps, JointVector (*q_at)(double time_s),
                   const std::function<void(int, const cv::Mat&)>& show) {
    for (int i = 0; i < frames; ++i) {
      show(i, renderer_.render({placement_of(truth_.instruments[0], q_at(i / fps))}, seed + done_));
      count();
    }
  }

  // Images in a folder of this name, and NAME_joints.csv by the arm's clock.
  void record(const std::string& name, int images, JointVector (*q_at)(double time_s)) {
    fs::create_directory(folder_ / name);
    show_motion(images, image_fps, q_at, [&](int i, const cv::Mat& image) {
      write_image(folder_ / fmt::format("{}/{:04}.png", name, i), image);
    });
    std::string joints = "time_s,yaw,pitch,insertion,roll\n";
    for (double time_s = -0.5; time_s < images / image_fps + 0.5; time_s += 0.02) {
      const Eigen::Vector4d positions = joints_from_q(*truth_.instruments[0].joints, q_at(time_s).vector());
      joints += fmt::format("{:.6g},{:.9g}\n", time_s - delay_s, fmt::join(positions, ","));
    }
    write_file(folder_ / (name + "_joints.csv"), joints);
  }

  void film() {
    VideoWriter video(folder_ / "video.mp4", video_fps, VideoUse::measured);
    show_motion(video_frames, video_fps, swinging, [&](int, const cv::Mat& image) { video.add(image); });
    video.commit();
  }

  void count() {
    if (interrupted()) throw InputError(path_.string(), "was interrupted: nothing is written");
    progress_.show(++done_, "");
  }

  const fs::path path_;
  const Rig rig_, truth_;
  OutputFolder folder_;
  Renderer renderer_{truth_.camera, shafts_of(truth_),
                     make_tissue(truth_.camera.width_px, truth_.camera.height_px, seed)};
  int done_ = 0;
  Progress progress_{boards + turn_images + swing_images + video_frames};
};

int run(const std::string& folder) {
  watch_for_interrupts();
  Sample(folder).make();
  std::printf("boards, a rotation and a swing with their joints, a video and a first rig.yaml: %s\n", folder.c_str());
  if (!video_remark().empty()) std::printf("the video is %s\n", video_remark().c_str());
  return 0;
}

}  // namespace

void add_sample(Command app) {
  auto [command, folder] =
      app.add_subcommand<std::string>("sample", "Render the recordings of a first calibration, for the tutorial.", run);
  command.add_option("folder", folder, required(), "New or empty");
  command.footer(
      "rig.yaml     camera and marker by data sheets and callipers, to begin from\n"
      "boards/      a chessboard of 9x6 inner corners and squares of 5 mm\n"
      "turn/        the instrument rotated about its axis, 8 images a second; turn_joints.csv has its joints\n"
      "swing/       the instrument swung in all four joints, the same; swing_joints.csv has its joints\n"
      "video.mp4    the swing as a camera films it: H.264 4:4:4, 30 images a second\n"
      "truth.yaml   the rig that calibration should find\n"
      "joint_limits.yaml  limits of the simulated arm's joints, for servo --joint-limits\n"
      "Example:\n  lapservo sample morning");
}

}  // namespace lapservo::app
