#include "lapservo/servo/image_features.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "lapservo/core/error.h"
#include "lapservo/geometry/field_of_view.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/kinematics/feature_map.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/servo/image_window.h"
#include "lapservo/testing/rigs.h"

namespace lapservo::internal::image_features_test {

const Eigen::Vector4d somewhere(0.05, 1.57, 0.064, 1.2);

Observation seen_at(const Rig& rig, const Eigen::Vector4d& q) {
  const Instrument& instrument = rig.instruments[0];
  const auto coordinates = JointVector::from_vector(q);
  const auto line = centre_line(rig.camera, instrument.marker,
                                *instrument.camera_from_rcm * rcm_from_unrolled(coordinates), coordinates.psi_rad)
                        .value();
  Observation observation;
  observation.status = Status::ok;
  observation.rcm = Observation::Rcm{coordinates, 1e-8 * Eigen::Matrix4d::Identity()};
  observation.edges_ideal_px = line.ideal_px;
  observation.edges_covariance_px2 = 1e-3 * EdgesCovariance::Identity();
  observation.features = features_of(line.ideal_px, projected_rcm_px(rig.camera, *instrument.camera_from_rcm));
  return observation;
}

TEST(ImageFeatures, TheModelShowsWhatIsObserved) {
  const Rig rig = testing::paper_test_rig();
  const FeatureModel model = feature_model(rig);
  const ImageMeasurement seen = measurement_of(seen_at(rig, somewhere), 1.5, rcm_image_px(rig, {}));
  const FeatureState state = model(somewhere).value();
  ASSERT_TRUE(seen.found);
  EXPECT_EQ(seen.time_s, 1.5);
  EXPECT_LT((seen.features - state.features).norm(), 1e-8);
  EXPECT_LT((seen.ends_px - state.ends_px).norm(), 1e-8);
  const auto point = feature_map({rig.camera, rig.instruments[0].marker, *rig.instruments[0].camera_from_rcm},
                                 JointVector::from_vector(somewhere));
  EXPECT_EQ(state.jacobian, point->jacobian);
  EXPECT_EQ(state.ends_jacobian, point->ends_jacobian);
}

// The log keeps one half of it, and the filter factors it. Points that all move with one unknown leave it singular but
// for what no fit knows.
TEST(ImageFeatures, CovariancesAreSymmetricAndPositive) {
  const Rig rig = testing::paper_test_rig();
  Observation observation = seen_at(rig, somewhere);
  const Eigen::Matrix<double, 8, 1> together = Eigen::Matrix<double, 8, 1>::LinSpaced(-1, 1);
  observation.edges_covariance_px2 = together * together.transpose();
  const Eigen::Matrix4d covariance = measurement_of(observation, 0, rcm_image_px(rig, {})).covariance;
  EXPECT_EQ(covariance, covariance.transpose());
  EXPECT_EQ(covariance.llt().info(), Eigen::Success);
  observation.edges_covariance_px2(3, 3) = NAN;
  EXPECT_FALSE(measurement_of(observation, 0, rcm_image_px(rig, {})).found);
}

// How sure the image is does not depend on who knows where the RCM's image lies.
TEST(ImageFeatures, WithoutTheRcmThereIsNoMeasurementUnlessItsImageIsGiven) {
  const Rig rig = testing::paper_test_rig();
  Rig unregistered = rig;
  unregistered.instruments[0].camera_from_rcm.reset();
  Observation observation = seen_at(rig, somewhere);
  const ImageMeasurement registered = measurement_of(observation, 0, rcm_image_px(rig, {}));
  observation.rcm.reset();
  observation.features.r_px.reset();
  EXPECT_FALSE(measurement_of(observation, 0, rcm_image_px(unregistered, {})).found);
  const auto estimated_px = projected_rcm_px(rig.camera, *rig.instruments[0].camera_from_rcm);
  const ImageMeasurement seen = measurement_of(observation, 0, rcm_image_px(unregistered, estimated_px));
  ASSERT_TRUE(seen.found);
  EXPECT_EQ(seen.features, registered.features);
  EXPECT_EQ(seen.covariance, registered.covariance);
  EXPECT_FALSE(seen.q);
}

TEST(ImageFeatures, WhatIsNotOkIsNotFound) {
  const Rig rig = testing::paper_test_rig();
  Observation observation = seen_at(rig, somewhere);
  for (const Status status : {Status::no_marker, Status::cut, Status::occluded, Status::ambiguous, Status::poor_fit,
                              Status::uncertain, Status::interlaced}) {
    observation.status = status;
    EXPECT_FALSE(measurement_of(observation, 0, rcm_image_px(rig, {})).found) << to_string(status);
  }
}

TEST(ImageFeatures, AMarginThatIsNoneIsRefused) {
  const Camera camera = testing::paper_test_rig().camera;
  for (const double margin_px : {-1.0, 360.0, double{NAN}, double{INFINITY}})
    EXPECT_THROW((void)image_window(camera, margin_px), InputError) << margin_px;
}

// Every ideal point of the window, also through a lens that distorts; corners that it folds are left out.
TEST(ImageFeatures, TheWindowLiesInThePicture) {
  Camera camera = testing::paper_test_rig().camera;
  camera.distortion[0] = 0.15;
  bool folds = false;
  for (double& k1 = camera.distortion[0]; is_invertible(camera); k1 -= 0.01) {
    folds |= !is_invertible_everywhere(camera);
    const ImageWindow window = image_window(camera, 20);
    EXPECT_GT(window.u_max_px - window.u_min_px, 0.3 * camera.width_px) << k1;
    for (const double u : {window.u_min_px, window.u_max_px})
      for (const double v : {window.v_min_px, window.v_max_px}) {
        const Eigen::Vector2d raw = camera.raw_from_ideal({u, v});
        EXPECT_TRUE(camera.contains(raw, 19.9)) << k1;
        EXPECT_LE((camera.ideal_from_raw(raw).value() - Eigen::Vector2d(u, v)).norm(), 1e-6) << k1;
      }
  }
  EXPECT_TRUE(folds);
}

}  // namespace lapservo::internal::image_features_test
