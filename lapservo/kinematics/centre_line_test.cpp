#include "lapservo/kinematics/centre_line.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/csv.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/rig.h"
#include "lapservo/testing/sample_frames.h"
#include "lapservo/testing/seeded_random.h"

namespace lapservo::internal {
namespace {
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
    ASSERT_TRUE(line);
    law(rig.camera, instrument, q, *line);
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
  EXPECT_EQ(f.s_rad, 0);
  EXPECT_EQ(f.r_px, 30);
  EXPECT_EQ(f.l_px, 60);
  EXPECT_EQ(f.d_px, 30);
  EXPECT_DOUBLE_EQ(f.cross_ratio, 30.0 * 50 / (20 * 60));
  const std::array<Eigen::Vector2d, 4> right{{{0, 0}, {10, 0}, {20, 0}, {40, 0}}};
  const std::array<Eigen::Vector2d, 4> up_left{{{0, 0}, {-10, -10}, {-20, -20}, {-40, -40}}};
  EXPECT_DOUBLE_EQ(features_of(right, std::nullopt).s_rad, pi / 2);
  EXPECT_DOUBLE_EQ(features_of(up_left, std::nullopt).s_rad, -0.75 * pi);
  EXPECT_FALSE(features_of(right, std::nullopt).r_px);
}

TEST(Features, CovarianceIsThatOfFiniteDifferences) {
  testing::SeededRandom random(seed);
  const std::array<Eigen::Vector2d, 4> edges_px{{{310, 250}, {352, 221}, {399, 187}, {520, 102}}};
  const Eigen::Vector2d rcm_px(-120, 560);
  EdgesCovariance root;
  for (double& entry : root.reshaped()) entry = 0.02 * random.normal();
  const EdgesCovariance of_edges = root * root.transpose();
  Eigen::Matrix<double, 4, 8> slopes;
  for (Eigen::Index i = 0; i < 8; ++i) {
    const auto moved = [&](double by_px) {
      auto points = edges_px;
      points[static_cast<std::size_t>(i / 2)][i % 2] += by_px;
      const Features f = features_of(points, rcm_px);
      return Eigen::Vector4d(f.s_rad, *f.r_px, f.l_px, f.d_px);
    };
    slopes.col(i) = (moved(1e-3) - moved(-1e-3)) / 2e-3;
  }
  const Eigen::Matrix4d expected = slopes * of_edges * slopes.transpose();
  const Eigen::Matrix4d covariance = features_covariance(edges_px, of_edges, rcm_px);
  EXPECT_EQ(covariance, covariance.transpose());
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j)
      EXPECT_NEAR(covariance(i, j), expected(i, j), 1e-5 * std::sqrt(covariance(i, i) * covariance(j, j))) << i << j;
  const Eigen::Matrix4d without = features_covariance(edges_px, of_edges, std::nullopt);
  EXPECT_TRUE(without.row(1).isZero(0) && without.col(1).isZero(0));
  const Eigen::Matrix2d lengths = covariance.bottomRightCorner<2, 2>(), same = without.bottomRightCorner<2, 2>();
  EXPECT_EQ(same, lengths);
}

TEST(Features, TheProjectedRcmLiesOnTheCentreLineUnlessInTheFocalPlane) {
  for_random_configurations(
      [](const Camera& camera, const Instrument& instrument, const JointVector&, const CentreLine& line) {
        const auto rcm_px = projected_rcm_px(camera, *instrument.camera_from_rcm);
        ASSERT_TRUE(rcm_px);
        const Eigen::Vector2d along = (line.ideal_px[3] - line.ideal_px[0]).normalized();
        const Eigen::Vector2d offset = *rcm_px - line.ideal_px[0];
        EXPECT_NEAR(along.x() * offset.y() - along.y() * offset.x(), 0, 1e-6);
      });
  EXPECT_FALSE(projected_rcm_px(example_rig().camera, {Eigen::Quaterniond::Identity(), {0.1, 0, 0}}));
}

// Truth of the ray-traced samples, which another program wrote from the conventions alone.
class SampleTruth : public ::testing::TestWithParam<const char*> {};

const Instrument& instrument_of(const Rig& rig, const CsvTable& truth, std::size_t row) {
  for (const Instrument& instrument : rig.instruments)
    if (instrument.name == truth.text(row, "instrument")) return instrument;
  throw std::runtime_error("the rig has no instrument " + truth.text(row, "instrument"));
}

Rig rig_of(const fs::path& folder, const fs::path& file) {
  const fs::path own = folder / fs::path(file).replace_extension(".rig.yaml");
  return load_rig(fs::exists(own) ? own : folder / "rig.yaml");
}

void expect_truth(const CsvTable& truth, std::size_t row, const Rig& rig) {
  const Instrument& instrument = instrument_of(rig, truth, row);
  const auto value = [&](const std::string& column) { return truth.number(row, column); };
  const JointVector q{value("theta_rad"), value("phi_rad"), value("rho_m"), value("psi_rad")};
  const auto line = centre_line(rig.camera, instrument.marker, camera_from_unrolled(instrument, q), q.psi_rad);
  ASSERT_TRUE(line);
  for (std::size_t k = 0; k < 4; ++k) {
    const std::string edge = "e" + std::to_string(k);
    const Eigen::Vector2d expected_px(value(edge + "_u_px"), value(edge + "_v_px"));
    EXPECT_LT((rig.camera.raw_from_ideal(line->ideal_px.at(k)) - expected_px).norm(), 0.02) << edge;
  }
  const auto rcm_px = projected_rcm_px(rig.camera, *instrument.camera_from_rcm);
  ASSERT_TRUE(rcm_px);
  EXPECT_LT((*rcm_px - Eigen::Vector2d(value("rcm_u_px"), value("rcm_v_px"))).norm(), 0.02);
  const Features f = features_of(line->ideal_px, rcm_px);
  EXPECT_NEAR(wrap_pi(line->tau_rad - value("tau_rad")), 0, 1e-5);
  EXPECT_NEAR(wrap_pi(f.s_rad - value("s_rad")), 0, 1e-4);
  EXPECT_NEAR(f.r_px.value(), value("r_px"), 0.02);
  EXPECT_NEAR(f.l_px, value("l_px"), 0.02);
  EXPECT_NEAR(f.d_px, value("d_px"), 0.02);
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

}  // namespace
}  // namespace lapservo::internal
