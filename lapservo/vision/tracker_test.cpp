#include "lapservo/vision/tracker.h"

#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/error.h"
#include "lapservo/testing/scenes.h"

namespace lapservo::internal {
namespace {

using scenes::usual_shot;

// `for (const Observation& o : Tracker(rig).track(image))` once read freed memory.
TEST(Tracker, OneThatIsATemporaryGivesItsObservationsAway) {
  const auto& shot = usual_shot(1);
  int seen = 0;
  for (const Observation& o : Tracker(shot.rig).track(shot.bgr)) {
    ASSERT_EQ(o.status, Status::ok);
    EXPECT_LT(std::abs(wrap_pi(o.rcm.value().q.psi_rad - shot.q.psi_rad)), 0.01);
    ++seen;
  }
  EXPECT_EQ(seen, 1);
}

// Another than a temporary lends them: no copy a frame.
TEST(Tracker, LendsTheSameObservationsFrameByFrame) {
  const auto& shot = usual_shot(1);
  Tracker tracker(shot.rig);
  const Observation* const first = tracker.track(shot.bgr).data();
  EXPECT_EQ(tracker.track(shot.bgr).data(), first);
}

TEST(Tracker, NamesTheInstrumentWhateverBecomesOfIt) {
  const auto& shot = usual_shot(1);
  Tracker tracker(shot.rig);
  const std::string& name = shot.rig.instruments[0].name;
  EXPECT_EQ(tracker.track(shot.bgr)[0].instrument, name);
  EXPECT_EQ(tracker.track(cv::Mat::zeros(shot.bgr.size(), CV_8UC3))[0].instrument, name);
  EXPECT_EQ(tracker.refuse(Status::damaged)[0].instrument, name);
  EXPECT_EQ(tracker.refuse(Status::damaged)[0].status, Status::damaged);
}

TEST(Tracker, RefusesABudgetOfNothing) {
  for (const double nothing : {0.0, -1.0, std::nan("")})
    EXPECT_THROW(Tracker(scenes::usual_rig(), {.frame_budget = nothing}), InputError) << nothing;
  EXPECT_THROW(Tracker(Rig{}), InputError) << "put together in a program";
}

}  // namespace
}  // namespace lapservo::internal
