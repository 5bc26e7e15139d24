#include "lapservo/vision/decision/verification.h"

#include <cmath>
#include <cstddef>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"
#include "lapservo/testing/shots.h"

namespace lapservo::internal::verification_test {

using scenes::fit_from;
using scenes::Shot;
using scenes::Sight;
using scenes::usual_shot;

FineFit fit_from_truth(const Shot& shot) {
  return fit_from(shot, shot.truth(true));
}

using Change = Eigen::Vector4d;  // of q

PoseUnknowns moved_by(const Rig& rig, const PoseUnknowns& unknowns, const Change& change) {
  const Eigen::Vector4d q = scenes::q_of(rig, unknowns).vector() + change;
  return {scenes::pose_of(rig, 0, JointVector::from_vector(q)), true};
}

TEST(Verification, ARightPoseIsOk) {
  scenes::for_each_shot(8, [&](const Shot& shot) {
    EXPECT_EQ(validate(shot.sight.scene(), fit_from_truth(shot)), Status::ok);
    const ColourAgreement agreement = colour_agreement(shot.sight.scene(), scenes::pose_of(shot.rig, 0, shot.q));
    EXPECT_GT(agreement.matching, 0.85);
    EXPECT_LT(agreement.wrong, 0.02);
    EXPECT_EQ(agreement.in_image, 1);
  });
}

// A fit that has an end amid its band, where nothing shows it, is of another pose.
TEST(Verification, ABandThatGoesOnBeyondItsEndIsNotOk) {
  scenes::for_each_shot(8, [&](const Shot& shot) {
    const ShaftPose pose = scenes::pose_of(shot.rig, 0, shot.q);
    EXPECT_LT(colour_agreement(shot.sight.scene(), pose).beyond, 0.2);
    for (const std::size_t band : {0U, 2U}) {
      Rig shorter = shot.rig;
      Marker& marker = shorter.instruments[0].marker;
      for (auto* bands_m : {&marker.bands_upper_m, &marker.bands_lower_m}) (*bands_m)[band] -= 0.08 * marker.length_m();
      ShaftPose begins_later = pose;
      if (band == 0)
        begins_later.camera_from_unrolled.translation =
            pose.camera_from_unrolled * Eigen::Vector3d(0, 0, 0.08 * shot.rig.instruments[0].marker.length_m());
      const Sight sight(shorter, shot.bgr);
      EXPECT_GT(colour_agreement(sight.scene(), begins_later).beyond, validation_limits.max_beyond) << band;
      FineFit fit = fit_from_truth(shot);
      fit.unknowns = PoseUnknowns(begins_later, true);
      EXPECT_EQ(validate(sight.scene(), fit), Status::poor_fit) << band;
    }
  });
}

// Started wrong, a fit may find back; what is called ok is right.
TEST(Verification, WhatAWrongStartLeadsToIsRightOrNotOk) {
  int refused = 0;
  scenes::for_each_shot(8, [&](const Shot& shot) {
    for (const Change& wrong :
         {Change(0, 0, 0, 0.5), Change(0, 0, 0, -0.5), Change(0, 0, 0, 1.5), Change(0, 0, 0, -1.5), Change(0, 0, 0, pi),
          Change(0, 0, 2e-3, 0), Change(0, 0, -2e-3, 0), Change(0, 0, 6e-3, 0), Change(0.03, 0, 0, 0),
          Change(0.15, 0, 0, 0), Change(0, 0.03, 0, 0), Change(0, -0.15, 0, 0)}) {
      const FineFit fit = fit_from(shot, moved_by(shot.rig, shot.truth(true), wrong));
      const bool is_ok = validate(shot.sight.scene(), fit) == Status::ok;
      refused += !is_ok;
      if (!is_ok) continue;
      EXPECT_LT(std::abs(shot.psi_error_rad(fit.unknowns)), 0.1) << wrong.transpose();
      EXPECT_LT(std::abs(scenes::q_of(shot.rig, fit.unknowns).rho_m - shot.q.rho_m), 0.2e-3) << wrong.transpose();
    }
  });
  EXPECT_GT(refused, 8 * 6);
}

// Even when all else about the fit looks well.
TEST(Verification, APoseThatTheColoursContradictIsNotOk) {
  scenes::for_each_shot(8, [&](const Shot& shot) {
    const Scene scene = shot.sight.scene();
    const FineFit right = fit_from_truth(shot);
    const double matching = colour_agreement(scene, right.unknowns.pose()).matching;
    for (const Change& wrong : {Change(0, 0, 0, 2.5), Change(0, 0, 8e-3, 0), Change(0, 0, -8e-3, 0),
                                Change(0.3, 0, 0, 0), Change(-0.3, 0, 0, 0)}) {
      FineFit fit = right;
      fit.unknowns = moved_by(shot.rig, right.unknowns, wrong);
      EXPECT_NE(validate(scene, fit), Status::ok) << wrong.transpose();
      EXPECT_LT(colour_agreement(scene, fit.unknowns.pose()).matching, matching - 0.1) << wrong.transpose();
    }
  });
}

// A fit of which each boundary was located on so much of its lines.
FineFit with_located(FineFit fit, double fraction) {
  fit.in_image.fill(fit.lines);
  fit.used.fill(static_cast<int>(fraction * fit.lines));
  return fit;
}

// A print that may make psi wrong is as improbable as the caller wants; one that is certainly off is a mismatch where
// the marker is well seen.
TEST(Verification, AFitWithoutSupportOrOfAnotherPrintIsNotOk) {
  const Shot& shot = usual_shot(1);
  Scene scene = shot.sight.scene();
  const FineFit right = fit_from_truth(shot);
  const auto status_with = [&](const auto& change) {
    FineFit fit = right;
    change(fit);
    return validate(scene, fit);
  };
  ASSERT_EQ(status_with([](FineFit&) {}), Status::ok);
  EXPECT_EQ(status_with([](FineFit& fit) { fit.converged = false; }), Status::poor_fit);
  EXPECT_EQ(status_with([](FineFit& fit) { fit.used[1] = fit.used[2] = 0; }), Status::occluded);
  EXPECT_EQ(status_with([](FineFit& fit) { fit.used[0] = fit.used[3] = 0; }), Status::occluded);
  EXPECT_EQ(status_with([](FineFit& fit) { fit.covariance(psi_unknown, psi_unknown) = 0.01; }), Status::uncertain);
  EXPECT_EQ(status_with([](FineFit& fit) { fit.inlier_rms_sigmas = 4; }), Status::poor_fit);
  EXPECT_EQ(status_with([](FineFit& fit) { fit.misses_rcm = true; }), Status::uncertain) << "held at it all the same";
  EXPECT_EQ(status_with([](FineFit& fit) { fit.off_probability = 0.5; }), Status::ok)
      << "psi is right with either print";
  FineFit off = right;
  off.off_probability = 0.95;
  EXPECT_EQ(validate(scene, off), Status::marker_mismatch);
  EXPECT_EQ(validate(scene, with_located(off, 0.6)), Status::uncertain) << "blood moves boundaries, too";
  EXPECT_LT(right.p_false, 1e-6);
  const auto psi_may_be_wrong = [](FineFit& fit) { fit.p_false = 2e-3; };
  EXPECT_EQ(status_with(psi_may_be_wrong), Status::uncertain);
  scene.max_p_false = 1e-2;
  EXPECT_EQ(status_with(psi_may_be_wrong), Status::ok);
}

// Blood leaves few boundaries, which agree well; compression leaves many, noisy. Wrong fits agree with few, and badly.
TEST(Verification, TheLessShowsTheBetterItMustAgree) {
  const Shot& shot = usual_shot(1);
  const Scene scene = shot.sight.scene();
  const FineFit right = fit_from_truth(shot);
  const auto most_rms_sigmas = [&](FineFit fit) {
    double most = 0;
    for (fit.inlier_rms_sigmas = 0.01; validate(scene, fit) == Status::ok; fit.inlier_rms_sigmas += 0.01)
      most = fit.inlier_rms_sigmas;
    EXPECT_EQ(validate(scene, fit), Status::poor_fit);
    return most;
  };
  const double whole = most_rms_sigmas(with_located(right, 1));
  EXPECT_NEAR(most_rms_sigmas(with_located(right, 0.5)) / whole, std::sqrt(0.5), 0.02);
  FineFit few_sides = with_located(right, 1);
  few_sides.sides_used = few_sides.sides_in_image / 4;
  EXPECT_LT(most_rms_sigmas(few_sides), 0.6 * whole);
}

// Its depth is that of both ends.
TEST(Verification, WithoutTheRcmBothEndsAreNeeded) {
  const Shot& shot = usual_shot(1);
  const Scene scene = shot.sight.scene();
  for (const bool through_rcm : {true, false}) {
    FineFit fit = fit_from(shot, shot.truth(through_rcm));
    ASSERT_EQ(validate(scene, fit), Status::ok);
    fit.used[3] = fit.in_image[3] = 0;
    EXPECT_EQ(validate(scene, fit), through_rcm ? Status::ok : Status::occluded);
  }
}

TEST(Verification, AMarkerOutsideOfTheImageIsCut) {
  const Shot& shot = usual_shot(1);
  FineFit fit = fit_from_truth(shot);
  ShaftPose aside = fit.unknowns.pose();
  aside.camera_from_unrolled.translation.x() += 0.2;
  fit.unknowns = {aside, false};
  EXPECT_EQ(validate(shot.sight.scene(), fit), Status::cut);
  EXPECT_EQ(colour_agreement(shot.sight.scene(), aside).in_image, 0);
}

ShaftPose moved_along(const Shot& shot, double along_m) {
  return shot.truth(true).changed_by(along_m * PoseVector::Unit(4)).pose();
}

// The frame with a stripe of blood along a boundary.
cv::Mat with_blood_along(const Shot& shot, std::size_t boundary) {
  constexpr int lines = 200, radius_px = 6;
  cv::Mat bloody = shot.bgr.clone();
  const ShaftPose pose = moved_along(shot, 0);
  const Marker& marker = shot.rig.instruments[0].marker;
  for (int i = 0; i < lines; ++i) {
    const double azimuth_rad = two_pi * i / lines;
    const double along_m = boundaries_m(marker, marker_azimuth_rad(marker, azimuth_rad, pose.psi_rad))[boundary];
    const Eigen::Vector3d point = pose.camera_from_unrolled * surface_point(marker.radius_m(), azimuth_rad, along_m);
    const Eigen::Vector2d at_px = shot.rig.camera.raw_from_point(point);
    cv::circle(bloody, cv::Point(static_cast<int>(at_px.x()), static_cast<int>(at_px.y())), radius_px, {10, 10, 70},
               cv::FILLED);
  }
  return bloody;
}

TEST(ClearView, NothingHidesABoundaryButBlood) {
  constexpr int lines = 40;
  scenes::for_each_shot(4, [&](const Shot& shot) {
    const ShaftPose pose = moved_along(shot, 0);
    for (const std::size_t boundary : {0U, 1U, 2U, 3U}) {
      EXPECT_GT(lines_in_clear_view(shot.sight.scene(), pose, boundary, lines), lines / 2) << boundary;
      const Sight bloody(shot.rig, with_blood_along(shot, boundary));
      EXPECT_LE(lines_in_clear_view(bloody.scene(), pose, boundary, lines), 2) << boundary;
      // A misprint is no blood.
      EXPECT_GT(lines_in_clear_view(shot.sight.scene(), moved_along(shot, 0.3e-3), boundary, lines), lines / 3)
          << boundary;
    }
  });
}

}  // namespace lapservo::internal::verification_test
