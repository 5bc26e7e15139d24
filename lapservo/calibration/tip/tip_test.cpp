#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "lapservo/calibration/tip/tip_fit.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/dense_matrix.h"
#include "lapservo/core/random.h"
#include "lapservo/core/statistics.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/robot/backlash.h"
#include "lapservo/testing/has.h"
#include "lapservo/tool/test_tools.h"

namespace lapservo::internal::tip_test {
using testing::has;

constexpr std::uint64_t first_seed = 1, last_seed = 20;

// Poses of a marker as a camera has them: errors that stay alike over a quarter of a second, and a part that all share.
class Eye {
 public:
  explicit Eye(std::uint64_t seed) : random_(seed) {
    for (double& common : common_) common = 0.5 * random_.normal();
    for (double& slow : slow_) slow = random_.normal();
  }

  // `alike`: how much of an error is that of the pose before.
  TimedPose seen(double time_s, const Rigid3& camera_from_marker, double alike) {
    std::array<double, 6> error;
    for (std::size_t k = 0; k < 6; ++k) {
      slow_[k] = alike * slow_[k] + std::sqrt(1 - alike * alike) * random_.normal();
      error[k] = common_[k] + std::sqrt(0.75) * slow_[k];
    }
    TimedPose pose{time_s, {camera_from_marker, 15e-6, 80e-6, 1e-3, 1.5e-3}};
    const Eigen::Vector3d ray = pose.origin().normalized(), axis = pose.axis();
    const Eigen::Vector3d side = ray.unitOrthogonal(), hinge = axis.cross(ray).normalized();
    Rigid3& is = pose.marker.camera_from_marker;
    is.translation += 15e-6 * (error[0] * side + error[1] * ray.cross(side)) + 80e-6 * error[2] * ray;
    const double tilt_rad = 1e-3 / std::sqrt(2.0);
    is.rotation = rotation_by(tilt_rad * (error[3] * hinge + error[4] * hinge.cross(axis)) + 1.5e-3 * error[5] * axis) *
                  is.rotation;
    return pose;
  }
  Random& random() { return random_; }

 private:
  Random random_;
  std::array<double, 6> common_{}, slow_{};
};

struct Orientation {
  double right_rad, down_rad, roll_rad;
};

// Down into the scene, from the upper left.
Rigid3 camera_from_marker_at(const Orientation& at, const Eigen::Vector3d& tip_in_marker_m,
                             const Eigen::Vector3d& point_in_camera_m) {
  const Eigen::Quaterniond usual = rotation_between(Eigen::Vector3d::UnitZ(), Eigen::Vector3d(0.7, 0.5, 0.5));
  const Eigen::Quaterniond turn = rotation_by(Eigen::Vector3d(at.down_rad, at.right_rad, 0)) * usual *
                                  rotation_by(Eigen::Vector3d(0, 0, at.roll_rad));
  return {turn, point_in_camera_m - turn * tip_in_marker_m};
}

struct Pivoting {
  double seconds = 20;
  std::function<Orientation(double)> orientation{};  // else tilted to all sides and rolled
  std::function<Eigen::Vector3d(double)> slip_m = [](double) { return Eigen::Vector3d::Zero().eval(); };
  double play_rad = 0;  // of each of the wrist's joints, 15 mm from the tip
};

struct Pivoted {
  Eigen::Vector3d tip_in_marker_m;
  std::vector<TimedPose> poses;
};

Pivoted pivoted(std::uint64_t seed, const Pivoting& pivoting) {
  constexpr double fps = 6, alike = 0.5, beyond_wrist_m = 0.015;
  Eye eye(seed);
  Random& random = eye.random();
  const auto phase = [&] { return random.uniform(0, two_pi); };
  const std::array<double, 3> phases{phase(), phase(), phase()};
  const auto usual = [=](double t) {
    return Orientation{0.35 * std::sin(0.9 * t + phases[0]), 0.35 * std::sin(1.3 * t + phases[1]),
                       1.5 * std::sin(0.5 * t + phases[2])};
  };
  const auto at = pivoting.orientation ? pivoting.orientation : usual;
  const Eigen::Vector3d dimple_m(random.uniform(0, 0.02), random.uniform(0, 0.02), random.uniform(0.1, 0.13));
  Pivoted result{{random.uniform(-3e-4, 3e-4), random.uniform(-3e-4, 3e-4), random.uniform(0.045, 0.09)}, {}};
  const double joint_azimuth_rad = phase();
  std::array<Backlash, 2> joints;
  for (double t = 0; t < pivoting.seconds; t += 1 / fps) {
    Rigid3 exact = camera_from_marker_at(at(t), result.tip_in_marker_m, dimple_m + pivoting.slip_m(t));
    // The tool stays where the dimple holds it until the joints' play is used up.
    const Eigen::Vector3d held = exact.rotation.conjugate() * Eigen::Vector3d(0.7, 0.5, 0.5).normalized();
    Eigen::Vector3d tip_m = result.tip_in_marker_m;
    for (std::size_t k = 0; k < 2; ++k) {
      const double azimuth_rad = joint_azimuth_rad + static_cast<double>(k) * pi / 2;
      const Eigen::Vector3d side(std::cos(azimuth_rad), std::sin(azimuth_rad), 0);
      const double angle_rad = side.dot(held);
      if (t == 0) joints[k] = Backlash(angle_rad);
      joints[k].follow(angle_rad, 2 * pivoting.play_rad);
      tip_m += beyond_wrist_m * (angle_rad - joints[k].instrument(2 * pivoting.play_rad)) * side;
    }
    exact = camera_from_marker_at(at(t), tip_m, dimple_m + pivoting.slip_m(t));
    result.poses.push_back(eye.seen(t, exact, alike));
  }
  return result;
}

TipCalibration pivoted_tip_of(const Pivoted& recording) {
  return pivoted_tip(Tool{}, {}, recording.poses);
}

struct Errors {
  std::vector<double> mm, sigmas;

  void add(const Eigen::Vector3d& error_m, const Eigen::Matrix3d& covariance_m2) {
    const Eigen::Vector3d whitened = whitening_of(covariance_m2) * error_m;
    for (Eigen::Index i = 0; i < 3; ++i) mm.push_back(1e3 * error_m[i]), sigmas.push_back(whitened[i]);
  }
  void expect(double most_mm) const {
    EXPECT_LT(rms(mm), most_mm);
    EXPECT_GT(rms(sigmas), 0.7);
    EXPECT_LT(rms(sigmas), 1.4);
  }
};

// As far as it may lie from the middle of a wide dimple while the shaft turns.
std::function<Eigen::Vector3d(double)> wander(std::uint64_t seed, double play_m) {
  Random random(1000 + seed);
  Eigen::Vector3d pace, phase;
  for (Eigen::Index i = 0; i < 3; ++i) pace[i] = random.uniform(0.2, 0.9), phase[i] = random.uniform(0, two_pi);
  return [=](double t) -> Eigen::Vector3d {
    return play_m * Eigen::Array3d(0.4, 0.4, 0.15) * (pace * t + phase).array().sin();
  };
}

TEST(PivotedTip, IsFoundAsWellAsItsSigmaSaysThoughItWanders) {
  for (const double play_m : {0.0, 0.4e-3}) {
    Errors errors;
    for (std::uint64_t seed = first_seed; seed <= last_seed; ++seed) {
      const Pivoted recording = pivoted(seed, {.slip_m = wander(seed, play_m)});
      const TipCalibration found = pivoted_tip_of(recording);
      if (play_m == 0) EXPECT_EQ(found.refusal + found.fault, "") << seed;
      if (found.refusal.empty())
        errors.add(found.tool.place->base_in_marker_m - recording.tip_in_marker_m,
                   found.tool.place->covariance.topLeftCorner<3, 3>());
    }
    EXPECT_GT(errors.mm.size(), 30) << play_m;
    errors.expect(play_m == 0 ? 0.1 : 0.2);
  }
}

void expect_refused(const Pivoting& pivoting, const std::string& cause) {
  for (const std::uint64_t seed : {1, 2})
    EXPECT_TRUE(has(pivoted_tip_of(pivoted(seed, pivoting)).refusal, cause)) << seed;
}

TEST(PivotedTip, IsRefusedWhereItDoesNotStayInItsPlace) {
  expect_refused({.slip_m = [](double t) { return Eigen::Vector3d(t > 7 ? 6e-4 : 0, t > 7 ? 6e-4 : 0, 0); }},
                 "the tip slipped at about");
  expect_refused({.slip_m = [](double t) { return Eigen::Vector3d(0, 5e-5 * t, 0); }}, "the dimple moves");
  expect_refused({.play_rad = rad_from_deg(2)}, "a loose wrist");
}

TEST(PivotedTip, IsRefusedWhereItDoesNotTurnEnough) {
  const auto two_only = [](double t) { return t < 10 ? Orientation{-0.3, 0, 0} : Orientation{0.3, 0.2, 0}; };
  const auto little = [](double t) { return Orientation{0.04 * std::sin(t), 0.04 * std::cos(t), 0}; };
  expect_refused({.orientation = two_only}, "about one axis only");
  expect_refused({.orientation = [](double t) { return Orientation{0, 0, 2 * std::sin(t)}; }}, "about one axis only");
  expect_refused({.orientation = [](double t) { return Orientation{0.4 * std::sin(t), 0, 0}; }}, "about one axis only");
  expect_refused({.orientation = little}, "only");
  expect_refused({.seconds = 1}, "frames");
}

TEST(PivotedTip, IsPlacedAtTheReadingsOfItsWristAndRefusedWhereTheyMove) {
  const std::vector<double> bent_rad{0.15, -0.1};
  std::vector<TipSighting> sightings;
  const Pivoted recording = pivoted(1, {});
  for (const TimedPose& pose : recording.poses) sightings.push_back({pose, bent_rad});
  const TipCalibration found = pivoted_tip(needle_driver(), sightings);
  ASSERT_EQ(found.refusal, "");
  EXPECT_LT((tip_in_marker(found.tool, bent_rad).marker_from_tip.translation - recording.tip_in_marker_m).norm(), 3e-4);
  sightings[7].wrist_rad[1] += 0.02;  // the sigma of a reading is 0.0175
  EXPECT_TRUE(has(pivoted_tip(needle_driver(), sightings).refusal, "wrist_yaw is at -0.080 rad at 1.2 s"));
  EXPECT_TRUE(has(pivoted_tip(needle_driver(), std::vector<TipSighting>()).refusal, "no frame"));
}

struct Touched {
  Tool truth;
  std::vector<TipSighting> touches;
  std::vector<std::string> names;
};

// Corners 5 mm apart of a board below the shaft.
Touched touched(std::uint64_t seed, Tool tool, int count, double bend_rad) {
  Eye eye(seed);
  Random& random = eye.random();
  Tool::Place& place = tool.place.emplace();
  place.base_in_marker_m = {random.uniform(-1e-4, 1e-4), random.uniform(-1e-4, 1e-4), random.uniform(0.04, 0.07)};
  if (!tool.wrist.empty()) place.azimuth_rad = random.uniform(-pi, pi);
  for (WristJoint& joint : tool.wrist) joint.offset_rad = rad_from_deg(random.normal());
  Touched result{tool, {}, {}};
  for (int i = 0; i < count; ++i) {
    std::vector<double> wrist_rad;
    for (std::size_t k = 0; k < tool.wrist.size(); ++k) wrist_rad.push_back(bend_rad * random.uniform(-1, 1));
    const Eigen::Vector3d point_m(0.005 * (i % 4), 0.005 * (i / 4), 0.12);
    const Eigen::Vector3d by_hand(0.07e-3 * random.normal(), 0.07e-3 * random.normal(), 0.05e-3 * random.normal());
    const Orientation at{random.uniform(-0.4, 0.4), random.uniform(-0.4, 0.4), random.uniform(-1.5, 1.5)};
    const Eigen::Vector3d tip_m = tip_in_marker(tool, wrist_rad).marker_from_tip.translation;
    result.touches.push_back({eye.seen(i, camera_from_marker_at(at, tip_m, point_m + by_hand), 0), wrist_rad, point_m});
    result.names.push_back(fmt::format("touch {}", i));
  }
  return result;
}

TipCalibration touched_tip_of(const Touched& touched) {
  Tool unplaced = touched.truth;
  unplaced.place.reset();
  for (WristJoint& joint : unplaced.wrist) joint.offset_rad = 0;
  return touched_tip(unplaced, touched.touches, touched.names);
}

TEST(TouchedTip, IsFoundAsWellAsItsSigmaSays) {
  Errors straight;
  for (std::uint64_t seed = first_seed; seed <= last_seed; ++seed) {
    const Touched recording = touched(seed, Tool{}, 6, 0);
    const TipCalibration found = touched_tip_of(recording);
    ASSERT_EQ(found.refusal, "") << seed;
    straight.add(found.tool.place->base_in_marker_m - recording.truth.place->base_in_marker_m,
                 found.tool.place->covariance.topLeftCorner<3, 3>());
  }
  straight.expect(0.15);
}

// At the mean of its readings: by those of the first touch the base is off by several sigmas.
TEST(TouchedTip, CountsHowFarReadingsOfAWristThatIsBentAlikeMoveTheTip) {
  Errors tips;
  for (std::uint64_t seed = first_seed; seed <= last_seed; ++seed) {
    const Touched recording = touched(seed, needle_driver(), 10, 0.04);
    const TipCalibration found = touched_tip(recording.truth, recording.touches, recording.names);
    ASSERT_EQ(found.refusal, "") << seed;
    ASSERT_FALSE(found.with_offsets);
    tips.add(found.tool.place->base_in_marker_m - recording.truth.place->base_in_marker_m,
             found.tool.place->covariance.topLeftCorner<3, 3>());
  }
  EXPECT_LT(rms(tips.sigmas), 1.4);
}

TEST(TouchedTip, ShowsTheWristsOffsetsWhereItIsBent) {
  Errors tips;
  std::vector<double> offsets_deg, offset_sigmas;
  for (std::uint64_t seed = first_seed; seed <= last_seed; ++seed) {
    const Touched recording = touched(seed, needle_driver(), 10, 0.8);
    const TipCalibration found = touched_tip_of(recording);
    ASSERT_EQ(found.refusal, "") << seed;
    ASSERT_TRUE(found.with_offsets);
    for (const auto& wrist_rad : {std::vector{0.0, 0.0}, std::vector{0.5, -0.5}}) {
      const TipInMarker is = tip_in_marker(found.tool, wrist_rad), should = tip_in_marker(recording.truth, wrist_rad);
      tips.add(is.marker_from_tip.translation - should.marker_from_tip.translation, is.of_place.topLeftCorner<3, 3>());
    }
    for (Eigen::Index k = 0; k < 2; ++k) {
      const auto joint = static_cast<std::size_t>(k);
      const double off_rad = found.tool.wrist[joint].offset_rad - recording.truth.wrist[joint].offset_rad;
      offsets_deg.push_back(deg_from_rad(off_rad));
      offset_sigmas.push_back(off_rad / std::sqrt(found.tool.place->covariance(4 + k, 4 + k)));
    }
  }
  tips.expect(0.15);
  EXPECT_LT(rms(offsets_deg), 0.5);
  EXPECT_GT(rms(offset_sigmas), 0.7);
  EXPECT_LT(rms(offset_sigmas), 1.4);
}

TEST(TouchedTip, IsRefusedWhereATouchIsOfAnotherCornerOrTheBoardMoves) {
  for (std::uint64_t seed = first_seed; seed <= last_seed; ++seed) {
    Touched elsewhere = touched(seed, Tool{}, 6, 0), moved = touched(seed, Tool{}, 10, 0);
    elsewhere.touches[3].point_in_camera_m->x() += 5e-3;
    EXPECT_TRUE(has(touched_tip_of(elsewhere).refusal, "touch 3: the tip is")) << seed;
    for (std::size_t i = 0; i < 10; ++i) moved.touches[i].point_in_camera_m->y() += 2e-4 * static_cast<double>(i);
    EXPECT_TRUE(has(touched_tip_of(moved).refusal, "the board moves")) << seed;
  }
}

// A tool file that ends on the axis of the last joint, and a jaw that touches.
TEST(TouchedTip, IsRefusedWhereAnotherPointOfTheLastJointTouched) {
  for (const std::uint64_t seed : {1, 2}) {
    Touched recording = touched(seed, needle_driver(), 10, 0.8);
    recording.truth.last_from_tip.translation.setZero();
    const std::string refusal = touched_tip_of(recording).refusal;
    EXPECT_TRUE(has(refusal, "than the tip, by 10 mm") && has(refusal, "tip_in_last_joint_m: [")) << seed << refusal;
  }
}

TEST(TouchedTip, IsRefusedWithALooseWrist) {
  for (const std::uint64_t seed : {1, 2}) {
    Touched recording = touched(seed, needle_driver(), 10, 0.8);
    Random random(seed);
    for (TipSighting& touch : recording.touches)
      for (double& reading_rad : touch.wrist_rad) reading_rad += rad_from_deg(4) * random.normal();
    EXPECT_NE(touched_tip_of(recording).refusal, "") << seed;
  }
}

// The base and its covariance are such that the tip, at the readings of the measurement, is as it was measured.
TEST(ToolPlace, KeepsTheMeasuredTip) {
  const Eigen::Vector3d tip_m(1e-4, -2e-4, 0.07);
  const Eigen::Matrix3d covariance_m2 = Eigen::Vector3d(1e-8, 2e-8, 4e-8).asDiagonal();
  for (const Tool& tool : {Tool{}, needle_driver()}) {
    const std::vector<double> wrist_rad(tool.wrist.size(), 0.1), bent_rad(tool.wrist.size(), 0.8);
    const Tool placed = placed_by_tip(tool, wrist_rad, tip_m, covariance_m2);
    const TipInMarker tip = tip_in_marker(placed, wrist_rad);
    EXPECT_LT((tip.marker_from_tip.translation - tip_m).norm(), 1e-12);
    EXPECT_LT((Eigen::Matrix3d(tip.of_place.topLeftCorner<3, 3>()) - covariance_m2).norm(), 1e-12);
    if (!tool.wrist.empty()) {
      EXPECT_GT((tip_in_marker(placed, bent_rad).of_place.topLeftCorner<3, 3>().trace()), 4 * covariance_m2.trace());
    }
  }
}

TEST(ToolPlace, ByCalliperIsAsKnownAsItsParts) {
  Marker marker;
  marker.bands_upper_m = {0.005, 0.006, 0.014};
  marker.sigmas.bands_upper_m = {3e-5, 0, 4e-5};
  const Tool tool = placed_by_calliper({}, marker, 0.02, 1e-4);
  EXPECT_NEAR(tool.place->base_in_marker_m.z(), 0.045, 1e-12);
  EXPECT_NEAR(std::sqrt(tool.place->covariance(2, 2)), std::hypot(1e-4, 5e-5), 1e-12);
  EXPECT_GT(placed_by_calliper(needle_driver(), marker, 0.02, 1e-4).place->covariance(3, 3), 1);
  marker.tolerance_m = 5e-4;  // of each end: larger
  EXPECT_NEAR(std::sqrt(placed_by_calliper({}, marker, 0.02, 1e-4).place->covariance(2, 2)),
              std::hypot(1e-4, 5e-4, 5e-4), 1e-12);
}

}  // namespace lapservo::internal::tip_test
