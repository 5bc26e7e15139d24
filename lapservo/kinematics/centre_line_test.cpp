#include "lapservo/kinematics/centre_line.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/csv.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/instruments.h"
#include "lapservo/rig/rig.h"
#include "lapservo/testing/sample_frames.h"
#include "lapservo/testing/seeded_random.h"

namespace lapservo::internal::centre_line_test {
namespace fs = std::filesystem;

constexpr std::uint64_t seed = 41;

Rig example_rig() {
  return load_rig(testing::source_folder() / "configs/example.yaml");
}

JointVector random_configuration(Random& random) {
  return {random.uniform(-0.3, 0.3), random.uniform(1.4, 1.7), random.uniform(0.08, 0.12), random.uniform(-4, 4)};
}

Rigid3 camera_from_unrolled(const Instrument& instrument, const JointVector& q) {
  return *instrument.camera_from_rcm * rcm_from_unrolled(q);
}

template <typename Law>
void for_random_configurations(const Law& law) {
  const Rig rig = example_rig();
  testing::SeededRandom random(seed);
  for (int i = 0; i < 300; ++i) {
    const JointVector q = random_configuration(random);
    SCOPED_TRACE("configuration " + std::to_string(i));
    const Instrument& instrument = rig.instruments.front();
    const auto line = centre_line(rig.camera, instrument.marker, camera_from_unrolled(instrument, q), q.psi_rad);
    law(rig.camera, instrument, q, line.value());
  }
}

TEST(JointVector, TheAxisPointsFromTheRcmToTheMarker) {
  testing::SeededRandom random(seed);
  for (int i = 0; i < 100; ++i) {
    const JointVector q = random_configuration(random);
    const Rigid3 pose = rcm_from_unrolled(q);
    EXPECT_LT((pose * Eigen::Vector3d::Zero() - q.rho_m * shaft_axis_in_rcm(q)).norm(), 1e-12);
    EXPECT_LT((pose.rotation * Eigen::Vector3d::UnitZ() - shaft_axis_in_rcm(q)).norm(), 1e-12);
    EXPECT_LT((pose * Eigen::Vector3d(0, 0, -q.rho_m)).norm(), 1e-12) << "the shaft passes through the RCM";
  }
}

TEST(JointVector, TheUnrolledFrameIsRzRy) {
  const JointVector q{0.3, 1.2, 0.1, 0};
  const double ct = std::cos(0.3), st = std::sin(0.3), cp = std::cos(1.2), sp = std::sin(1.2);
  const Eigen::Matrix3d expected{{ct * cp, -st, ct * sp}, {st * cp, ct, st * sp}, {-sp, 0, cp}};
  EXPECT_LT((rcm_from_unrolled(q).rotation.toRotationMatrix() - expected).norm(), 1e-12);
}

TEST(CentreLine, ItsPointsLieOnTheSurfaceWhereTheBandsEnd) {
  for_random_configurations(
      [](const Camera& camera, const Instrument& instrument, const JointVector& q, const CentreLine& line) {
        const Rigid3 unrolled_from_camera = camera_from_unrolled(instrument, q).inverse();
        const auto along_m = boundaries_m(instrument.marker, line.tau_rad);
        for (std::size_t k = 0; k < 4; ++k) {
          const Eigen::Vector3d point = unrolled_from_camera * line.points_in_camera_m.at(k);
          EXPECT_NEAR(point.head<2>().norm(), instrument.marker.radius_m(), 1e-9);
          EXPECT_NEAR(point.z(), along_m.at(k), 1e-9);
          EXPECT_LT((camera.ideal_from_point(line.points_in_camera_m.at(k)) - line.ideal_px.at(k)).norm(), 1e-9);
        }
      });
}

TEST(CentreLine, IsAbsentBehindTheCameraAndAroundIt) {
  const Rig rig = example_rig();
  const Marker& marker = rig.instruments.front().marker;
  EXPECT_FALSE(centre_line(rig.camera, marker, {Eigen::Quaterniond::Identity(), {0.05, 0, -0.1}}, 0));
  EXPECT_FALSE(centre_line(rig.camera, marker, {Eigen::Quaterniond::Identity(), {0.001, 0, 0.1}}, 0));
}

TEST(Features, MeasureAnglesFromTheVerticalAndDistances) {
  const std::array<Eigen::Vector2d, 4> down{{{10, 10}, {10, 20}, {10, 40}, {10, 70}}};
  const Features f = features_of(down, Eigen::Vector2d(10, -20));
  EXPECT_EQ(Eigen::Vector4d(f.s_rad, f.r_px.value(), f.l_px, f.d_px), Eigen::Vector4d(0, 30, 60, 30));
  EXPECT_DOUBLE_EQ(f.cross_ratio, 30.0 * 50 / (20 * 60));
  const std::array<Eigen::Vector2d, 4> right{{{0, 0}, {10, 0}, {20, 0}, {40, 0}}};
  const std::array<Eigen::Vector2d, 4> up_left{{{0, 0}, {-10, -10}, {-20, -20}, {-40, -40}}};
  EXPECT_DOUBLE_EQ(features_of(right, std::nullopt).s_rad, pi / 2);
  EXPECT_DOUBLE_EQ(features_of(up_left, std::nullopt).s_rad, -0.75 * pi);
  EXPECT_FALSE(features_of(right, std::nullopt).r_px);
}

// The numbers: the points, the RCM's place, the camera's matrix.
TEST(Features, CovarianceIsThatOfFiniteDifferences) {
  testing::SeededRandom random(seed);
  const std::array<Eigen::Vector2d, 4> edges_px{{{310, 250}, {352, 221}, {399, 187}, {520, 102}}};
  const Rigid3 camera_from_rcm{Eigen::Quaterniond::Identity(), {-0.04, 0.01, 0.05}};
  Eigen::Matrix<double, 15, 15> root = decltype(root)::Zero();
  for (double& entry : root.topLeftCorner<8, 8>().reshaped()) entry = 0.02 * random.normal();
  for (double& entry : root.block<3, 3>(8, 8).reshaped()) entry = 1e-4 * random.normal();
  for (double& entry : root.bottomRightCorner<4, 4>().reshaped()) entry = 0.5 * random.normal();
  const Eigen::Matrix<double, 15, 15> of_all = root * root.transpose();
  const EdgesCovariance of_edges = of_all.topLeftCorner<8, 8>();
  Camera camera = example_rig().camera;
  camera.covariance.emplace().setZero().topLeftCorner<4, 4>() = of_all.bottomRightCorner<4, 4>();
  const auto features = [&](const Eigen::VectorXd& change) {
    auto points = edges_px;
    for (Eigen::Index i = 0; i < 8; ++i) points[static_cast<std::size_t>(i / 2)][i % 2] += change[i];
    Camera moved = camera;
    moved.fx_px += change[11], moved.fy_px += change[12], moved.cx_px += change[13], moved.cy_px += change[14];
    const Rigid3 place{camera_from_rcm.rotation, camera_from_rcm.translation + change.segment<3>(8)};
    const Features f = features_of(points, projected_rcm_px(moved, place));
    return Eigen::Vector4d(f.s_rad, *f.r_px, f.l_px, f.d_px);
  };
  Eigen::Matrix<double, 4, 15> slopes;
  for (Eigen::Index i = 0; i < 15; ++i)
    slopes.col(i) =
        (features(1e-6 * Eigen::VectorXd::Unit(15, i)) - features(-1e-6 * Eigen::VectorXd::Unit(15, i))) / 2e-6;
  const Eigen::Matrix4d expected = slopes * of_all * slopes.transpose();
  const auto of_rcm = projected_rcm_covariance_px2(camera, camera_from_rcm, of_all.block<3, 3>(8, 8));
  const Eigen::Matrix4d covariance =
      features_covariance(edges_px, of_edges, projected_rcm_px(camera, camera_from_rcm), of_rcm);
  EXPECT_EQ(covariance, covariance.transpose());
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j)
      EXPECT_NEAR(covariance(i, j), expected(i, j), 1e-5 * std::sqrt(covariance(i, i) * covariance(j, j))) << i << j;
  const Eigen::Matrix4d without = features_covariance(edges_px, of_edges, std::nullopt);
  EXPECT_TRUE(without.row(1).isZero(0) && without.col(1).isZero(0));
  const Eigen::Matrix2d lengths = covariance.bottomRightCorner<2, 2>(), same = without.bottomRightCorner<2, 2>();
  EXPECT_EQ(same, lengths);
  camera.covariance.reset();
  camera.sigmas = {.fx_px = 3, .fy_px = 2, .cx_px = 1, .cy_px = 0.5};  // x / z is -0.8, y / z 0.2
  const Eigen::Matrix2d by_matrix = projected_rcm_covariance_px2(camera, camera_from_rcm, Eigen::Matrix3d::Zero());
  EXPECT_TRUE(by_matrix.isApprox(Eigen::Matrix2d{{6.76, -0.32}, {-0.32, 0.41}}, 1e-12)) << by_matrix;
}

TEST(Features, TheProjectedRcmLiesOnTheCentreLineUnlessInTheFocalPlane) {
  for_random_configurations(
      [](const Camera& camera, const Instrument& instrument, const JointVector&, const CentreLine& line) {
        const Eigen::Vector2d rcm_px = projected_rcm_px(camera, *instrument.camera_from_rcm).value();
        const Eigen::Vector2d along = (line.ideal_px[3] - line.ideal_px[0]).normalized();
        const Eigen::Vector2d offset = rcm_px - line.ideal_px[0];
        EXPECT_NEAR(along.x() * offset.y() - along.y() * offset.x(), 0, 1e-6);
      });
  EXPECT_FALSE(projected_rcm_px(example_rig().camera, {Eigen::Quaterniond::Identity(), {0.1, 0, 0}}));
}

// Truth of the ray-traced samples, which another program wrote from the conventions alone.
class SampleTruth : public ::testing::TestWithParam<const char*> {};

Rig rig_of(const fs::path& folder, const fs::path& file) {
  const fs::path own = folder / fs::path(file).replace_extension(".rig.yaml");
  return load_rig(fs::exists(own) ? own : folder / "rig.yaml");
}

void expect_truth(const CsvTable& truth, std::size_t row, const Rig& rig) {
  const Instrument& instrument = rig.instruments.at(instrument_index(rig, truth.text(row, "instrument")).value());
  const auto value = [&](const std::string& column) { return truth.number(row, column); };
  const JointVector q{value("theta_rad"), value("phi_rad"), value("rho_m"), value("psi_rad")};
  const CentreLine line =
      centre_line(rig.camera, instrument.marker, camera_from_unrolled(instrument, q), q.psi_rad).value();
  for (std::size_t k = 0; k < 4; ++k) {
    const std::string edge = "e" + std::to_string(k);
    const Eigen::Vector2d expected_px(value(edge + "_u_px"), value(edge + "_v_px"));
    EXPECT_LT((rig.camera.raw_from_ideal(line.ideal_px.at(k)) - expected_px).norm(), 0.02) << edge;
  }
  const Eigen::Vector2d rcm_px = projected_rcm_px(rig.camera, *instrument.camera_from_rcm).value();
  EXPECT_LT((rcm_px - Eigen::Vector2d(value("rcm_u_px"), value("rcm_v_px"))).norm(), 0.02);
  const Features f = features_of(line.ideal_px, rcm_px);
  EXPECT_NEAR(wrap_pi(line.tau_rad - value("tau_rad")), 0, 1e-5);
  EXPECT_NEAR(wrap_pi(f.s_rad - value("s_rad")), 0, 1e-4);
  const Eigen::Vector3d lengths_px(f.r_px.value(), f.l_px, f.d_px);
  EXPECT_LT((lengths_px - Eigen::Vector3d(value("r_px"), value("l_px"), value("d_px"))).cwiseAbs().maxCoeff(), 0.02);
}

TEST_P(SampleTruth, IsWhatTheKinematicsSay) {
  const auto folder = testing::sample_frames(GetParam());
  if (!folder) GTEST_SKIP() << "the sample frames are not there";
  const CsvTable truth = CsvTable::read(*folder / "truth.csv");
  ASSERT_GT(truth.rows(), 0U);
  for (std::size_t row = 0; row < truth.rows(); ++row) {
    SCOPED_TRACE((*folder / truth.text(row, "file")).string());
    expect_truth(truth, row, rig_of(*folder, truth.text(row, "file")));
  }
}

INSTANTIATE_TEST_SUITE_P(Frames, SampleTruth,
                         ::testing::Values("rotation", "illumination", "stress", "two", "tilt", "distorted", "video"),
                         [](const auto& parameter) { return std::string(parameter.param); });

}  // namespace lapservo::internal::centre_line_test
