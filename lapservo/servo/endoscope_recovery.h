#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "lapservo/control/visual_controller.h"
#include "lapservo/rig/rig.h"
#include "lapservo/servo/disagreement.h"
#include "lapservo/servo/offset_steps.h"
#include "lapservo/servo/registration_fit.h"
#include "lapservo/servo/servo_decision.h"

namespace lapservo::internal {

/// State of EndoscopeRecovery and the data of that state.
namespace endoscope {

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
  SeenJoints seen;  ///< in that image; q alone where its boundaries do not show them
};
using Sightings = std::vector<MarkerSighting>;

struct Watching {
  bool suspects = false;       ///< held until the next image
  int contradicting = 0;       ///< images in a row
  std::deque<Offset> offsets;  ///< while images agreed, in order of time
};
struct Measuring {
  Sightings sightings;     ///< of the motion that the operator makes
  std::size_t fit_at = 0;  ///< so many
  bool certain = false;    ///< by them: waits for a start
};
struct WrongRig {
  Explanation why;
};

}  // namespace endoscope

/// Notices that the endoscope moved, and measures camera_from_rcm anew. Images which agreed with the joints then show
/// the marker as well as before, but where the joints are not, or on a shaft that misses the RCM by more than the
/// registration's uncertainty explains (largest_misfit_rad()): what hides a marker, freezes an image, sets an encoder
/// or blocks a joint does not do that, nor does a registration that was a little wrong from the start. From then on the
/// arm is the operator's. A rig that was wrong from the start (explain_disagreement()) is no moved endoscope: the arm
/// is held for good. Images and measured joints of the motion that the operator makes give camera_from_rcm; the loop
/// goes by it after JointState::started, unless the newest image contradicts it.
class EndoscopeRecovery {
 public:
  explicit EndoscopeRecovery(const Rig& rig);

  /// The registration that images are to be tracked with from now on: only those that were count.
  int registration() const { return registration_; }
  const std::optional<Rigid3>& camera_from_rcm() const { return camera_from_rcm_; }
  /// The endoscope moved and nobody has said start since, or the rig is wrong: nothing may be sent to the arm.
  bool moved() const { return !std::holds_alternative<endoscope::Watching>(state_); }
  /// The wrong part of the rig, where joints and images have disagreed from the start: then nothing is measured anew.
  std::optional<Explanation> wrong_rig() const;
  const Instrument& instrument() const { return rig_.instruments[0]; }

  /// Before a step: its input. Suspends the controller, and resumes it.
  void see(const ServoInput& input, VisualController& controller);
  /// In it, with the controller's own reason: an image that repeats and joints that jump are no moved endoscope,
  /// nor anything to measure one by.
  void doubt(HoldReason reason, VisualController& controller);
  /// After it.
  void follow(const ServoInput& input, const ControlStep& step, VisualController& controller);

 private:
  void collect(const ImageMeasurement& image, VisualController& controller);
  enum class Blame { any, named, sign };  ///< whatever of the rig is wrong; one number; one joint's sign
  bool blames_rig(VisualController& controller, Blame wanted);
  bool stepped(const ImageMeasurement& image, bool delay_is_known);
  void watch(endoscope::Watching& watching, const ImageMeasurement& image, VisualController& controller);
  bool misfits(const endoscope::Watching& watching, bool moves) const;
  bool jumps(const Eigen::Vector4d& before, const Eigen::Vector4d& max_offset) const;
  void notice(const std::deque<endoscope::Offset>& offsets, VisualController& controller);
  void drop_suspicion(VisualController& controller);
  void trust_before(const std::deque<endoscope::Offset>& offsets);
  bool follow_joints(const ImageMeasurement& image, VisualController& controller);
  void trust(endoscope::Watching& watching, const ServoInput& input, const ControlStep& step);
  void measure(VisualController& controller);
  void collect(endoscope::Measuring& measuring, const MarkerSighting& seen, VisualController& controller);
  void start(const endoscope::Sightings& sightings, VisualController& controller);
  std::optional<RegistrationFit> fit(const endoscope::Sightings& sightings) const;
  MarkerSighting sighting(const ImageMeasurement& image) const;
  std::optional<MarkerSighting> sighting_of(const ImageMeasurement& image) const;

  Rig rig_;
  int registration_ = 0;
  std::optional<Rigid3> camera_from_rcm_;
  std::variant<endoscope::Watching, endoscope::Measuring, endoscope::WrongRig> state_;
  endoscope::Sightings seen_;                    ///< since the loop has gone by this registration
  bool sees_from_start_ = true;                  ///< nothing but that made joints or images doubtful since then
  std::size_t sightings_ = 0, explain_at_ = 0;   ///< how many were added to seen_ that moved; explained at so many
  int agreeing_ = 0;                             ///< images so far, at most 10
  std::optional<endoscope::Measured> measured_;  ///< at the latest image
  std::optional<SeenJoints> seen_joints_;        ///< in it, by the registration that the loop goes by
  double joints_s_ = 0, joints_from_s_ = 0;      ///< when the joints were read last, and first after the last silence
  OffsetSteps steps_;                            ///< of images that show the marker
  int registration_of_steps_ = 0;
  GapPath path_;                                       ///< since the offset that is trusted
  Eigen::Vector4d trusted_ = Eigen::Vector4d::Zero();  ///< offset, of before the endoscope moved
};

}  // namespace lapservo::internal
