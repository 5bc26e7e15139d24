#include "lapservo/kinematics/singularity.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/kinematics/feature_inverse.h"
#include "lapservo/kinematics/test_models.h"

namespace lapservo {
namespace {

const RcmCoordinates usual{0.07, 1.57, 0.064, -2};

TEST(Singularity, NoneInThePapersWorkingRegion) {
  constexpr std::uint64_t seed = 51;
  Random random(seed);
  const auto models = testing::image_models();
  for (int trial = 0; trial < 500; ++trial) {
    const RcmCoordinates q{random.uniform(-0.04, 0.18), random.uniform(1.51, 1.63), random.uniform(0.058, 0.07),
                           random.uniform(-pi, pi)};
    const SingularityReport report = singularity(models.front(), q);
    EXPECT_EQ(report.kind, Singularity::none) << "seed " << seed;
    EXPECT_GT(report.smallest_singular_value, 0.35) << "seed " << seed;
  }
}

// An RCM frame whose z axis points into the work space: there phi = 0, and theta and psi turn about the same axis.
TEST(Singularity, NamesThePoleOfTheRcmFrame) {
  ImageModel model = testing::image_models().front();
  model.camera_from_rcm.rotation = model.camera_from_rcm.rotation * rcm_from_unrolled(usual).rotation;
  const SingularityReport report = singularity(model, {0.3, 1e-4, 0.064, -2});
  EXPECT_EQ(report.kind, Singularity::rcm_frame_pole);
  EXPECT_LT(report.smallest_singular_value, 1e-4);
  EXPECT_NEAR(report.least_seen[0], -report.least_seen[3], 1e-2 * std::abs(report.least_seen[0]));
  EXPECT_EQ(singularity(model, {0.3, 0.5, 0.064, -2}).kind, Singularity::none);
}

TEST(Singularity, NamesAMarkerWhoseDDoesNotTellRotation) {
  ImageModel model = testing::image_models().front();
  model.marker.bands_upper_m = {0.005, 0.014, 0.016};
  model.marker.bands_lower_m = {0.014, 0.005, 0.016};
  const SingularityReport report = singularity(model, usual);
  EXPECT_EQ(report.kind, Singularity::rotation_not_in_d);
  EXPECT_LT(report.smallest_singular_value, 1e-9);
  EXPECT_LT(report.least_seen.head<3>().norm(), 1e-6 * std::abs(report.least_seen[3]));
}

// A shaft parallel to the optical axis whose surface nearly touches the camera centre: the marker shrinks to a point.
TEST(Singularity, NamesAShaftAlongTheLineOfSight) {
  ImageModel model = testing::image_models().front();
  const double off_axis_m = 1.05 * model.marker.radius_m();
  model.camera_from_rcm.translation = {off_axis_m, 0, 0.02};
  const SingularityReport close =
      singularity(model, *configuration_through(model.camera_from_rcm, {off_axis_m, 0, 0.3}));
  EXPECT_EQ(close.kind, Singularity::foreshortened) << singularity_word(close.kind);
  EXPECT_LT(close.smallest_singular_value, singular_below);
}

TEST(Singularity, NamesTheKinkAtTheProjectedRcm) {
  const ImageModel model = testing::image_models()[1];
  // Along a tilted shaft e0 passes the projected RCM where the generatrix crosses the RCM's line of sight.
  auto q = *configuration_through(model.camera_from_rcm, {-0.01, 0.02, 0.09});
  double low = 1e-4, high = 0.02;
  const auto outward = [&](double rho_m) {
    q.rho_m = rho_m;
    const FeaturePoint point = *feature_map(model, q).point;
    const Eigen::Vector2d o = *projected_rcm_px(model.camera, model.camera_from_rcm);
    return (point.ideal_px[0] - o).dot(point.ideal_px[3] - point.ideal_px[0]);
  };
  ASSERT_LT(outward(low) * outward(high), 0);
  for (int i = 0; i < 40; ++i) (outward((low + high) / 2) < 0 ? low : high) = (low + high) / 2;
  q.rho_m = high + 1e-6;
  const SingularityReport report = singularity(model, q);
  EXPECT_EQ(report.kind, Singularity::at_projected_rcm) << singularity_word(report.kind);
}

// Only where the RCM is in view do several configurations look the same; where they merge, the Jacobian loses rank.
TEST(Singularity, NamesTheTiltThatLooksLikeInsertion) {
  constexpr std::uint64_t seed = 52;
  Random random(seed);
  const ImageModel model = testing::image_models()[1];
  int singular = 0, with_a_twin_nearby = 0;
  for (int trial = 0; trial < 5000; ++trial) {
    const RcmCoordinates q = testing::visible_configuration(model, random);
    if (singularity(model, q).kind != Singularity::tilt_like_insertion) continue;
    ++singular;
    for (const RcmCoordinates& other : inverse_feature_map(model, feature_map(model, q).point->f)) {
      const double apart = (equivalent_nearest(other, q).vector() - q.vector()).norm();
      with_a_twin_nearby += apart > 1e-5 && apart < 0.5;
    }
  }
  EXPECT_GT(singular, 10) << "seed " << seed;
  EXPECT_GT(with_a_twin_nearby, singular / 2) << "seed " << seed;
}

TEST(Singularity, SaysWhyItIsUndefined) {
  const ImageModel model = testing::image_models().front();
  const auto past_camera = configuration_through(model.camera_from_rcm, {0.02, 0, -0.02});
  const SingularityReport report = singularity(model, *past_camera);
  EXPECT_EQ(report.kind, Singularity::undefined);
  EXPECT_EQ(report.undefined, Undefined::behind_camera);
  EXPECT_EQ(report.smallest_singular_value, 0);
}

}  // namespace
}  // namespace lapservo
