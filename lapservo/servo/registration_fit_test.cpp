#include "lapservo/servo/registration_fit.h"

#include <gtest/gtest.h>

#include "lapservo/core/random.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/testing/rigs.h"

namespace lapservo::internal::registration_fit_test {

const Rig& rig() {
  static const Rig rig = testing::paper_test_rig();
  return rig;
}

// The marker of an instrument whose joints are read as q, of which it is `off`, `delay_s` later.
MarkerSighting sighting_at(double time_s, const Rigid3& camera_from_rcm, const Eigen::Vector4d& off, double delay_s) {
  const Eigen::Vector4d centre(0.05, 1.57, 0.064, 1.2), swing(0.12, 0.1, 0.012, 0.5), speed(1.1, 0.8, 1.4, 0.9);
  const Eigen::Vector4d phase = time_s * speed, sine = phase.array().sin(), cosine = phase.array().cos();
  MarkerSighting sighting;
  sighting.time_s = time_s;
  sighting.q = centre + swing.cwiseProduct(sine);
  sighting.q_rate = swing.cwiseProduct(speed).cwiseProduct(cosine);
  const Eigen::Vector4d shown = sighting.q - delay_s * sighting.q_rate + off;
  const Rigid3 unrolled = camera_from_rcm * rcm_from_unrolled(JointVector::from_vector(shown));
  sighting.camera_from_marker = camera_from_marker(rig().instruments[0].marker, unrolled, shown[3]);
  return sighting;
}

TEST(SeenJoints, AreTheOffsetAtWhichTheMarkerIsSeen) {
  const Instrument& instrument = rig().instruments[0];
  Random random(1);
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector4d off(0.03 * random.normal(), 0.03 * random.normal(), 2e-3 * random.normal(), 0.1);
    const MarkerSighting sighting = sighting_at(i, *instrument.camera_from_rcm, off, 0);
    const auto seen = seen_joints(rig().camera, instrument, sighting, Eigen::Vector4d::Zero());
    ASSERT_TRUE(seen);
    EXPECT_LT((seen->offset - off).norm(), 1e-4) << off.transpose();
    EXPECT_LT(seen->misfit_rad, 1e-4);
    EXPECT_GT(seen->covariance(0, 0), 0);
  }
}

TEST(SeenJoints, MisfitWhereTheShaftMissesTheRcm) {
  const Instrument& instrument = rig().instruments[0];
  double last_rad = 0;
  for (const double beside_m : {5e-4, 1e-3, 2e-3, 4e-3}) {
    Rigid3 elsewhere = *instrument.camera_from_rcm;
    elsewhere.translation += elsewhere.rotation * Eigen::Vector3d(beside_m, beside_m, 0);
    const MarkerSighting sighting = sighting_at(1, elsewhere, Eigen::Vector4d::Zero(), 0);
    const auto seen = seen_joints(rig().camera, instrument, sighting, Eigen::Vector4d::Zero());
    ASSERT_TRUE(seen);
    EXPECT_GT(seen->misfit_rad, 1.5 * last_rad) << beside_m;
    last_rad = seen->misfit_rad;
  }
  EXPECT_GT(last_rad, 5e-4);
}

// Three sigmas of a root of a sum of three squares: at most 3 % are beyond.
TEST(SeenJoints, MisfitByNoMoreThanTheRegistrationsSigmasExplain) {
  constexpr int trials = 200;
  constexpr double sigma_m = 1e-3;
  Instrument instrument = rig().instruments[0];
  instrument.registration_covariance.emplace().setZero();
  instrument.registration_covariance->diagonal().head<3>().setConstant(sigma_m * sigma_m);
  Random random(3);
  int beyond = 0, below_a_tenth = 0;
  for (int i = 0; i < trials; ++i) {
    Rigid3 truth = *instrument.camera_from_rcm;
    truth.translation += sigma_m * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
    const auto seen_at = [&](double time_s) {
      const MarkerSighting sighting = sighting_at(time_s, truth, Eigen::Vector4d::Zero(), 0);
      return seen_joints(rig().camera, instrument, sighting, Eigen::Vector4d::Zero()).value();
    };
    const SeenJoints agreed = seen_at(random.uniform(0, 100)), here = seen_at(random.uniform(0, 100));
    const double largest_rad = largest_misfit_rad(instrument, agreed, here);
    beyond += here.misfit_rad > largest_rad;
    below_a_tenth += here.misfit_rad < 0.1 * largest_rad;
    EXPECT_NEAR(largest_misfit_rad(instrument, agreed, agreed), agreed.misfit_rad, 1e-12);
  }
  EXPECT_LE(beyond, 0.03 * trials);
  EXPECT_LE(below_a_tenth, 0.2 * trials);
}

TEST(RegistrationFit, IsWhereTheSightingsWereTaken) {
  const Instrument& instrument = rig().instruments[0];
  Random random(2);
  for (int i = 0; i < 5; ++i) {
    const Eigen::Vector3d turn = 0.2 * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
    Rigid3 truth = *instrument.camera_from_rcm;
    truth.rotation = rotation_by(turn) * truth.rotation;
    const Eigen::Vector4d off(0, 2e-3, -2e-4, 0.01);
    std::vector<MarkerSighting> sightings;
    for (double t = 0; t < 6; t += 0.1) sightings.push_back(sighting_at(t, truth, off, 0.008));
    GapPath path;
    for (MarkerSighting& sighting : sightings) {
      sighting.path_index = path.joints.size();
      path.joints.emplace_back(sighting.q.tail<2>());
    }
    const auto fit = fit_registration(rig().camera, instrument.marker, sightings, path);
    ASSERT_TRUE(fit);
    EXPECT_LT((fit->camera_from_rcm.translation - truth.translation).norm(), 5e-4) << turn.transpose();
    EXPECT_LT(rotation_vector_of(fit->camera_from_rcm.rotation * truth.rotation.conjugate()).norm(), 5e-3);
    EXPECT_LT(fit->rms_px, 0.1);
  }
  EXPECT_FALSE(fit_registration(rig().camera, instrument.marker, {}, {}));
}

}  // namespace lapservo::internal::registration_fit_test
