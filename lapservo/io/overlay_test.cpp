#include "lapservo/io/overlay.h"

#include <gtest/gtest.h>

#include "lapservo/kinematics/centre_line.h"
#include "lapservo/testing/rigs.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal::overlay_test {

using What = Observation::Refused::What;
const JointVector q{0.07, 1.57, 0.064, 1.2};

Rig rig_with_rcm_in_view() {
  Rig rig = testing::paper_test_rig();
  rig.instruments[0].camera_from_rcm->translation += Eigen::Vector3d(0.05, 0.04, 0.02);
  return rig;
}

cv::Mat grey_frame(const Rig& rig) {
  return {rig.camera.height_px, rig.camera.width_px, CV_8UC3, cv::Scalar(90, 90, 90)};
}

Observation seen_at(const Rig& rig) {
  const Instrument& instrument = rig.instruments[0];
  Observation o;
  o.status = Status::ok;
  o.camera_from_unrolled = *instrument.camera_from_rcm * rcm_from_unrolled(q);
  o.psi_rad = q.psi_rad;
  o.edges_ideal_px = centre_line(rig.camera, instrument.marker, o.camera_from_unrolled, q.psi_rad)->ideal_px;
  o.edges_raw_px = o.edges_ideal_px;
  o.features = features_of(o.edges_ideal_px, projected_rcm_px(rig.camera, *instrument.camera_from_rcm));
  o.rcm = Observation::Rcm{q, 1e-6 * Eigen::Matrix4d::Identity()};
  return o;
}

// Pixels within `reach_px` of a place that the overlay changed.
int drawn_near(const cv::Mat& frame, const cv::Mat& overlay, const Eigen::Vector2d& px, int reach_px) {
  const cv::Rect around(static_cast<int>(px.x()) - reach_px, static_cast<int>(px.y()) - reach_px, 2 * reach_px + 1,
                        2 * reach_px + 1);
  const cv::Rect inside = around & cv::Rect(0, 0, frame.cols, frame.rows);
  cv::Mat changed;
  cv::absdiff(frame(inside), overlay(inside), changed);
  return cv::countNonZero(changed.reshape(1));
}

TEST(Overlay, MarksTheRcmWhenItLiesInThePicture) {
  const Rig near = rig_with_rcm_in_view();
  const Eigen::Vector2d rcm_px = projected_rcm_px(near.camera, *near.instruments[0].camera_from_rcm).value();
  ASSERT_GT(rcm_px.minCoeff(), 20);
  const cv::Mat frame = grey_frame(near), overlay = draw_overlay(frame, near, {seen_at(near)});
  EXPECT_GT(drawn_near(frame, overlay, rcm_px, 4), 10);
  const Eigen::Vector2d halfway = (rcm_px + seen_at(near).edges_raw_px[0]) / 2;
  EXPECT_GT(drawn_near(frame, overlay, halfway, 15), 10) << "r leads there";
}

TEST(Overlay, DrawsTheTipWithItsEllipse) {
  const Rig rig = rig_with_rcm_in_view();
  const cv::Mat frame = grey_frame(rig);
  Observation seen = seen_at(rig);
  seen.tip = Observation::Tip{};
  Observation::Tip& tip = *seen.tip;
  tip.camera_from_tip.translation = {0.02, 0.025, 0.1};
  tip.covariance.diagonal() << 1e-6, 4e-6, 0, 0, 0, 0;
  const Eigen::Vector2d px = rig.camera.raw_from_point(tip.camera_from_tip.translation);
  ASSERT_GT(drawn_near(frame, draw_overlay(frame, rig, {seen}), px, 3), 5);
  const cv::Mat overlay = draw_overlay(frame, rig, {seen});
  const double chi = std::sqrt(5.991), a_px = rig.camera.fx_px / 0.1 * 1e-3 * chi, b_px = 2 * a_px;
  for (const Eigen::Vector2d& at : {Eigen::Vector2d(-a_px, 0), Eigen::Vector2d(0, b_px)})
    EXPECT_GT(drawn_near(frame, overlay, px + at, 2), 3) << at.transpose();
  EXPECT_EQ(drawn_near(frame, overlay, px + Eigen::Vector2d(-a_px / 2, b_px / 2), 2), 0) << "between cross and ellipse";
  seen.tip->camera_from_tip.translation.z() = -0.1;
  Observation without = seen;
  without.tip.reset();
  EXPECT_EQ(cv::norm(draw_overlay(frame, rig, {seen}), draw_overlay(frame, rig, {without}), cv::NORM_INF), 0)
      << "behind the camera";
}

// A label's backing makes grey of 90 about 32; nothing else of a marker far from its lines has that.
TEST(Overlay, LabelsStandBesideTheMarker) {
  for (const double direction_rad : {0.1, 0.8, 1.5, 2.4, 3.0, 4.0, 5.5}) {
    Rig rig = testing::paper_test_rig();
    Rigid3& camera_from_rcm = *rig.instruments[0].camera_from_rcm;
    const double half_m = rig.instruments[0].marker.length_m() / 2;
    const Eigen::Vector3d middle = camera_from_rcm * rcm_from_unrolled(q) * Eigen::Vector3d(0, 0, half_m);
    const Eigen::Matrix3d turned = Eigen::AngleAxisd(direction_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    const Eigen::Vector3d in_view(0.004, -0.006, middle.z());
    camera_from_rcm.translation = in_view + turned * (camera_from_rcm.translation - middle);
    camera_from_rcm.rotation = Eigen::Quaterniond(turned) * camera_from_rcm.rotation;
    const Observation seen = seen_at(rig);
    const cv::Mat overlay = draw_overlay(grey_frame(rig), rig, {seen});
    int over = 0;
    for (const double place : {0.15, 0.5, 0.85}) {
      const Eigen::Vector2d px = seen.edges_raw_px[0] + place * (seen.edges_raw_px[3] - seen.edges_raw_px[0]);
      const cv::Rect around(static_cast<int>(px.x()) - 20, static_cast<int>(px.y()) - 20, 41, 41);
      cv::Mat backed;
      cv::inRange(overlay(around & cv::Rect(0, 0, overlay.cols, overlay.rows)), cv::Scalar::all(30),
                  cv::Scalar::all(34), backed);
      over += cv::countNonZero(backed);
    }
    EXPECT_LT(over, 60) << direction_rad;
  }
}

// With the status, and in another style than an accepted measurement.
TEST(Overlay, DrawsWhatWasRefused) {
  const Rig rig = testing::paper_test_rig();
  const cv::Mat frame = grey_frame(rig);
  Observation nothing;
  nothing.status = Status::poor_fit;
  const Observation found = seen_at(rig);
  Observation by_pose = nothing, by_edges = nothing;
  by_pose.refused.what = What::pose;
  by_pose.refused.camera_from_unrolled = found.camera_from_unrolled;
  by_pose.refused.psi_rad = found.psi_rad;
  by_edges.refused.what = What::edges;
  by_edges.refused.edges_raw_px = found.edges_raw_px;
  const Eigen::Vector2d proximal = found.edges_raw_px[0];
  const cv::Mat without = draw_overlay(frame, rig, {nothing}), believed = draw_overlay(frame, rig, {found});
  EXPECT_EQ(drawn_near(frame, without, proximal, 12), 0);
  for (const Observation& refused : {by_pose, by_edges}) {
    const cv::Mat overlay = draw_overlay(frame, rig, {refused});
    EXPECT_GT(drawn_near(frame, overlay, proximal, 12), 10);
    EXPECT_GT(drawn_near(believed, overlay, proximal, 12), 10) << "another style";
    EXPECT_GT(drawn_near(frame, overlay, {60, 26}, 20), 10) << "the reason";
  }
}

// A pose of which a part lies beside the camera, 1e10 px away.
TEST(Overlay, DrawsWhatReachesFarBeyondThePicture) {
  const Rig rig = testing::paper_test_rig();
  const cv::Mat frame = grey_frame(rig);
  Observation far;
  far.status = Status::poor_fit;
  far.refused.what = What::edges;
  far.refused.edges_raw_px = seen_at(rig).edges_raw_px;
  far.refused.edges_raw_px[3] = {3e10, -2e11};
  EXPECT_GT(drawn_near(frame, draw_overlay(frame, rig, {far}), far.refused.edges_raw_px[0], 12), 10);
}

}  // namespace lapservo::internal::overlay_test
