#include "lapservo/calibration/check/frame_diagnosis.h"

#include <string>
#include <tuple>
#include <utility>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/testing/scenes.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::internal::frame_diagnosis_test {

constexpr int frames = 12;

class FrameDiagnosisTest : public ::testing::Test {
 protected:
  const Rig rig = scenes::usual_rig();

  // Frames of the rig as `change` leaves them, tracked and diagnosed with `believed`.
  template <typename Change>
  std::string text(const Rig& believed, Change change) const {
    FrameDiagnosis diagnosis(believed);
    Tracker tracker(believed);
    Random random(7);
    for (int i = 0; i < frames; ++i) {
      cv::Mat bgr = scenes::render(rig, {scenes::random_configuration(rig, 0, random)}, 7);
      change(bgr);
      diagnosis.add(bgr, tracker.track(bgr));
    }
    return diagnosis.text();
  }
  Observation refused(Status status) const {
    Observation seen;
    seen.status = status, seen.instrument = rig.instruments[0].name;
    return seen;
  }
  static void expect_names(const std::string& text, const std::string& word) {
    EXPECT_NE(text.find(word), std::string::npos) << text;
  }
};

TEST_F(FrameDiagnosisTest, IsSilentWhereAllIsWell) {
  EXPECT_EQ(text(rig, [](cv::Mat&) {}), "");
}

TEST_F(FrameDiagnosisTest, NamesTheCauseWhereNothingIsFound) {
  const auto diagnose = [&](auto change) { return text(rig, change); };
  expect_names(diagnose([](cv::Mat& bgr) { cv::cvtColor(bgr, bgr, cv::COLOR_BGR2RGB); }), "red and blue are exchanged");
  expect_names(diagnose([](cv::Mat& bgr) { cv::flip(bgr, bgr, 1); }), "mirroring off");
  expect_names(diagnose([](cv::Mat& bgr) { bgr /= 16; }), "the frames are dark");
  expect_names(diagnose([](cv::Mat& bgr) {
                 cv::cvtColor(bgr, bgr, cv::COLOR_BGR2GRAY);
                 cv::cvtColor(bgr, bgr, cv::COLOR_GRAY2BGR);
               }),
               "grey");
  expect_names(FrameDiagnosis(rig).text(), "no frame");
}

TEST_F(FrameDiagnosisTest, GivesNoCauseWhereTheFramesShowNone) {
  FrameDiagnosis diagnosis(rig);
  diagnosis.add(scenes::render_nothing(rig, 7), {});
  EXPECT_EQ(diagnosis.cause(), "");
  cv::Mat bgr = scenes::render_nothing(rig, 7);
  bgr /= 16;
  FrameDiagnosis dark(rig);
  dark.add(bgr, {});
  expect_names(dark.cause(), "; the frames are dark");
}

TEST_F(FrameDiagnosisTest, NamesWhatElseTheRigWouldHaveToSay) {
  const auto believed = [&](auto change) {
    Rig other = rig;
    change(other);
    return text(other, [](cv::Mat&) {});
  };
  expect_names(believed([](Rig& other) {
                 std::swap(other.instruments[0].marker.hues_deg[0], other.instruments[0].marker.hues_deg[2]);
               }),
               "found with its hues in another order");
  expect_names(believed([](Rig& other) {
                 for (double& hue_deg : other.instruments[0].marker.hues_deg) hue_deg += 60;
               }),
               "hues_deg");
  expect_names(believed([](Rig& other) { other.instruments[0].marker.diameter_m /= 2; }), "twice the rig's");
  expect_names(believed([](Rig& other) { other.instruments[0].marker.diameter_m *= 2; }), "half the rig's");
  expect_names(believed([](Rig& other) {
                 other.camera.distortion = {-0.4, 0.2, 0, 0, 0};
               }),
               "without the rig's distortion_coefficients");
  expect_names(believed([](Rig& other) { other.camera.fx_px *= 1.5, other.camera.fy_px *= 1.5; }),
               "found with a focal length of about");
}

TEST_F(FrameDiagnosisTest, NamesCompressionOverexposureAndATurnedCamera) {
  FrameDiagnosis diagnosis(rig);
  for (int i = 0; i < frames; ++i) diagnosis.add(scenes::render_nothing(rig, 7), {refused(Status::poor_fit)});
  expect_names(diagnosis.text(true), "12 of 12 frames are poor_fit, and the recording is compressed");
  expect_names(diagnosis.text(false), "compare diameter_m and bands");
  expect_names(text(rig, [](cv::Mat& bgr) { bgr.convertTo(bgr, -1, 4, 120); }), "overexposed");
  expect_names(text(rig, [](cv::Mat& bgr) { cv::rotate(bgr, bgr, cv::ROTATE_180); }), "turned by 180 degrees");
}

// Nine frames under a white balance that moves, or not, and three without the marker.
TEST_F(FrameDiagnosisTest, NamesHuesThatMoveWhereFramesAreLost) {
  for (const double by : {0.0, 0.3}) {
    int i = 0;
    const std::string line = text(rig, [&](cv::Mat& bgr) {
      const double part = by * (i / 9.0 - 0.5);
      cv::multiply(bgr, i++ < 9 ? cv::Scalar(1 + part, 1, 1 - part) : cv::Scalar(), bgr);
    });
    EXPECT_EQ(line.find("3 of 12 frames do not show it, and in those that do the hues move by") != std::string::npos,
              by > 0)
        << line;
  }
}

TEST_F(FrameDiagnosisTest, NamesTheBandsWhereThePrintIsAnother) {
  Rig other = rig;
  Marker& marker = other.instruments[0].marker;
  const double length_m = marker.length_m();
  marker.bands_upper_m = {0.1 * length_m, 0.3 * length_m, 0.6 * length_m};
  marker.bands_lower_m = {0.2 * length_m, 0.6 * length_m, 0.2 * length_m};
  expect_names(text(other, [](cv::Mat&) {}), "its bands do not fit");
}

TEST_F(FrameDiagnosisTest, NamesABackgroundOfABandsHue) {
  const cv::Mat tissue(rig.camera.height_px, rig.camera.width_px, CV_8UC3, cv::Scalar(40, 90, 200));  // of hue 19
  const cv::Mat with_marker = scenes::render(rig, {JointVector{0, 1.57, 0.09, 0}}, 7);
  for (const auto& [bgr, hue_deg, named] :
       {std::tuple(tissue, 20.0, true), {tissue, 90, false}, {with_marker, 90, false}}) {
    Rig other = rig;
    other.instruments[0].marker.hues_deg[0] = hue_deg;
    FrameDiagnosis diagnosis(other);
    diagnosis.add(bgr, {refused(Status::no_marker)});
    EXPECT_EQ(diagnosis.background(0).find("100 % of the image are near 20 degrees") != std::string::npos, named);
    EXPECT_EQ(diagnosis.background(0).empty(), !named);
    if (named) expect_names(diagnosis.text(), usual_cause(Status::no_marker) + diagnosis.background(0));
  }
}

TEST(TissueHue, IsNamed) {
  for (const auto& [hue_deg, named] : {std::pair(0, true), {74, true}, {75, false}, {300, false}, {301, true}}) {
    const std::string text = tissue_hue_text({.hues_deg = {180, static_cast<double>(hue_deg), 180}});
    EXPECT_EQ(text.find("hues_deg[1] is " + std::to_string(hue_deg) + ","), named ? 0 : std::string::npos) << text;
    EXPECT_EQ(text.find("75 to 300 degrees") != std::string::npos, named) << text;
  }
}

TEST_F(FrameDiagnosisTest, NamesFramesOfTwoMoments) {
  const cv::Mat bgr(rig.camera.height_px, rig.camera.width_px, CV_8UC3, cv::Scalar(40, 90, 200));
  for (const auto& [status, remedy] :
       {std::pair(Status::interlaced, "--deinterlace"), std::pair(Status::blended, "noise reduction over time")}) {
    FrameDiagnosis diagnosis(rig);
    for (int i = 0; i < frames; ++i) diagnosis.add(bgr, {refused(status)});
    expect_names(diagnosis.text(), remedy);
  }
}

TEST_F(FrameDiagnosisTest, NamesFlawedFramesBeforeAllElse) {
  const cv::Mat black = cv::Mat::zeros(rig.camera.height_px, rig.camera.width_px, CV_8UC3);
  const cv::Mat bright(black.size(), black.type(), cv::Scalar::all(200));
  Tracker tracker(rig);
  FrameDiagnosis diagnosis(rig);
  for (int i = 0; i < 20; ++i) diagnosis.add(bright, tracker.refuse(Status::damaged));
  EXPECT_EQ(diagnosis.text().rfind("20 of 20 frames are damaged: ", 0), 0U) << diagnosis.text();
  EXPECT_EQ(diagnosis.cause(), "; " + diagnosis.text());
  FrameDiagnosis half(rig);
  for (int i = 0; i < 20; ++i) half.add(black, i % 2 == 0 ? tracker.refuse(Status::damaged) : tracker.track(black));
  expect_names(half.text(), "the frames are dark");
}

}  // namespace lapservo::internal::frame_diagnosis_test
