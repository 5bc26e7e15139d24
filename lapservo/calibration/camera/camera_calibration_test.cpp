#include "lapservo/calibration/camera/camera_calibration.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>

#include <gtest/gtest.h>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/imgproc.hpp>

#include "lapservo/calibration/camera/camera_measurement.h"
#include "lapservo/core/random.h"
#include "lapservo/sim/boards.h"
#include "lapservo/testing/has.h"

namespace lapservo::internal::camera_calibration_test {
using testing::has;

Camera small_camera() {
  return {640, 480, 612.5, 612.5, 326.2, 233.1, {-0.21, 0.06, 2e-4, -3e-4, 0}, {}};
}

// sRGB bent by a logistic curve: more contrast.
Response contrasty(double contrast) {
  Response table{Response::Kind::table, 1, {}, {}};
  const auto logistic = [&](double x) { return 1 / (1 + std::exp(-contrast * (x - 0.5))); };
  for (int i = 0; i <= 64; ++i) {
    const double s = i / 64.0;
    table.table_light.push_back(Response{}.light_from_value(s));
    table.table_value.push_back((logistic(s) - logistic(0)) / (logistic(1) - logistic(0)));
  }
  table.table_light.back() = table.table_value.back() = 1;
  return table;
}

// The largest difference of values from `low` to `high` after the exposure that makes it smallest.
double difference_within(const Response& is, const Response& truth, double low, double high) {
  double best = 1;
  for (int i = -400; i <= 400; ++i) {
    const double exposure = std::exp(5e-4 * i);
    double most = 0;
    for (int k = 0; k <= 40; ++k) {
      const double value = low + (high - low) * k / 40;
      most = std::max(most,
                      std::abs(is.value_from_light(std::min(1.0, exposure * truth.light_from_value(value))) - value));
    }
    best = std::min(best, most);
  }
  return best;
}

const Board board{9, 6, 0.005};

std::vector<BoardView> views_of(const BoardScene& scene, const Camera& camera, int count, std::uint64_t seed) {
  BoardViews views(board, 50);
  for (const Rigid3& pose : board_poses(scene, camera, count, seed)) {
    const std::string name = "view " + std::to_string(seed);
    EXPECT_TRUE(views.add(name, render_board(scene, camera, pose, ++seed), true)) << name;
  }
  return views.take();
}

void expect_found(const Camera& camera, const CameraCalibration& found) {
  ASSERT_EQ(found.refusal, "");
  const CameraSigmas& sigmas = found.camera.sigmas;
  EXPECT_NEAR(found.camera.fx_px, camera.fx_px, 1e-3 * camera.fx_px);
  EXPECT_NEAR(found.camera.fy_px, camera.fy_px, 1e-3 * camera.fy_px);
  EXPECT_NEAR(found.camera.cx_px, camera.cx_px, 0.5);
  EXPECT_NEAR(found.camera.cy_px, camera.cy_px, 0.5);
  constexpr double most_sigmas = 4;
  EXPECT_NEAR(found.camera.fx_px, camera.fx_px, most_sigmas * sigmas.fx_px);
  EXPECT_NEAR(found.camera.cx_px, camera.cx_px, most_sigmas * sigmas.cx_px);
  EXPECT_NEAR(found.camera.cy_px, camera.cy_px, most_sigmas * sigmas.cy_px);
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_NEAR(found.camera.distortion[i], camera.distortion[i], most_sigmas * sigmas.distortion[i]) << i;
  EXPECT_NEAR(found.camera.chromatic_aberration.blue, camera.chromatic_aberration.blue, 5e-5);
  EXPECT_NEAR(found.camera.chromatic_aberration.red, camera.chromatic_aberration.red, 5e-5);
}

TEST(CalibrateCamera, FindsLensAberrationAndResponse) {
  Random random(40);
  Camera camera = small_camera();
  camera.fx_px = camera.fy_px = random.uniform(580, 660);
  camera.cx_px += random.uniform(-8, 8), camera.cy_px += random.uniform(-8, 8);
  camera.distortion[0] += random.uniform(-0.05, 0.05);
  camera.chromatic_aberration = {1 + random.uniform(-1e-3, 1e-3), 1 + random.uniform(-1e-3, 1e-3)};
  camera.response = contrasty(random.uniform(2.5, 5));
  const CameraCalibration found = calibrate_camera(board, views_of({}, camera, 10, 4000), {});
  expect_found(camera, found);
  ASSERT_TRUE(found.response);
  EXPECT_EQ(found.camera.response.kind, Response::Kind::table);
  EXPECT_LT(difference_within(found.camera.response, camera.response, 0.02, 1), 0.02);
  EXPECT_LT(std::abs(found.bright_wider_px), 0.01);
  EXPECT_EQ(found.camera.distortion[4], 0) << "k3 that doesn't show";
  EXPECT_EQ(found.camera.fx_px, found.camera.fy_px);
}

TEST(CalibrateCamera, TheSamePicturesGiveTheSameNumbers) {
  const Camera camera = small_camera();
  const auto once = [&] { return calibrate_camera(board, views_of({}, camera, 6, 130), {}); };
  const CameraCalibration first = once();
  ASSERT_EQ(first.refusal, "");
  cv::theRNG().next();  // whoever else draws
  const std::vector<double> elsewhere(12345);
  EXPECT_EQ(measured_camera(once()), measured_camera(first));
  const double decimals = first.camera.fx_px * 1e6;
  EXPECT_NEAR(decimals, std::round(decimals), 1e-3) << "digits far below sigma";
}

// Evenly lit, the edges leave a curve's contrast open. The response from boards lies within two sigmas, and is named
// where the truth has a name.
TEST(CalibrateCamera, TakesAUsualResponseUnlessEdgesSpeakAgainstIt) {
  struct Case {
    double blur_px;
    std::string name;
    Response response;
  };
  for (const Case& c : {Case{1.6, "srgb", {}},
                        {1.2, "rec709", {Response::Kind::rec709}},
                        {0.8, "gamma:2.2", {Response::Kind::power, 2.2}},
                        {1.2, "table", contrasty(4)}}) {
    Camera camera = small_camera();
    camera.response = c.response;
    const BoardScene scene{.falloff = 0, .blur_px = c.blur_px};
    const CameraCalibration found = calibrate_camera(board, views_of(scene, camera, 5, 310), {});
    ASSERT_TRUE(found.response) << found.refusal;
    const ResponseFit& fit = *found.response;
    EXPECT_EQ(found.camera.response, fit.response);
    EXPECT_LE(difference_within(fit.response, c.response, fit.low, fit.high), 2 * fit.sigma) << c.name;
    EXPECT_EQ(fit.response.kind == Response::Kind::table ? "table" : fit.nearest, c.name);
  }
}

TEST(CalibrateCamera, TellsSharpeningFromTheResponse) {
  const Camera camera = small_camera();
  const BoardScene scene{.sharpening = 0.5};
  const CameraCalibration found = calibrate_camera(board, views_of(scene, camera, 6, 90), {});
  expect_found(camera, found);
  ASSERT_TRUE(found.response);
  EXPECT_NEAR(found.response->sharpening, scene.sharpening, 0.15);
  EXPECT_EQ(found.camera.response.kind, Response::Kind::srgb);
}

TEST(CalibrateCamera, FindsPixelsThatAreNotSquare) {
  Camera camera = small_camera();
  camera.fy_px *= 1.01;
  expect_found(camera, calibrate_camera(board, views_of({}, camera, 7, 110), {}));
}

TEST(CalibrateCamera, RefusesViewsThatAreTooFewOrAlike) {
  const Camera camera = small_camera();
  const BoardScene scene;
  std::vector<BoardView> views = views_of(scene, camera, 3, 130);
  EXPECT_TRUE(has(calibrate_camera(board, views, {}).refusal, "1 more view"));
  EXPECT_NE(calibrate_camera(board, {}, {}).refusal, "");
  Rigid3 flat;
  flat.translation = {-0.05, -0.02, 0.12};
  BoardViews same(board, 50);
  for (int i = 0; i < 6; ++i) {
    flat.translation.x() += 1e-4;
    same.add("", render_board(scene, camera, flat, 150 + static_cast<std::uint64_t>(i)), true);
  }
  const std::string refusal = calibrate_camera(board, same.views(), {}).refusal;
  for (const char* part : {"too alike", "tilt the board", "right"}) EXPECT_TRUE(has(refusal, part));
}

// By corners alone: the images show none.
TEST(CalibrateCamera, NamesAFisheyeLens) {
  const Camera camera = small_camera();
  for (const bool is_fisheye : {false, true}) {
    std::vector<BoardView> views;
    for (Rigid3 pose : board_poses({}, camera, 8, 210)) {
      BoardView& view = views.emplace_back(BoardView{"", cv::Mat(480, 640, CV_8UC3, cv::Scalar::all(90)), {}});
      if (is_fisheye) pose.translation.z() *= 0.4;
      for (int i = 0; i < board.columns * board.rows; ++i) {
        const int column = i % board.columns, row = i / board.columns;
        const Eigen::Vector3d m = pose * board.corner_m(column, row);
        const double across = m.head<2>().norm(), radius_px = 250 * std::atan2(across, m.z());
        const Eigen::Vector2d px = Eigen::Vector2d(319.5, 239.5) + radius_px / across * m.head<2>();
        view.corners.push_back({column, row, is_fisheye ? px : camera.raw_from_point(m)});
      }
    }
    const std::string refusal = calibrate_camera(board, views, {}).refusal;
    EXPECT_EQ(refusal.find("the lens is a fisheye of some 183 degrees") != std::string::npos, is_fisheye) << refusal;
  }
}

TEST(CalibrateCamera, ChoosesViewsThatDiffer) {
  const Camera camera = small_camera();
  const auto poses = board_poses({}, camera, 2, 170);
  const cv::Mat one = render_board({}, camera, poses[0], 1), again = render_board({}, camera, poses[0], 2);
  const cv::Mat other = render_board({}, camera, poses[1], 3);
  BoardViews views(board, 50);
  for (const cv::Mat& frame : {one, again, other}) EXPECT_TRUE(views.add("", frame, false));
  EXPECT_EQ(views.views().size(), 2U);
  EXPECT_FALSE(views.add("", cv::Mat(480, 640, CV_8UC3, cv::Scalar(90, 90, 90)), true));
}

TEST(CalibrateCamera, ReadsCharucoBoards) {
  const Board charuco{7, 5, 0.005, "DICT_5X5_50", 0.0035};
  ASSERT_EQ(board_problem(charuco), "");
  EXPECT_TRUE(has(board_problem({7, 5, 0.005, "DICT_9X9", 0.0035}), "DICT_5X5_50"));
  EXPECT_TRUE(has(board_problem({20, 20, 0.005, "DICT_5X5_50", 0.0035}), "220"));
  constexpr int square_px = 60;
  cv::Mat pattern;
  const cv::Size pattern_px(8 * square_px, 6 * square_px);
  const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_5X5_50);
#if CV_VERSION_MAJOR > 4 || (CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR >= 7)
  cv::aruco::CharucoBoard({8, 6}, 0.005F, 0.0035F, dictionary).generateImage(pattern_px, pattern);
#else
  cv::aruco::CharucoBoard::create(8, 6, 0.005F, 0.0035F, dictionary)->draw(pattern_px, pattern);
#endif
  Camera camera = small_camera();
  camera.distortion = {};
  const BoardScene scene{.columns = 7, .rows = 5};
  BoardViews views(charuco, 50);
  for (const Rigid3& pose : board_poses(scene, camera, 6, 190)) {
    // Pixel of the pattern to twice the image's.
    const Eigen::Matrix3d r = pose.rotation.toRotationMatrix();
    Eigen::Matrix3d from_board, camera_matrix, board_from_pattern, twice;
    from_board << r.col(0), r.col(1), pose.translation;
    camera_matrix << camera.fx_px, 0, camera.cx_px, 0, camera.fy_px, camera.cy_px, 0, 0, 1;
    const double per_px = charuco.square_m / square_px, from = 0.5 * per_px - charuco.square_m;
    board_from_pattern << per_px, 0, from, 0, per_px, from, 0, 0, 1;
    twice << 2, 0, 0.5, 0, 2, 0.5, 0, 0, 1;
    const Eigen::Matrix3d h = twice * camera_matrix * from_board * board_from_pattern;
    const cv::Matx33d homography(h(0, 0), h(0, 1), h(0, 2), h(1, 0), h(1, 1), h(1, 2), h(2, 0), h(2, 1), h(2, 2));
    cv::Mat large, grey, bgr;
    cv::warpPerspective(pattern, large, homography, cv::Size(1280, 960), cv::INTER_AREA, cv::BORDER_CONSTANT,
                        cv::Scalar(255));
    cv::GaussianBlur(large, large, {}, 1.2);
    cv::resize(large, grey, cv::Size(640, 480), 0, 0, cv::INTER_AREA);
    grey.convertTo(grey, CV_8U, 0.8, 20);
    cv::cvtColor(grey, bgr, cv::COLOR_GRAY2BGR);
    EXPECT_TRUE(views.add("", bgr, true));
  }
  const CameraCalibration found = calibrate_camera(charuco, views.views(), {});
  ASSERT_EQ(found.refusal, "");
  EXPECT_NEAR(found.camera.fx_px, camera.fx_px, 3e-3 * camera.fx_px);
  EXPECT_NEAR(found.camera.cx_px, camera.cx_px, 2);
  EXPECT_NEAR(found.camera.cy_px, camera.cy_px, 2);
}

}  // namespace lapservo::internal::camera_calibration_test
