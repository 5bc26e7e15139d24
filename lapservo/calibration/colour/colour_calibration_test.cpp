#include "lapservo/calibration/colour/colour_calibration.h"

#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/renderer.h"
#include "lapservo/sim/tissue.h"
#include "lapservo/testing/has.h"
#include "lapservo/testing/scenes.h"

namespace lapservo::internal::colour_calibration_test {
using testing::has;

struct Film {
  int frames = 24;
  double motion = 1, light = 1;
};

// As the camera of `real` sees it.
std::vector<cv::Mat> filmed(const Rig& real, const Film& film) {
  const RenderOptions options{.lighting = {}, .sensor = {.gains = Light::Constant(static_cast<float>(film.light))}};
  Renderer renderer(real.camera, shafts_of(real), make_tissue(real.camera.width_px, real.camera.height_px, 5), options);
  std::vector<cv::Mat> frames;
  for (int i = 0; i < film.frames; ++i) {
    const double t = film.motion * i;
    const JointVector q{0.2 * std::sin(0.4 * t), 1.57 + 0.15 * std::sin(0.55 * t), 0.089 + 0.006 * std::sin(0.3 * t),
                        0.5 * t};
    frames.push_back(renderer.render({placement_of(real.instruments[0], q)}, static_cast<std::uint64_t>(i)));
  }
  return frames;
}

class CalibrateColour : public ::testing::Test {
 protected:
  const Rig rig = scenes::usual_rig();
  Rig real = rig;

  void expect_hues(const ColourCalibration& found, double within_deg) const {
    for (std::size_t band = 0; band < 3; ++band)
      EXPECT_LT(hue_gap_deg(found.hues_deg[band], real.instruments[0].marker.hues_deg[band]), within_deg) << band;
  }
};

TEST_F(CalibrateColour, FindsInksThatAreNotTheRigs) {
  for (const auto& hues_deg : {std::array{132.0, 222.0, 304.0}, {74.0, 146.0, 236.0}, {138.0, 196.0, 262.0}}) {
    real.instruments[0].marker.hues_deg = hues_deg;
    const Film film;
    const auto found = calibrate_colour(rig, 0, filmed(real, film));
    ASSERT_EQ(found.refusal, "");
    EXPECT_TRUE(hues_deg[0] != 138 || found.found_before == 0);  // the rig does not see it at all
    EXPECT_EQ(found.found, film.frames);
    expect_hues(found, 4);
    EXPECT_FALSE(found.response) << found.response_found;
    for (const double sigma_deg : found.sigma_hues_deg) EXPECT_LT(sigma_deg, 3);
  }
}

TEST_F(CalibrateColour, TellsAnotherResponse) {
  real.instruments[0].marker.hues_deg = {100, 195, 280};
  for (const auto& [response, name] : {std::pair(Response{Response::Kind::rec709}, "rec709"),
                                       {Response{Response::Kind::power}, "linear"},
                                       {Response{Response::Kind::power, 1.8}, "gamma:1.8"}}) {
    real.camera.response = response;
    const auto found = calibrate_colour(rig, 0, filmed(real, {}));
    ASSERT_EQ(found.refusal, "") << name;
    ASSERT_TRUE(found.response) << name << ": " << found.response_found;
    EXPECT_EQ(found.response_found.rfind(name, 0), 0U) << found.response_found;
    EXPECT_EQ(found.found, 24);
  }
  const auto kept = calibrate_colour(rig, 0, filmed(real, {}), true);
  EXPECT_FALSE(kept.response);
  EXPECT_TRUE(has(kept.response_found, "the marker alone says gamma:1.8"));
  EXPECT_TRUE(has(kept.response_found, "A camera that sharpens makes it so"));
}

// 1.4 and 1.6 lie between those that it tries.
TEST_F(CalibrateColour, NamesAResponseThatIsNoUsualOne) {
  for (const auto& [gamma, is_usual] : {std::pair(1.4, false), {1.6, false}, {1.8, true}, {2.2, true}}) {
    real.camera.response = {Response::Kind::power, gamma};
    const std::string found = calibrate_colour(rig, 0, filmed(real, {})).response_found;
    EXPECT_EQ(found.find("no usual one explains") == std::string::npos, is_usual) << found;
    EXPECT_EQ(has(found, "or lapservo calibrate camera"), !is_usual) << found;
  }
  // A board measured the response: to measure it again leads back here. Compressed frames say nothing of the camera.
  real.camera.response = {Response::Kind::power, 1.4};
  for (const bool lossy : {false, true}) {
    const std::string found = calibrate_colour(rig, 0, filmed(real, {}), true, lossy).response_found;
    EXPECT_FALSE(has(found, "lapservo calibrate camera")) << found;
    EXPECT_EQ(has(found, "switch the camera's sharpening off"), !lossy) << found;
    EXPECT_EQ(has(found, "the recording is compressed"), lossy) << found;
  }
}

TEST_F(CalibrateColour, RefusesWhatCanNotTell) {
  const auto refusal = [&](const Film& film) { return calibrate_colour(rig, 0, filmed(real, film)).refusal; };
  EXPECT_TRUE(has(refusal({.frames = 5}), "at least"));
  EXPECT_TRUE(has(refusal({.frames = 10, .motion = 0}), "move the instrument"));
  EXPECT_TRUE(has(refusal({.frames = 10, .light = 6}), "lower the exposure"));
  const std::vector<cv::Mat> nothing(10, scenes::render_nothing(rig, 3));
  EXPECT_TRUE(has(calibrate_colour(rig, 0, nothing).refusal, "0 of 10 frames"));
}

// A white balance that moves over the recording, or light that changes its colour as it dims: refused, or named with
// sigmas that hold.
TEST_F(CalibrateColour, NamesHuesThatAreNotOne) {
  const auto frames = filmed(real, {});
  const auto found_with = [&](double by, bool over_time) {
    std::vector<cv::Mat> tinted(frames.size());
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const double part = over_time ? static_cast<double>(i) / static_cast<double>(frames.size()) - 0.5
                                    : 0.5 * std::sin(1.7 * static_cast<double>(i));
      const double all = over_time ? 1 : 1 + 0.4 * part;
      cv::multiply(frames[i], cv::Scalar(all * (1 - by * part), all, all * (1 + by * part)), tinted[i]);
    }
    return calibrate_colour(rig, 0, tinted);
  };
  for (const bool over_time : {true, false})
    for (const double by : {0.0, 0.05, 0.2, 0.6}) {
      const auto found = found_with(by, over_time);
      double worst = 0;
      for (std::size_t band = 0; band < 3 && found.refusal.empty(); ++band)
        worst = std::max(worst, hue_gap_deg(found.hues_deg[band], real.instruments[0].marker.hues_deg[band]) /
                                    found.sigma_hues_deg[band]);
      const std::string said = found.refusal + (found.faults.empty() ? "" : found.faults[0]);
      SCOPED_TRACE(::testing::Message() << (over_time ? "over time by " : "with light by ") << by);
      EXPECT_LT(worst, 4) << said;
      EXPECT_TRUE(by > 0 || said.empty()) << said;
      EXPECT_TRUE(by != 0.2 || has(said, over_time ? "over the recording" : "to the brightest")) << said;
      EXPECT_TRUE(by < 0.6 || !over_time || !found.refusal.empty());
    }
}

}  // namespace lapservo::internal::colour_calibration_test
