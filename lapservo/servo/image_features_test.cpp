#include "lapservo/servo/image_features.h"

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "lapservo/kinematics/centre_line.h"
#include "lapservo/kinematics/rcm_coordinates.h"
#include "lapservo/servo/image_window.h"
#include "lapservo/testing/rigs.h"

namespace lapservo::internal {
namespace {

const Eigen::Vector4d somewhere(0.05, 1.57, 0.064, 1.2);

Observation seen_at(const Rig& rig, const Eigen::Vector4d& q) {
  const Instrument& instrument = rig.instruments[0];
  const auto coordinates = RcmCoordinates::from_vector(q);
  const auto line = centre_line(rig.camera, instrument.marker,
                                *instrument.camera_from_rcm * rcm_from_unrolled(coordinates), coordinates.psi_rad)
                        .value();
  Observation observation;
  observation.status = Status::ok;
  observation.rcm = Observation::Rcm{coordinates, 1e-8 * Eigen::Matrix4d::Identity()};
  observation.edges_ideal_px = line.ideal_px;
  observation.features = features_of(line.ideal_px, projected_rcm_px(rig.camera, *instrument.camera_from_rcm));
  return observation;
}

TEST(ImageFeatures, TheModelShowsWhatIsObserved) {
  const Rig rig = testing::paper_test_rig();
  const FeatureModel model = feature_model(rig);
  const ImageMeasurement seen = measurement_of(seen_at(rig, somewhere), model, 1.5, {});
  const FeatureState state = model(somewhere).value();
  ASSERT_TRUE(seen.found);
  EXPECT_EQ(seen.time_s, 1.5);
  EXPECT_LT((seen.features - state.features).norm(), 1e-8);
  EXPECT_LT((seen.ends_px - state.ends_px).norm(), 1e-8);
}

TEST(ImageFeatures, DerivativesAgreeWithDifferences) {
  const FeatureModel model = feature_model(testing::paper_test_rig());
  const FeatureState state = model(somewhere).value();
  for (int i = 0; i < 4; ++i) {
    constexpr double h = 1e-6;
    const auto plus = model(somewhere + h * Eigen::Vector4d::Unit(i)).value(),
               minus = model(somewhere - h * Eigen::Vector4d::Unit(i)).value();
    EXPECT_LT(((plus.features - minus.features) / (2 * h) - state.jacobian.col(i)).norm(), 1e-2) << i;
    EXPECT_LT(((plus.ends_px - minus.ends_px) / (2 * h) - state.ends_jacobian.col(i)).norm(), 1e-2) << i;
  }
}

// The log keeps one half of it, and the filter factors it.
TEST(ImageFeatures, CovariancesAreSymmetricAndPositive) {
  const Rig rig = testing::paper_test_rig();
  Observation observation = seen_at(rig, somewhere);
  observation.rcm->covariance = Eigen::Vector4d(1e-8, 3e-8, 1e-11, 4e-7).asDiagonal();
  const Eigen::Matrix4d covariance = measurement_of(observation, feature_model(rig), 0, {}).covariance;
  EXPECT_EQ(covariance, covariance.transpose());
  EXPECT_EQ(covariance.llt().info(), Eigen::Success);
}

TEST(ImageFeatures, WithoutTheRcmThereIsNoMeasurementUnlessItsImageIsGiven) {
  const Rig rig = testing::paper_test_rig();
  Observation observation = seen_at(rig, somewhere);
  const double r_px = observation.features.r_px.value();
  observation.rcm.reset();
  observation.features.r_px.reset();
  EXPECT_FALSE(measurement_of(observation, {}, 0, {}).found);
  const auto rcm_px = projected_rcm_px(rig.camera, *rig.instruments[0].camera_from_rcm);
  const ImageMeasurement seen = measurement_of(observation, {}, 0, rcm_px);
  ASSERT_TRUE(seen.found);
  EXPECT_NEAR(seen.features[1], r_px, 1e-9);
  EXPECT_TRUE(seen.covariance.allFinite());
}

TEST(ImageFeatures, WhatIsNotOkIsNotFound) {
  const Rig rig = testing::paper_test_rig();
  Observation observation = seen_at(rig, somewhere);
  for (const Status status : {Status::no_marker, Status::cut, Status::occluded, Status::ambiguous, Status::poor_fit,
                              Status::uncertain, Status::interlaced}) {
    observation.status = status;
    EXPECT_FALSE(measurement_of(observation, feature_model(rig), 0, {}).found) << status_word(status);
  }
}

// Every ideal point of the window lies in the picture, also through a distorting lens.
TEST(ImageFeatures, TheWindowLiesInThePicture) {
  Camera camera = testing::paper_test_rig().camera;
  for (const double k1 : {0.0, -0.25, 0.15}) {
    camera.distortion = {k1, 0, 0, 0, 0};
    const ImageWindow window = image_window(camera, 20);
    for (const double u : {window.u_min_px, window.u_max_px})
      for (const double v : {window.v_min_px, window.v_max_px}) {
        const Eigen::Vector2d raw = camera.raw_from_ideal({u, v});
        EXPECT_GE(raw.minCoeff(), 19.9) << k1;
        EXPECT_LE(raw.x(), camera.width_px - 1 - 19.9) << k1;
        EXPECT_LE(raw.y(), camera.height_px - 1 - 19.9) << k1;
      }
  }
}

}  // namespace
}  // namespace lapservo::internal
