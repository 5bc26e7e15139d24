#include <cstddef>
#include <string>

#include <gtest/gtest.h>

#include "lapservo/testing/shots.h"
#include "lapservo/vision/decision/verification.h"

namespace lapservo::internal::displaced_boundary_test {

using namespace scenes;

// A fit that is where the rig's print would show, with this inner boundary on few lines, as blood leaves it.
FineFit fit_with_few(const PoseUnknowns& unknowns, std::size_t boundary) {
  FineFit fit;
  fit.unknowns = unknowns;
  fit.lines = 60;
  fit.used.fill(fit.lines);
  fit.used[boundary] = 10;
  return fit;
}

// A print with one inner boundary elsewhere.
Rig with_boundary_off(Rig rig, std::size_t boundary, double off_m) {
  Marker& marker = rig.instruments[0].marker;
  for (auto* bands_m : {&marker.bands_upper_m, &marker.bands_lower_m})
    (*bands_m)[boundary - 1] += off_m, (*bands_m)[boundary] -= off_m;
  return rig;
}

TEST(DisplacedBoundary, IsOneThatShowsPixelsBesideTheFit) {
  constexpr double off_m = 0.3e-3;  // 2 px and more
  scenes::for_each_shot(6, [&](const Shot& shot) {
    for (const std::size_t boundary : {1U, 2U}) {
      SCOPED_TRACE("boundary " + std::to_string(boundary));
      const FineFit fit = fit_with_few(shot.truth(true), boundary);
      EXPECT_FALSE(is_displaced(shot.sight.scene(), shot.sight.light(), fit));
      for (const double sign : {-1.0, 1.0}) {
        const cv::Mat bgr = scenes::render(with_boundary_off(shot.rig, boundary, sign * off_m), {shot.q}, shot.seed);
        const Sight sight(shot.rig, bgr);
        EXPECT_TRUE(is_displaced(sight.scene(), sight.light(), fit)) << sign;
        EXPECT_FALSE(is_displaced(sight.scene(), sight.light(), fit_with_few(shot.truth(true), 3 - boundary)))
            << "of the one that is where it should be";
      }
    }
  });
}

TEST(DisplacedBoundary, IsAskedOfFewLinesOnly) {
  FineFit fit = fit_with_few(usual_shot(1).truth(true), 1);
  EXPECT_TRUE(may_be_displaced(fit));
  fit.used[1] = fit.lines;
  EXPECT_FALSE(may_be_displaced(fit));
  fit.used[0] = 0;  // an end
  EXPECT_FALSE(may_be_displaced(fit));
}

}  // namespace lapservo::internal::displaced_boundary_test
