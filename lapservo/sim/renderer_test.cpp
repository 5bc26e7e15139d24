#include "lapservo/sim/renderer.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/sim/test_edge_probe.h"
#include "lapservo/sim/tissue.h"
#include "lapservo/tool/test_tools.h"

namespace lapservo::internal::renderer_test {

Camera small_camera() {
  return {480, 320, 700, 700, 239.5, 159.5, {}, {}};
}

Marker marker() {
  return {0.0084, {90, 180, 270}, {0.0035, 0.0035, 0.017}, {0.0095, 0.0095, 0.005}, 0.4};
}

// All of it in view, so that its whole light can be weighed.
ShaftModel short_shaft() {
  ShaftModel model;
  model.marker = marker();
  model.shaft_before_m = 0.008;
  model.shaft_beyond_m = 0.006;
  return model;
}

ShaftPlacement across_the_view(double turn_rad, double psi_rad, double depth_m = 0.1) {
  const Eigen::Quaterniond rotation = Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitZ()) *
                                      Eigen::AngleAxisd(pi / 2 - 0.15, Eigen::Vector3d::UnitY());
  return {{rotation, Eigen::Vector3d(0, 0, depth_m) + rotation * Eigen::Vector3d(0, 0, -0.012)}, psi_rad};
}

RenderOptions quiet(float gain = 0.5F) {
  RenderOptions options;
  options.sensor.read_noise = options.sensor.shot_noise = 0;
  options.sensor.gains = Light::Constant(gain);
  return options;
}

cv::Mat even_background(const Camera& camera, float light) {
  return {camera.height_px, camera.width_px, CV_32FC3, cv::Scalar::all(light)};
}

// Without noise, before an even background.
Renderer renderer_of(const std::vector<ShaftModel>& shafts, float light = 0.1F, const Camera& camera = small_camera()) {
  return {camera, shafts, even_background(camera, light), quiet()};
}

double max_difference(const cv::Mat& a, const cv::Mat& b) {
  return cv::norm(a, b, cv::NORM_INF);
}

ShaftModel askew_shaft(double wrap_m, double gap_rad) {
  ShaftModel shaft = short_shaft();
  shaft.marker.wrap_m = wrap_m, shaft.marker.gap_rad = gap_rad;
  return shaft;
}

TEST(Renderer, MagnifiesRedAndBlueByTheLensesAberration) {
  Camera lens = small_camera();
  lens.chromatic_aberration = {1.01, 0.99};
  const auto bgr = [&](const Camera& camera) {
    std::array<cv::Mat, 3> channels;
    cv::split(renderer_of({short_shaft()}, 0.1F, camera).render({across_the_view(0.4, 1)}, 1), channels.data());
    return channels;
  };
  const auto plain = bgr(small_camera()), aberrated = bgr(lens);
  for (const auto& [channel, times] : {std::pair(0U, 1.01), std::pair(1U, 1.0), std::pair(2U, 0.99)}) {
    const cv::Matx23d magnify(times, 0, lens.cx_px * (1 - times), 0, times, lens.cy_px * (1 - times));
    cv::Mat expected;
    cv::warpAffine(plain[channel], expected, magnify, plain[channel].size(), cv::INTER_CUBIC, cv::BORDER_REPLICATE);
    EXPECT_LE(max_difference(aberrated[channel], expected), times == 1 ? 0 : 8) << channel;
  }
}

TEST(Renderer, BoundariesLieWhereKinematicsSays) {
  Random random(5);
  Camera distorting = small_camera();
  distorting.distortion = {-0.28, 0.09, 0.0006, -0.0004, 0};
  for (const auto& [camera, shaft] : {std::pair(small_camera(), short_shaft()), std::pair(distorting, short_shaft()),
                                      std::pair(small_camera(), askew_shaft(1.4e-3, 0.24))}) {
    Renderer renderer = renderer_of({shaft}, 0.1F, camera);
    int checked = 0;
    for (int trial = 0; trial < 30; ++trial) {
      const ShaftPlacement placement = across_the_view(random.uniform(-pi, pi), random.uniform(-pi, pi));
      const auto line = centre_line(camera, shaft.marker, placement.camera_from_unrolled, placement.psi_rad).value();
      if (distance_to_seam_rad(shaft.marker, line.tau_rad) < 0.2) continue;  // the seam runs beside the line
      const cv::Mat light = light_of(renderer.render({placement}, 1), camera.response);
      for (std::size_t k = 0; k < 4; ++k) {
        const Eigen::Vector2d at = camera.raw_from_ideal(line.ideal_px[k]);
        const Eigen::Vector2d direction =
            (camera.raw_from_ideal(line.ideal_px[3]) - camera.raw_from_ideal(line.ideal_px[0])).normalized();
        const auto off_px = crossing_px(light, at, direction);
        ASSERT_TRUE(off_px) << "trial " << trial << " boundary " << k;
        // The ends are seen slantwise over the film's edge, and the light falls off along them.
        EXPECT_NEAR(*off_px, 0, k == 0 || k == 3 ? 0.15 : 0.06) << "trial " << trial << " boundary " << k;
      }
      ++checked;
    }
    EXPECT_GT(checked, 15);
  }
}

TEST(Renderer, TheShaftShowsInTheGap) {
  const Camera camera = small_camera();
  for (const double gap_rad : {0.3, 0.03}) {
    const ShaftModel shaft = askew_shaft(0, gap_rad);
    Renderer renderer = renderer_of({shaft}), without = renderer_of({short_shaft()});
    ShaftPlacement placement = across_the_view(0.3, 0);
    const auto facing = centre_line(camera, shaft.marker, placement.camera_from_unrolled, 0).value();
    placement.psi_rad = facing.tau_rad + gap_rad / 2;  // the gap's middle faces the camera
    const auto line = centre_line(camera, shaft.marker, placement.camera_from_unrolled, placement.psi_rad).value();
    ASSERT_FALSE(is_printed(shaft.marker, line.tau_rad));
    const cv::Mat gap = light_of(renderer.render({placement}, 1), camera.response);
    const cv::Mat none = light_of(without.render({placement}, 1), camera.response);
    const Eigen::Vector2d middle = 0.9 * line.ideal_px[3] + 0.1 * line.ideal_px[0];
    const float ratio = light_at(gap, middle).norm() / light_at(none, middle).norm();
    EXPECT_LT(ratio, gap_rad > 0.1 ? 0.2F : 0.99F);  // narrower than a pixel: darker by its fraction
  }
}

// No aliasing: a shift of any part of a pixel moves the image's centre of light by as much.
TEST(Renderer, ASubPixelShiftMovesTheLightByAsMuch) {
  Camera camera = small_camera();
  camera.response = {Response::Kind::power, 1};
  const auto centre_of_light = [&](const Eigen::Vector2d& shift_px, double turn_rad) {
    Camera moved = camera;
    moved.cx_px += shift_px.x();
    moved.cy_px += shift_px.y();
    const cv::Mat bgr = renderer_of({short_shaft()}, 0, moved).render({across_the_view(turn_rad, 0.8)}, 1);
    const cv::Mat light = light_of(bgr, camera.response);
    Eigen::Vector2d moment = Eigen::Vector2d::Zero();
    double weight = 0;
    for (int v = 0; v < light.rows; ++v)
      for (int u = 0; u < light.cols; ++u) {
        const auto& pixel = light.at<cv::Vec3f>(v, u);
        const double sum = pixel[0] + pixel[1] + pixel[2];
        moment += sum * Eigen::Vector2d(u, v);
        weight += sum;
      }
    return Eigen::Vector2d(moment / weight);
  };
  // Shafts along the pixel grid are shifted along themselves, as the rounding of whole dark rows to 8 bits would count.
  const std::vector<std::pair<double, Eigen::Vector2d>> cases{
      {0, {1, 0}}, {0.4, {-0.3, 1}}, {0.7, {1, -0.5}}, {1.3, {0.2, 1}}, {pi / 2, {0, 1}}};
  for (const auto& [turn_rad, direction] : cases) {
    const Eigen::Vector2d still = centre_of_light({0, 0}, turn_rad);
    for (const double shift_px : {0.1, 0.25, 0.5, 0.7, 1.0}) {
      const Eigen::Vector2d moved = centre_of_light(shift_px * direction, turn_rad) - still;
      EXPECT_LT((moved - shift_px * direction).norm(), 0.015) << turn_rad << ' ' << shift_px;
    }
  }
}

TEST(Renderer, MotionBlurIsTheMeanOfItsMoments) {
  Camera camera = small_camera();
  camera.response = {Response::Kind::power, 1};
  const cv::Mat tissue = make_tissue(camera.width_px, camera.height_px, 3);
  Renderer renderer(camera, {short_shaft(), short_shaft()}, tissue, quiet());
  const auto moment = [](double turn_rad) {
    return std::vector{across_the_view(turn_rad, 1), across_the_view(turn_rad + 2, 2, 0.13)};
  };
  const cv::Mat a = renderer.render(moment(0.2), 1), b = renderer.render(moment(0.5), 1);
  cv::Mat mean;
  cv::addWeighted(a, 0.5, b, 0.5, 0, mean);
  EXPECT_LE(max_difference(renderer.render_exposure({moment(0.2), moment(0.5)}, 1), mean), 1);
  EXPECT_LE(max_difference(renderer.render_exposure({moment(0.2), moment(0.2)}, 1), a), 1);
}

TEST(Renderer, TheNearerShaftHidesTheFarther) {
  const ShaftPlacement near = across_the_view(0.2, 1, 0.08), far = across_the_view(1.6, 2, 0.13);
  Renderer both = renderer_of({short_shaft(), short_shaft()});
  const cv::Mat a = both.render({near, far}, 1), b = both.render({far, near}, 1);
  const cv::Mat only_near = renderer_of({short_shaft()}).render({near}, 1);
  const cv::Rect middle(230, 150, 20, 20);
  EXPECT_LE(max_difference(a(middle), only_near(middle)), 1);
  EXPECT_LE(max_difference(b(middle), only_near(middle)), 1);
  EXPECT_GT(max_difference(a, only_near), 50);
}

// dVRK's needle driver behind the shaft's end.
ShaftModel shaft_with_tool() {
  ShaftModel model = short_shaft();
  Tool& tool = model.tool.emplace(needle_driver());
  Tool::Place& place = tool.place.emplace();
  place.base_in_marker_m = {0, 0, model.marker.length_m() + model.shaft_beyond_m};
  place.azimuth_rad = 0.4;
  return model;
}

TEST(Renderer, AToolEndsWhereItsKinematicsSay) {
  const Camera camera = small_camera();
  const ShaftModel with = shaft_with_tool();
  Renderer renderer = renderer_of({with}, 0.9F), bare = renderer_of({short_shaft()}, 0.9F);
  Random random(17);
  int shown = 0;
  for (int trial = 0; trial < 60; ++trial) {
    ShaftPlacement placement = across_the_view(random.uniform(-pi, pi), random.uniform(-pi, pi));
    placement.wrist_rad = {random.uniform(-0.8, 0.8), random.uniform(-0.8, 0.8)};
    const Rigid3 pose = camera_from_marker(with.marker, placement.camera_from_unrolled, placement.psi_rad);
    const Rigid3 marker_from_tip = tip_in_marker(*with.tool, placement.wrist_rad).marker_from_tip;
    const Eigen::Vector2d tip_px = camera.ideal_from_point(pose * marker_from_tip.translation);
    if (!cv::Rect(5, 5, camera.width_px - 10, camera.height_px - 10)
             .contains(cv::Point(static_cast<int>(tip_px.x()), static_cast<int>(tip_px.y()))))
      continue;
    const Rigid3 marker_from_jaw = marker_from_tip * with.tool->last_from_tip.inverse();
    const Eigen::Vector2d jaw_px = tip_px - camera.ideal_from_point(pose * marker_from_jaw.translation);
    if (jaw_px.norm() < 50) continue;  // its round end shows beyond it, or it lies behind the wrist
    ++shown;
    cv::Mat changed;
    cv::absdiff(renderer.render({placement}, 1), bare.render({placement}, 1), changed);
    double nearest_px = 1e9, beyond_px = -1e9;
    for (int v = 0; v < changed.rows; ++v)
      for (int u = 0; u < changed.cols; ++u) {
        const cv::Vec3b& by = changed.at<cv::Vec3b>(v, u);
        if (std::max({by[0], by[1], by[2]}) < 8) continue;
        const Eigen::Vector2d off_px = Eigen::Vector2d(u, v) - tip_px;
        nearest_px = std::min(nearest_px, off_px.norm());
        beyond_px = std::max(beyond_px, off_px.dot(jaw_px.normalized()));
      }
    EXPECT_LT(nearest_px, 1.5) << trial;
    EXPECT_NEAR(beyond_px, 1, 3) << trial;  // blurred
  }
  EXPECT_GT(shown, 20);
}

// A jaw that bends back over the marker.
TEST(Renderer, AToolHidesTheMarkerOnlyWhereItIsInFrontOfIt) {
  const Camera camera = small_camera();
  Random random(18);
  for (int trial = 0; trial < 10; ++trial) {
    const ShaftPlacement placement = across_the_view(random.uniform(-pi, pi), random.uniform(-pi, pi));
    ShaftModel shaft = short_shaft();
    const Rigid3 pose = camera_from_marker(shaft.marker, placement.camera_from_unrolled, placement.psi_rad);
    const Eigen::Vector3d camera_in_marker_m = pose.inverse().translation;
    const Eigen::Vector3d towards(camera_in_marker_m.x(), camera_in_marker_m.y(), 0);
    const cv::Mat bare = renderer_of({shaft}).render({placement}, 1);
    const auto over_marker = [&](double side) {
      Tool& tool = shaft.tool.emplace();
      tool.wrist = {{.name = "wrist"}};
      tool.place.emplace().base_in_marker_m = {0, 0, shaft.marker.length_m() + shaft.shaft_beyond_m};
      tool.last_from_tip.translation = side * 0.012 * towards.normalized() - Eigen::Vector3d(0, 0, 0.024);
      const Eigen::Vector3d tip_m =
          pose * (tool.place->base_in_marker_m + tool.last_from_tip.translation - side * 0.001 * towards.normalized());
      const Eigen::Vector2d tip_px = camera.ideal_from_point(tip_m);
      const cv::Rect around(static_cast<int>(tip_px.x()) - 2, static_cast<int>(tip_px.y()) - 2, 5, 5);
      return max_difference(renderer_of({shaft}).render({placement}, 1)(around), bare(around));
    };
    EXPECT_GT(over_marker(1), 30) << trial;
    EXPECT_EQ(over_marker(-1), 0) << trial;
  }
}

}  // namespace lapservo::internal::renderer_test
