#include "lapservo/vision/image/interlacing.h"

#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/testing/scenes.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::internal::interlacing_test {

using scenes::usual_shot;

cv::Mat woven(const cv::Mat& even, const cv::Mat& odd) {
  cv::Mat frame = even.clone();
  for (int v = 1; v < frame.rows; v += 2) odd.row(v).copyTo(frame.row(v));
  return frame;
}

// By how much a coordinate of q changes for the marker's surface to move by so many pixels.
Eigen::Vector4d step_of(const Rig& rig, const JointVector& q, int coordinate, double px) {
  const double depth_m = scenes::pose_of(rig, 0, q).camera_from_unrolled.translation.z();
  const double shift_m = px * depth_m / rig.camera.fx_px;
  const Eigen::Vector4d per_m(1 / q.rho_m, 1 / q.rho_m, 1, 1 / rig.instruments[0].marker.radius_m());
  return shift_m * per_m[coordinate] * Eigen::Vector4d::Unit(coordinate);
}

struct Woven {
  JointVector q;  ///< of the even field
  cv::Mat frame;
};

Woven woven_shot(std::uint64_t seed, int coordinate, double px) {
  const scenes::Shot& shot = usual_shot(seed);
  const auto moved = JointVector::from_vector(shot.q.vector() + step_of(shot.rig, shot.q, coordinate, px));
  return {shot.q, woven(shot.bgr, scenes::render(shot.rig, {moved}, seed + 100))};
}

double psi_error(const Observation& o, const JointVector& truth) {
  return wrap_pi(o.rcm.value().q.psi_rad - truth.psi_rad);
}

TEST(Interlacing, TwoMomentsAreNotTakenForOne) {
  const Rig rig = scenes::usual_rig();
  for (int coordinate = 0; coordinate < 4; ++coordinate)
    for (const double px : {5.0, 8.0, 12.0, 20.0, 30.0})
      for (std::uint64_t seed = 1; seed <= 3; ++seed) {
        SCOPED_TRACE("coordinate " + std::to_string(coordinate) + ", " + std::to_string(px) + " px, seed " +
                     std::to_string(seed));
        const Woven shot = woven_shot(seed, coordinate, px);
        const Observation o = Tracker(rig).track(shot.frame)[0];
        if (coordinate < 3 && px < 20) {
          EXPECT_EQ(o.status, Status::interlaced) << to_string(o.status);
        }
        if (o.status == Status::ok) {
          EXPECT_LT(std::abs(psi_error(o, shot.q)), 0.1);
        }
      }
}

// Whether the rig says that there are two, or the caller.
TEST(Interlacing, OneFieldTellsItsMoment) {
  Rig rig = scenes::usual_rig();
  rig.camera.deinterlace = true;
  double squares = 0;
  int count = 0;
  for (int coordinate = 0; coordinate < 4; ++coordinate)
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      const Woven shot = woven_shot(seed, coordinate, 15);
      SCOPED_TRACE("coordinate " + std::to_string(coordinate) + ", seed " + std::to_string(seed));
      const Observation o = Tracker(rig).track(shot.frame)[0];
      ASSERT_EQ(o.status, Status::ok);
      EXPECT_EQ(Tracker(scenes::usual_rig(), {.deinterlace = true}).track(shot.frame)[0].psi_rad, o.psi_rad);
      EXPECT_LT(std::abs(psi_error(o, shot.q)), 0.012);
      squares += std::pow(psi_error(o, shot.q), 2) / o.rcm->covariance(3, 3), ++count;
    }
  EXPECT_LT(std::sqrt(squares / count), 1.5);
}

TEST(Interlacing, NoiseBlurAndDarknessAreNoFields) {
  const Rig rig = scenes::usual_rig();
  for (const Sensor& sensor : {Sensor{}, Sensor{.read_noise = 4 * Sensor{}.read_noise}, Sensor{.blur_px = 2.2},
                               Sensor{.blur_px = 0.3}, Sensor{.gains = Light::Constant(0.15F)}})
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      const scenes::Shot shot(seed, {.lighting = {}, .sensor = sensor});
      EXPECT_EQ(Tracker(rig).track(shot.bgr)[0].status, Status::ok) << "seed " << seed;
    }
}

// A texture that is as fine across as down.
TEST(Interlacing, AChessboardOfPixelsIsNoFields) {
  cv::Mat board(60, 80, CV_8UC3), stripes(60, 80, CV_8UC3);
  for (int v = 0; v < board.rows; ++v)
    for (int u = 0; u < board.cols; ++u) {
      board.at<cv::Vec3b>(v, u) = cv::Vec3b::all((u + v) % 2 ? 200 : 40);
      stripes.at<cv::Vec3b>(v, u) = cv::Vec3b::all(v % 2 ? 200 : 40);
    }
  const cv::Rect all(0, 0, 80, 60);
  EXPECT_FALSE(is_combed(ImageView(board), all));
  EXPECT_TRUE(is_combed(ImageView(stripes), all));
  EXPECT_FALSE(is_combed(ImageView(stripes), cv::Rect(0, 0, 3, 3)));
  EXPECT_FALSE(is_combed(ImageView(stripes), cv::Rect(79, 59, 1, 1)));
}

TEST(Interlacing, TheEvenFieldKeepsItsRowsAndInterpolatesLight) {
  cv::Mat frame(5, 2, CV_8UC3);
  for (int v = 0; v < frame.rows; ++v) frame.row(v) = cv::Scalar::all(v == 2 ? 255 : v % 2 ? 77 : 0);
  const Response linear{Response::Kind::power, 1};
  EvenField field(linear);
  const cv::Mat& even = field.of(frame);
  ASSERT_EQ(even.size(), frame.size());
  for (const auto& [v, value] : {std::pair(0, 0), {2, 255}, {4, 0}}) EXPECT_EQ(even.at<cv::Vec3b>(v, 1)[2], value) << v;
  for (const int v : {1, 3}) EXPECT_NEAR(even.at<cv::Vec3b>(v, 1)[2], 127.5, 1) << v;
  EXPECT_NEAR(EvenField(Response{}).of(frame).at<cv::Vec3b>(1, 0)[0], 188, 1);  // half the light in sRGB
  const cv::Mat last = frame.rowRange(0, 4);
  EXPECT_EQ(EvenField(linear).of(last).at<cv::Vec3b>(3, 0)[0], 255);
}

}  // namespace lapservo::internal::interlacing_test
