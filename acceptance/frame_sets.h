#pragma once

#include <array>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/core/statistics.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/rig.h"
#include "lapservo/sim/renderer.h"
#include "lapservo/testing/environment.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::acceptance {

/// The truth of a frame.
struct Truth {
  std::string instrument, condition;
  JointVector q;
  double tau_rad = 0;
  std::array<Eigen::Vector2d, 4> edges_raw_px;
};

struct TrueFrame {
  Rig rig;
  cv::Mat bgr;
  std::vector<Truth> truths;
};

/// The truth of an instrument's marker as the rig has it; needs one before the camera.
Truth truth_of(const Rig& rig, std::size_t instrument, const JointVector& q);

/// Errors of observations against truth, over a set.
struct Score {
  int expected = 0, found = 0, wrong = 0;  ///< wrong: ok, and psi off by more than 0.1 rad
  std::vector<double> psi_rad, theta_rad, phi_rad, rho_m, edge_px;
  std::vector<double> psi_sigmas, theta_sigmas, phi_sigmas, rho_sigmas;
  std::vector<std::array<Eigen::Vector2d, 4>> edges;  ///< of found ones, in order
  std::map<std::string, int> refusals;                ///< statuses of the others

  void add(const TrueFrame& frame, const std::vector<Observation>& observations);
  double found_fraction() const { return expected ? static_cast<double>(found) / expected : 1; }
};

using internal::rms;
using testing::from_environment;

double mean(const std::vector<double>& values);
double standard_deviation(const std::vector<double>& values);
double largest(const std::vector<double>& values);

/// The frames of one of the samples' sets: of a folder with truth.csv, in order. A frame's rig is NNNN.rig.yaml or
/// rig.yaml.
std::vector<TrueFrame> sample_frames(const std::string& set);

/// Those of a set under acceptance/frames, which are in this repository.
std::vector<TrueFrame> stored_frames(const std::string& set);

/// Every frame on its own.
Score score_single(const std::vector<TrueFrame>& frames);

/// Frames rendered in front of seeded tissue: what a set looks like in our own renderer.
struct RenderedSet {
  Rig rig;
  std::vector<std::vector<JointVector>> configurations;  ///< per frame and instrument
  RenderOptions options;
  double blood = 0;  ///< fraction of the marker covered
  float shaft_reflectance = ShaftModel{}.shaft_reflectance;
  std::uint64_t seed = 1;
  std::function<cv::Mat(const cv::Mat&)> after;  ///< what the recorder does, when given
};
std::vector<TrueFrame> rendered_frames(const RenderedSet& set);

/// The frames as a video gives them back, 30 frames/s: of libx264 by OpenCV (preset medium, crf 23), lapservo
/// (ultrafast, 22), the command ffmpeg (medium, 16, as in shared/frames/video); of libx265 (medium, 28), 4:2:0 or RGB.
enum class Encoder { opencv, lapservo, ffmpeg, x265, x265_rgb };
void compress(std::vector<TrueFrame>& frames, Encoder encoder = Encoder::opencv);

/// The rig of configs/example.yaml.
Rig example_rig();

/// Random configurations of it with the marker wholly in view, pointing at most `steepest` rad towards or away.
std::vector<std::vector<JointVector>> random_configurations(const Rig& rig, int count, std::uint64_t seed,
                                                            double steepest_rad = 0.35);

}  // namespace lapservo::acceptance
