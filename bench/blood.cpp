// blood [COUNT [SEED [PERCENT]]]: what becomes of markers of which blood hides so much (40), each its own. Single
// pictures of an exact print, near as the samples of heavy blood are or anywhere in view, leaning little or much; then,
// tracked, ten frames with blood of an instrument that turned in clear view before, of exact prints and of those that
// are off (random_print.h).
#include "lapservo/sim/blood.h"

#include <array>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "acceptance/frame_sets.h"
#include "acceptance/random_print.h"
#include "acceptance/tally.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/tissue.h"
#include "lapservo/testing/scenes.h"

namespace {
using namespace lapservo;
using namespace lapservo::acceptance;
using namespace lapservo::internal;

struct Where {
  std::string name;
  bool near;
  double steepest_rad;
};
const std::array<Where, 3> places{{{"near", true, 0},
                                   {"anywhere, leaning up to 20 degrees", false, 0.35},
                                   {"anywhere, leaning up to 50 degrees", false, 0.87}}};

JointVector configuration(const Rig& rig, const Where& where, Random& random) {
  if (where.near)
    return {random.uniform(-0.2, 0.2), random.uniform(1.41, 1.68), random.uniform(0.078, 0.108),
            random.uniform(-pi, pi)};
  return random_configurations(rig, 1, random.bits(), where.steepest_rad)[0][0];
}

// One instrument and its print, clear for some frames and bloody for others, while it turns.
class Sequence {
 public:
  Sequence(const Rig& rig, const Where& where, Off off, double blood, std::uint64_t seed) : rig_(rig), random_(seed) {
    const Instrument& instrument = rig.instruments[0];
    q_ = configuration(rig, where, random_);
    clear_ = shaft_of(instrument);
    clear_.marker = off_print(instrument.marker, off, random_);
    bloody_ = clear_;
    bloody_.blotches = blood_over(clear_.marker, blood, random_);
    tissue_ = make_tissue(rig.camera.width_px, rig.camera.height_px, random_.bits());
    step_rad_ = random_.uniform(0.02, 0.12);
  }
  Tally seen(Tracker& tracker, bool with_blood, int frames) {
    Renderer renderer(rig_.camera, {with_blood ? bloody_ : clear_}, tissue_, {});
    const Instrument& instrument = rig_.instruments[0];
    Tally tally;
    for (int i = 0; i < frames; ++i, q_.psi_rad += step_rad_) {
      const cv::Mat picture = renderer.render({placement_of(instrument, q_)}, random_.bits());
      tally.add(tracker.track(picture)[0], q_.psi_rad, clear_.marker.seam_rad - instrument.marker.seam_rad);
    }
    return tally;
  }

 private:
  const Rig& rig_;
  Random random_;
  JointVector q_;
  ShaftModel clear_, bloody_;
  cv::Mat tissue_;
  double step_rad_ = 0;
};

}  // namespace

int main(int argc, char** argv) {
  constexpr int clear_frames = 15, bloody_frames = 10;
  const int count = argc > 1 ? std::atoi(argv[1]) : 40;
  const auto seed = 100'000 * static_cast<std::uint64_t>(argc > 2 ? std::atoll(argv[2]) : 1);
  const double blood = (argc > 3 ? std::atof(argv[3]) : 40) / 100;
  const Rig rig = example_rig();
  for (const Where& where : places) {
    Tally all;
    for (int i = 0; i < count; ++i) {
      Tracker tracker(rig, {.method = Method::surface, .single = true});
      all.add(Sequence(rig, where, Off::nowhere, blood, seed + static_cast<std::uint64_t>(i)).seen(tracker, true, 1));
    }
    all.show(where.name);
  }
  for (const auto& [off, name] :
       {std::pair{Off::nowhere, "exact"}, {Off::bands, "bands off"}, {Off::middle_ink, "ink aside"}}) {
    Tally clear, bloody;
    for (int i = 0; i < count; ++i) {
      Tracker tracker(rig);
      Sequence sequence(rig, places[1], off, blood, seed + static_cast<std::uint64_t>(i));
      clear.add(sequence.seen(tracker, false, clear_frames));
      bloody.add(sequence.seen(tracker, true, bloody_frames));
    }
    clear.show(std::string("tracked, ") + name + ": in clear view");
    bloody.show(std::string("tracked, ") + name + ": then under blood");
  }
}
