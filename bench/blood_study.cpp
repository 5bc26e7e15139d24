#include "bench/accuracy_study.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/sim/blood.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/tissue.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::bench {
namespace {
using namespace acceptance;
using namespace internal;

struct Condition {
  std::string name;
  double steepest_rad = 0;  ///< anywhere in view; 0: near, as the samples of heavy blood are
  bool tracked = false;     ///< ten frames of an instrument that rotated in clear view before; else single images
  Off off = Off::nowhere;
  double hidden = 0.4;  ///< of the marker
  bool registered = true;
};
const std::vector<Condition> conditions{
    {.name = "near"},
    {.name = "leaning_20_degrees", .steepest_rad = 0.35},
    {.name = "leaning_50_degrees", .steepest_rad = 0.87},
    {.name = "tracked", .steepest_rad = 0.35, .tracked = true},
    {.name = "tracked_bands_off", .steepest_rad = 0.35, .tracked = true, .off = Off::bands},
    {.name = "tracked_ink_aside", .steepest_rad = 0.35, .tracked = true, .off = Off::middle_ink},
    {.name = "unregistered_clear", .steepest_rad = 0.87, .hidden = 0, .registered = false},
    {.name = "unregistered_near", .registered = false},
    {.name = "unregistered_leaning", .steepest_rad = 0.87, .registered = false}};

JointVector configuration(const Rig& rig, double steepest_rad, Random& random) {
  if (steepest_rad == 0)
    return {random.uniform(-0.2, 0.2), random.uniform(1.41, 1.68), random.uniform(0.078, 0.108),
            random.uniform(-pi, pi)};
  return random_configurations(rig, 1, random.bits(), steepest_rad)[0][0];
}

// Gives observations without a registration the q of the true one.
std::vector<Observation> with_q(std::vector<Observation> seen, const Instrument& instrument) {
  for (Observation& one : seen) {
    if (one.rcm || !one.marker) continue;
    const Rigid3 unrolled_from_marker = camera_from_marker(instrument.marker, Rigid3(), 0).inverse();
    const ShaftPose pose{one.marker->camera_from_marker * unrolled_from_marker, 0};
    one.rcm = Observation::Rcm{configuration_of(pose, *instrument.camera_from_rcm).value()};
    one.rcm->covariance = Eigen::Matrix4d::Identity() * std::pow(one.marker->sigma_roll_rad, 2);
  }
  return seen;
}

// An instrument and its print, clear for some frames and bloody for others, while it turns.
class Sequence {
 public:
  Sequence(const Rig& rig, const Condition& condition, std::uint64_t seed) : rig_(rig), printed_(rig), random_(seed) {
    q_ = configuration(rig, condition.steepest_rad, random_);
    Marker& print = printed_.instruments[0].marker;
    print = off_print(print, condition.off, random_);
    bloody_ = blood_over(print, condition.hidden, random_);
    tissue_ = make_tissue(rig.camera.width_px, rig.camera.height_px, random_.bits());
    step_rad_ = random_.uniform(0.02, 0.12);
  }
  void show(Tracker& tracker, bool with_blood, int frames, Score& score) {
    ShaftModel shaft = shaft_of(printed_.instruments[0]);
    if (with_blood) shaft.blotches = bloody_;
    Renderer renderer(rig_.camera, {shaft}, tissue_, {});
    for (int i = 0; i < frames; ++i, q_.psi_rad += step_rad_) {
      TrueFrame frame{printed_,
                      renderer.render({placement_of(rig_.instruments[0], q_)}, random_.bits()),
                      {truth_of(printed_, 0, q_)}};
      take_print_for(frame, rig_.instruments[0].marker);
      score.add(frame, with_q(tracker.track(frame.bgr), rig_.instruments[0]));
    }
  }

 private:
  Rig rig_, printed_;
  Random random_;
  JointVector q_;
  std::vector<Blotch> bloody_;
  cv::Mat tissue_;
  double step_rad_ = 0;
};

Score score_condition(const Condition& condition, int count, std::uint64_t seed) {
  constexpr int clear_frames = 15, bloody_frames = 10;
  const Rig rig = example_rig();
  Score clear, bloody;
  for (int i = 0; i < count; ++i) {
    Rig known = rig;
    if (!condition.registered) known.instruments[0].camera_from_rcm.reset();
    Tracker tracker(known, {.method = Method::surface, .single = !condition.tracked});
    Sequence sequence(rig, condition, 100'000 * seed + static_cast<std::uint64_t>(i));
    if (condition.tracked) sequence.show(tracker, false, clear_frames, clear);
    sequence.show(tracker, true, condition.tracked ? bloody_frames : 1, bloody);
  }
  return bloody;
}

}  // namespace

std::vector<Row> blood_rows() {
  std::vector<Row> rows;
  for (const Condition& condition : conditions)
    rows.push_back({condition.name,
                    [condition](int count, std::uint64_t seed) { return score_condition(condition, count, seed); }});
  return rows;
}

}  // namespace lapservo::bench
