#include "lapservo/vision/survey/side_biases.h"

#include <array>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/core/statistics.h"
#include "lapservo/testing/scenes.h"
#include "lapservo/vision/survey/marker_survey.h"

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

// With the blur that the rounds of a calibration come to.
ViewMeasurements settled_view(const ViewMeasurer& measurer, const MarkerView& view, const Marker& marker,
                              Sighting sighting, const ViewMeasurer::Reach& reach) {
  ViewMeasurements measured;
  for (int round = 0; round < 4; ++round) {
    measured = measurer.measure(view, marker, sighting, reach);
    sighting.blur = measured.edges.improved(sighting.blur);
  }
  return measured;
}

// Squares of what blurred colour differences move the sides by, of all seeds, measured so.
double moved_by_blurred_colours(const ViewMeasurer::Reach& reach) {
  double squares = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const auto& shot = scenes::usual_shot(seed);
    const Marker& marker = shot.rig.instruments[0].marker;
    const auto found = MarkerSurvey(shot.rig, 0).find(shot.bgr);
    if (!found) return 1e9;
    const ViewMeasurer measurer(shot.rig, 0);
    const MarkerView view{shot.bgr, shot.rig.camera}, blurred{with_blurred_chroma(shot.bgr, 2), shot.rig.camera};
    const auto before = settled_view(measurer, view, marker, *found, {}),
               after = settled_view(measurer, blurred, marker, *found, reach);
    for (const std::size_t group : {4U, 5U})
      squares += std::pow(middle_of_side(after, group) - middle_of_side(before, group), 2);
  }
  return squares;
}

// Luma's sides are nearer to where they were; nothing is taken off.
TEST(SideBiases, AreSmallerByLuma) {
  const double by_colours = moved_by_blurred_colours({});
  const double by_luma = moved_by_blurred_colours({.ask_processing = true, .only_video = true});
  EXPECT_GT(std::sqrt(by_colours / 12), 0.08) << "the test's own power";
  EXPECT_LT(by_luma, 0.5 * by_colours) << std::sqrt(by_luma / 12) << " of " << std::sqrt(by_colours / 12);
}

cv::Mat sharpened(const cv::Mat& bgr) {
  cv::Mat smooth, out;
  cv::GaussianBlur(bgr, smooth, {}, 1.3);
  cv::addWeighted(bgr, 1.7, smooth, -0.7, 0, out);
  return out;
}

TEST(OnlyVideo, IsWidelyBlurredColourDifferencesAndNoSharpening) {
  struct Case {
    bool sharpens;
    double variance_px2;
    bool expected;
  };
  for (const Case& c : {Case{false, 2.2, true}, Case{true, 2.2, false}, Case{false, 1.2, false}}) {
    std::vector<ViewMeasurements> any, only_video;
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      const auto& shot = scenes::usual_shot(seed);
      const Marker& marker = shot.rig.instruments[0].marker;
      const cv::Mat blurred = with_blurred_chroma(c.sharpens ? sharpened(shot.bgr) : shot.bgr, c.variance_px2);
      const auto found = MarkerSurvey(shot.rig, 0).find(blurred);
      ASSERT_TRUE(found) << seed;
      const ViewMeasurer measurer(shot.rig, 0);
      const MarkerView view{blurred, shot.rig.camera};
      any.push_back(measurer.measure(view, marker, *found, {.ask_processing = true}));
      only_video.push_back(measurer.measure(view, marker, *found, {.ask_processing = true, .only_video = true}));
    }
    EXPECT_EQ(shows_only_video(any, only_video), c.expected) << c.variance_px2;
  }
}

}  // namespace side_biases_test
}  // namespace lapservo::internal
