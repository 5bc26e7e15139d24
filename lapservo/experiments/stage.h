#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/core/random.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/rig.h"
#include "lapservo/sim/renderer.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::internal {

/// The built-in simulator for one thread: the first instrument of a rig before seeded tissue, with the usual sensor.
/// The camera's exposure stays as it is; the lamps beside it can be turned down.
class Stage {
 public:
  /// The part of the light at full power that comes from elsewhere (the room, through the port) and does not change.
  static constexpr double ambient_fraction = 0.04;

  /// `tissue`: make_tissue() of the camera's size, shared by the stages of an experiment.
  Stage(const Rig& rig, cv::Mat tissue);

  /// `lamp_power`: 1 is full. The same arguments give the same image.
  cv::Mat render(const JointVector& q, double lamp_power, std::uint64_t seed);

 private:
  Rig rig_;
  cv::Mat tissue_;
  double lamp_power_ = 0;
  std::unique_ptr<Renderer> renderer_;  // of that power
};

/// The eyes: one tracker per method, each frame on its own, by a rig that is known_exactly().
class Eyes {
 public:
  Eyes(const Rig& rig, const std::vector<Method>& methods);
  /// One observation per method.
  std::vector<Observation> observe(const cv::Mat& frame);

 private:
  std::vector<Tracker> trackers_;
};

/// The seed of a frame's noise: differs for every frame of every experiment.
std::uint64_t frame_seed(std::uint64_t experiment_seed, int frame);

/// Random configurations of the rig's first instrument (psi too), spread over the field of view and over depths of 60
/// to 130 mm: each is the one of a handful whose marker lies farthest from all before it (Mitchell's best candidate).
/// The whole visible side of the marker lies in the image, 30 px or more from its border, and the shaft leans at most
/// 20 degrees towards or away from the camera. Throws InputError when that is hardly ever so.
std::vector<JointVector> spread_positions(const Rig& rig, int count, Random& random);

/// Image of the middle of the marker on the centre line, raw pixels.
Eigen::Vector2d marker_middle_px(const Camera& camera, const Instrument& instrument, const JointVector& q);

}  // namespace lapservo::internal
