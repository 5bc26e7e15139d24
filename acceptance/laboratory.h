#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/calibration/camera/camera_calibration.h"
#include "lapservo/calibration/marker/marker_calibration.h"
#include "lapservo/calibration/marker/print_adjustment.h"
#include "lapservo/calibration/recording/joint_recording.h"
#include "lapservo/calibration/registration/timed_pose.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/io/frame_source.h"
#include "lapservo/io/video/video_writer.h"
#include "lapservo/rig/joint_conversion.h"
#include "lapservo/sim/boards.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/renderer.h"
#include "lapservo/sim/tissue.h"
#include "lapservo/testing/rigs.h"
#include "lapservo/testing/temporary_folder.h"
#include "lapservo/vision/tracker.h"

/// Laboratories that are drawn by a seed: a camera, an arm before it, its marker, and recordings like those of
/// `lapservo sample`. For tests.
namespace lapservo::laboratories {
using namespace internal;

// The seeds, each with its noise and its encoding.
struct Recording {
  std::uint64_t seed;
  double noise;
  bool compressed;
};

inline Recording usual_recording(std::uint64_t seed) {
  return {seed, seed % 2 != 0 ? 1.0 : 4.0, seed % 3 == 2};
}

struct UsualCamera {
  int width_px, height_px;
  double focal_px, k1;
};
inline constexpr std::array cameras{UsualCamera{960, 540, 825, 0}, UsualCamera{640, 480, 600, -0.2},
                                    UsualCamera{1280, 720, 1080, -0.1}, UsualCamera{720, 576, 690, 0.05}};

inline const Eigen::Vector3d marker_m(-0.02, 0.01, 0.1);  // in the middle of its motion

// A camera, an arm before it and its marker.
inline Rig laboratory(std::uint64_t seed) {
  Random random(seed);
  Rig rig = testing::paper_test_rig();
  const UsualCamera& usual = cameras[seed % cameras.size()];
  Camera& camera = rig.camera = Camera{};
  camera.width_px = usual.width_px, camera.height_px = usual.height_px;
  camera.fx_px = camera.fy_px = usual.focal_px * random.uniform(0.95, 1.05);
  camera.cx_px = usual.width_px / 2.0 + random.uniform(-8, 8);
  camera.cy_px = usual.height_px / 2.0 + random.uniform(-8, 8);
  camera.distortion[0] = usual.k1;
  rig.instruments.resize(1);
  Instrument& instrument = rig.instruments[0];
  const Eigen::Vector3d rcm_m(random.uniform(-0.09, -0.06), random.uniform(0.05, 0.08), random.uniform(0.05, 0.07));
  instrument.camera_from_rcm = Rigid3{rotation_between(Eigen::Vector3d::UnitX(), marker_m - rcm_m), rcm_m};
  const auto sign = [&] { return random.uniform() < 0.5 ? -1.0 : 1.0; };
  instrument.joints = Joints{{"yaw", "pitch", "insertion", "roll"},
                             {1, sign(), sign(), sign()},
                             {0, random.uniform(1.3, 1.7), random.uniform(-0.03, 0.03), random.uniform(-2, 2)}};
  instrument.image_delay_s = random.uniform(0.05, 0.2);
  return rig;
}

inline JointVector swinging(const Rig& rig, double time_s, std::uint64_t seed) {
  const double p = 0.7 * static_cast<double>(seed);
  const double reach_m = (marker_m - rig.instruments[0].camera_from_rcm->translation).norm();
  return {0.22 * std::sin(0.9 * time_s + p), 1.57 + 0.18 * std::sin(1.3 * time_s + 1 + 2 * p),
          reach_m + 0.008 * std::sin(0.7 * time_s + 3 * p), 3.3 * std::sin(0.6 * time_s + 2 + p)};
}

inline RenderOptions with_noise(double times) {
  RenderOptions options;
  options.sensor.read_noise *= times, options.sensor.shot_noise *= times * times;
  return options;
}

// Shows images with their times, as they are or out of a video.
inline void show(int count, double fps, bool compressed, const std::function<cv::Mat(int)>& image,
                 const std::function<void(const cv::Mat&, double)>& look) {
  if (!compressed) {
    for (int i = 0; i < count; ++i) look(image(i), i / fps);
    return;
  }
  const testing::TemporaryFolder folder;
  VideoWriter video(folder / "video.mp4", fps);
  for (int i = 0; i < count; ++i) video.add(image(i));
  video.commit();
  const auto source = open_frame_source((folder / "video.mp4").string(), fps);
  while (const auto frame = source->next()) look(frame->bgr, frame->time_s);
}

// Images of a board whose camera differs from image to image, or that are changed.
struct BoardDeparture {
  std::string name, cause;
  std::function<Camera(std::size_t, Camera)> camera = [](std::size_t, Camera c) { return c; };
  std::function<cv::Mat(std::size_t, const cv::Mat&)> image = [](std::size_t, const cv::Mat& bgr) { return bgr; };
};

// Calibrates by twelve images of a board.
inline CameraCalibration calibration_of_camera(const Recording& recording, const BoardDeparture& departure = {}) {
  constexpr int views = 12;
  const Board board{9, 6, 0.005};
  const Camera truth = laboratory(recording.seed).camera;
  BoardScene scene;
  scene.noise *= recording.noise;
  BoardViews shown(board, views);
  const auto poses = board_poses(scene, truth, views, 100 * recording.seed);
  for (std::size_t i = 0; i < poses.size(); ++i)
    shown.add(std::to_string(i),
              departure.image(i, render_board(scene, departure.camera(i, truth), poses[i], 1000 * recording.seed + i)),
              true);
  return calibrate_camera(board, shown.take(), {});
}

// Every boundary off by up to 0.25 mm, at either edge by itself; half of the prints with a gap.
inline Marker cut_by_hand(const Marker& nominal, std::uint64_t seed) {
  Random random(seed);
  PrintShape shape = PrintShape::of(nominal);
  const auto off_m = [&] { return random.uniform(-0.25e-3, 0.25e-3); };
  for (std::size_t k = 1; k < 4; ++k) shape.upper_m[k] += off_m();
  for (std::size_t k = 0; k < 4; ++k) shape.lower_m[k] += off_m();
  shape.gap_rad = random.uniform() < 0.5 ? 0 : 0.8e-3 / nominal.radius_m();
  return shape.on(nominal);
}

// Each number's error over its sigma, but for the gap's.
inline std::vector<double> errors_over_sigmas(const Marker& found, const Marker& truth) {
  std::vector<double> all{(found.wrap_m - truth.wrap_m) / *found.sigmas.wrap_m,
                          (found.skew_m - truth.skew_m) / *found.sigmas.skew_m};
  for (std::size_t i = 0; i < 3; ++i) {
    all.push_back((found.bands_upper_m[i] - truth.bands_upper_m[i]) / (*found.sigmas.bands_upper_m)[i]);
    all.push_back((found.bands_lower_m[i] - truth.bands_lower_m[i]) / (*found.sigmas.bands_lower_m)[i]);
  }
  return all;
}

// Calibrates a rig by a turn there and back. The true marker may change in between.
inline MarkerCalibration calibration_of_marker(const Recording& recording, const Rig& believed, const Marker& there,
                                               const Marker& back) {
  Rig truth = laboratory(recording.seed);
  const cv::Mat tissue = make_tissue(truth.camera.width_px, truth.camera.height_px, recording.seed);
  std::vector<Renderer> renderers;
  for (const Marker& marker : {there, back}) {
    truth.instruments[0].marker = marker;
    renderers.emplace_back(truth.camera, shafts_of(truth), tissue, with_noise(recording.noise));
  }
  const int count = recording.compressed ? 360 : 96;
  KeyFrames frames(believed, 0);
  show(
      count, recording.compressed ? 30 : 8, recording.compressed,
      [&](int i) {
        const double part = static_cast<double>(i) / count, turn = part < 0.5 ? 2 * part : 2 - 2 * part;
        JointVector q = swinging(truth, 0, recording.seed);
        q.theta_rad = 0.02 * std::sin(6 * part), q.phi_rad = 1.57 + 0.02 * std::cos(9 * part);
        q.psi_rad = -3 + 1.05 * two_pi * turn;
        return renderers[part < 0.5 ? 0 : 1].render({placement_of(truth.instruments[0], q)},
                                                    1000 * recording.seed + static_cast<std::uint64_t>(i));
      },
      [&](const cv::Mat& bgr, double time_s) { frames.add(bgr, time_s); });
  return calibrate_marker(believed, 0, frames.take());
}

// As before a registration: the joints' names are known.
inline Instrument names_alone(Instrument instrument) {
  instrument.camera_from_rcm.reset(), instrument.image_delay_s.reset();
  instrument.joints->sign = {1, 1, 1, 1}, instrument.joints->offset = {};
  return instrument;
}

struct Swing {
  Rig truth;
  std::vector<TimedPose> poses{};
  JointRecording joints{};
};

// Encoders that count, a clock that stamps within a millisecond.
inline JointRecording readings_of(const Rig& truth, double seconds, std::uint64_t seed) {
  constexpr std::array<double, 4> counts{1e-4, 1e-4, 1e-5, 3e-4};
  constexpr double stamp_s = 1e-3, beyond_s = 0.8;
  Random random(seed + 77);
  const Instrument& instrument = truth.instruments[0];
  JointRecording joints;
  for (double time_s = -beyond_s; time_s < seconds + beyond_s; time_s += 0.02) {
    const Eigen::Vector4d reading = joints_from_q(*instrument.joints, swinging(truth, time_s, seed).vector());
    auto& at = joints.joints.emplace_back();
    for (std::size_t j = 0; j < 4; ++j)
      at[j] = counts[j] * std::round(reading[static_cast<Eigen::Index>(j)] / counts[j]);
    joints.time_s.push_back(time_s - *instrument.image_delay_s + random.uniform(-stamp_s, stamp_s));
  }
  return joints;
}

// `believed`: the camera and the marker by which the poses are found.
inline Swing swing(const Recording& recording, const Rig& truth, const Rig& believed) {
  constexpr double seconds = 12.5;
  Swing result{truth};
  const double fps = recording.compressed ? 30 : 8;
  Renderer renderer(truth.camera, shafts_of(truth),
                    make_tissue(truth.camera.width_px, truth.camera.height_px, recording.seed),
                    with_noise(recording.noise));
  Rig free = believed;
  free.instruments[0].camera_from_rcm.reset();
  Tracker tracker(free, {.frame_budget = std::nullopt});
  show(
      static_cast<int>(seconds * fps), fps, recording.compressed,
      [&](int i) {
        return renderer.render({placement_of(truth.instruments[0], swinging(truth, i / fps, recording.seed))},
                               1000 * recording.seed + static_cast<std::uint64_t>(i));
      },
      [&](const cv::Mat& bgr, double time_s) {
        const Observation& seen = tracker.track(bgr)[0];
        if (seen.status == Status::ok && seen.marker) result.poses.push_back({time_s, *seen.marker});
      });
  result.joints = readings_of(truth, seconds, recording.seed);
  return result;
}

// `believed_focal`: in focal lengths of the true camera.
inline Swing swing(const Recording& recording, double believed_focal = 1) {
  const Rig truth = laboratory(recording.seed);
  Rig believed = truth;
  believed.camera.fx_px *= believed_focal, believed.camera.fy_px *= believed_focal;
  return swing(recording, truth, believed);
}

}  // namespace lapservo::laboratories
