#pragma once

#include <deque>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "lapservo/control/probing.h"
#include "lapservo/control/visual_controller.h"
#include "lapservo/rig/rig.h"
#include "lapservo/servo/offset_steps.h"
#include "lapservo/servo/registration_fit.h"
#include "lapservo/servo/servo_decision.h"

namespace lapservo::internal {

/// Notices that the endoscope moved, and measures camera_from_rcm anew. Noticed is that images which told q, in
/// agreement with the joints, show the marker as well as before but nowhere where its shaft passes the RCM, or where
/// the joints are not: not what hides a marker, freezes a picture, sets an encoder or blocks a joint does. The arm
/// holds until the marker's place in the image rests; moves its joints a little, one after the other; and what images
/// and joints say of these motions gives camera_from_rcm. If they disagree, the endoscope has moved again and all
/// begins anew; ControllerConfig::endoscope_attempts times, then the arm holds for good. What the images show in the
/// next seconds, with the larger motions of the task, makes it finer twice.
class EndoscopeRecovery {
 public:
  EndoscopeRecovery(const Rig& rig, const ControllerConfig& config);

  /// What images are to be tracked with from now on.
  int registration() const { return registration_; }
  const std::optional<Rigid3>& camera_from_rcm() const { return camera_from_rcm_; }

  /// Whether images that were tracked with that one count.
  bool counts(int registration) const { return registration >= oldest_counted_ && registration <= registration_; }
  /// Before a step: an image that came, if it counts. Tells the controller what to do.
  void see(const ServoInput& input, VisualController& controller);
  /// In it, with the controller's own reason: a picture that repeats and joints that jump are no moved endoscope,
  /// nor anything to measure one by.
  void doubt(HoldReason reason, VisualController& controller);
  /// After it.
  void follow(const ServoInput& input, const ControlStep& step, VisualController& controller);

 private:
  enum class Phase { watching, resting, exploring, failed };

  bool jumped(const Eigen::Vector4d& q_seen) const;
  bool stepped(const ImageMeasurement& image, bool delay_is_known);
  void notice(VisualController& controller);
  void drop_suspicion(VisualController& controller);
  void trust_before();
  bool collects() const;
  void add_sighting(const MarkerSighting& sighting, double min_apart_s);
  void wait_for_rest(const ServoInput& input);
  void explore(const ServoInput& input, const ControlStep& step, VisualController& controller);
  void conclude(const ServoInput& input, VisualController& controller);
  void refine(const ServoInput& input, VisualController& controller);
  void rest_again(VisualController& controller);
  void trust(const ServoInput& input, const ControlStep& step);
  bool follow_joints(const ImageMeasurement& image, VisualController& controller);
  std::optional<MarkerSighting> sighting_of(const ImageMeasurement& image) const;

  /// The measured joints at an image.
  struct Measured {
    double stamp_s = 0;
    Eigen::Vector4d q = Eigen::Vector4d::Zero(), rate = Eigen::Vector4d::Zero();
    Eigen::Vector2i sides = Eigen::Vector2i::Zero();  ///< of their gaps, rho's and psi's: 1 rising, -1 falling
  };
  struct Offset {
    double time_s = 0;
    Eigen::Vector4d q = Eigen::Vector4d::Zero();  ///< of the instrument from the measured joints
    Measured measured;
  };
  Rig rig_;
  JointLimits limits_;
  int max_attempts_;
  bool follows_ = true;  // the arm: else it can't move by itself to measure
  int registration_ = 0, oldest_counted_ = 0;
  std::optional<Rigid3> camera_from_rcm_;
  Phase phase_ = Phase::watching;
  int agreeing_ = 0;                  ///< images so far, at most 10
  int contradicting_ = 0;             ///< images in a row
  int failed_ = 0;                    ///< attempts
  std::deque<Offset> offsets_;        ///< while images agreed, in order of time
  std::optional<Measured> measured_;  ///< at the latest image
  bool suspected_ = false;            ///< held until the next image
  OffsetSteps steps_;                 ///< of images that told q
  int registration_of_steps_ = 0;
  GapPath path_;                                       ///< since the offset that is trusted
  Eigen::Vector4d trusted_ = Eigen::Vector4d::Zero();  ///< offset, of before the endoscope moved
  std::vector<MarkerSighting> sightings_;
  double sighted_s_ = 0;  ///< stamp of the latest of them
  double rests_since_s_ = 0, explored_s_ = 0;
  double seen_s_ = 0;               ///< when the marker was last seen while exploring
  std::deque<double> refine_at_s_;  ///< what is to come; then the sightings have done their work
  ProbingMotion motion_;
};

}  // namespace lapservo::internal
