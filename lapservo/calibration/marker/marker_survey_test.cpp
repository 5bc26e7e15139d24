#include "lapservo/calibration/marker/marker_survey.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/testing/scenes.h"
#include "lapservo/vision/model/fine_fit.h"

namespace lapservo::internal {
namespace {

using scenes::usual_shot;

// In the whole frame, and in the part of it that is kept.
TEST(MarkerSurvey, LateralChromaticAberrationOfTheRigIsUndone) {
  constexpr ChromaticAberration aberration{0.9975, 1.0025};
  std::vector<double> known_rad, unknown_rad, blind_rad;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const auto& shot = usual_shot(seed);
    const cv::Mat seen = scenes::render_aberrated(shot.rig, shot.q, seed, aberration);
    const double truth_rad = shot.line().tau_rad;
    const auto look = [&](const Rig& rig, std::vector<double>& errors_rad) {
      const auto found = MarkerSurvey(rig, 0).find(seen);
      ASSERT_TRUE(found && found->settled);
      const Marker& marker = rig.instruments[0].marker;
      const auto view = cropped_view(seen, rig.camera, marker, found->unknowns.pose().camera_from_unrolled);
      ASSERT_TRUE(view);
      const auto again = ViewMeasurer(rig, 0).settled(*view, marker, *found);
      ASSERT_TRUE(again);
      for (const Sighting& sighting : {*found, *again})
        errors_rad.push_back(std::abs(wrap_pi(sighting.tau_rad - truth_rad)));
    };
    Rig rig = shot.rig;
    look(rig, unknown_rad);
    rig.camera.chromatic_aberration = aberration;
    look(rig, known_rad);
    const scenes::Sight sight(shot.rig, seen);
    const FineFit blind = fit_finely(sight.scene(), sight.light(), shot.truth(true), {}, {.ask = false});
    blind_rad.push_back(std::abs(wrap_pi(scenes::q_of(shot.rig, blind.unknowns).psi_rad - shot.q.psi_rad)));
  }
  for (const double error : known_rad) EXPECT_LT(error, 0.004);
  for (const double error : unknown_rad) EXPECT_LT(error, 0.004) << "seen by what it does to the boundaries";
  EXPECT_GT(*std::max_element(blind_rad.begin(), blind_rad.end()), 0.004) << "the test's own power";
}

}  // namespace
}  // namespace lapservo::internal
