#include "lapservo/vision/side_biases.h"

#include <array>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/core/median.h"
#include "lapservo/testing/scenes.h"
#include "lapservo/vision/marker_survey.h"

namespace lapservo::internal {
namespace side_biases_test {

// Colour differences blurred by so much, as compressed video has them.
cv::Mat with_blurred_chroma(const cv::Mat& bgr, double variance_px2) {
  cv::Mat ycc;
  bgr.convertTo(ycc, CV_32F, 1 / 255.0);
  cv::cvtColor(ycc, ycc, cv::COLOR_BGR2YCrCb);
  std::array<cv::Mat, 3> channels;
  cv::split(ycc, channels.data());
  for (const std::size_t c : {1U, 2U}) cv::GaussianBlur(channels[c], channels[c], {}, std::sqrt(variance_px2));
  cv::merge(channels.data(), channels.size(), ycc);
  cv::cvtColor(ycc, ycc, cv::COLOR_YCrCb2BGR);
  cv::Mat out;
  ycc.convertTo(out, CV_8U, 255);
  return out;
}

double middle_of_side(const ViewMeasurements& view, std::size_t group) {
  std::vector<double> residuals_px;
  for (const Measurement& m : view.edges.all)
    if (m.group == group) residuals_px.push_back(m.residual_px);
  return residuals_px.empty() ? 0 : median(residuals_px);
}

// Of 0.12 px rms 0.08 are left.
TEST(SideBiases, AreMostOfWhatBlurredColourDifferencesMoveTheSidesBy) {
  double moved_squares = 0, left_squares = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const auto& shot = scenes::usual_shot(seed);
    const Marker& marker = shot.rig.instruments[0].marker;
    const cv::Mat blurred = with_blurred_chroma(shot.bgr, 2);
    const auto found = MarkerSurvey(shot.rig, 0).find(shot.bgr), again = MarkerSurvey(shot.rig, 0).find(blurred);
    ASSERT_TRUE(found && again) << seed;
    Sighting there = *found;
    there.blur = again->blur;  // as a fit to this picture has it
    const ViewMeasurer measurer(shot.rig, 0);
    const ViewMeasurements before = measurer.measure({shot.bgr, shot.rig.camera}, marker, *found, {});
    std::vector<ViewMeasurements> after{
        measurer.measure({blurred, shot.rig.camera}, marker, there, {.ask_processing = true})};
    ASSERT_EQ(after[0].processing.processing, Processing::found) << seed;
    const std::vector<ViewMeasurements> as_seen = after;
    take_processing_off(after);
    for (const std::size_t group : {4U, 5U}) {
      const double was_px = middle_of_side(before, group);
      moved_squares += std::pow(middle_of_side(as_seen[0], group) - was_px, 2);
      left_squares += std::pow(middle_of_side(after[0], group) - was_px, 2);
    }
  }
  EXPECT_GT(std::sqrt(moved_squares / 12), 0.1) << "the test's own power";
  EXPECT_LT(left_squares, 0.6 * moved_squares);
}

}  // namespace side_biases_test
}  // namespace lapservo::internal
