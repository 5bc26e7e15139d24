#include "lapservo/vision/model/print_fit.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include <gtest/gtest.h>

#include "lapservo/testing/ink_aside.h"
#include "lapservo/testing/shots.h"
#include "lapservo/vision/model/fine_fit.h"

namespace lapservo::internal::print_fit_test {

using scenes::Shot;
using scenes::Sight;

constexpr std::uint64_t shots = 6;
constexpr int psi = psi_unknown;

// By a rig that has another marker. `hidden`: a boundary of which nothing shows.
PrintFit fit_of(const Shot& shot, const Marker& believed, std::optional<std::size_t> hidden = {},
                bool is_known = false) {
  Rig rig = shot.rig;
  rig.instruments[0].marker = believed;
  const Sight sight(rig, shot.bgr);
  const PoseUnknowns truth = shot.truth(true);
  const EdgeBlur lens;
  EdgeMeasurements edges = measure_edges(sight.scene(), sight.light(), truth, film_mean_m, {2, 0, 1, 1}, lens);
  if (hidden) {
    const auto all = edges.all;
    edges.all.clear();
    for (const Measurement& m : all)
      if (m.group != *hidden) edges.all.push_back(m);
  }
  const CommonErrors errors = common_errors(edges, lens, std::nullopt, {}, {});
  return fit_print(edges.all, RcmBesideFit{sight.scene().registration->of(truth.pose(), 1e-7), true, true}, 0, believed,
                   is_known, errors)
      .value();
}

Marker measured(Marker marker, double sigma_m) {
  marker.sigmas.bands_upper_m = marker.sigmas.bands_lower_m = std::array{sigma_m, sigma_m, sigma_m};
  return marker;
}

TEST(PrintFit, AnExactPrintIsTheRigs) {
  scenes::for_each_shot(shots, [](const Shot& shot) {
    const PrintFit fit = fit_of(shot, shot.rig.instruments[0].marker);
    EXPECT_LT(fit.off_probability, 0.01);
    EXPECT_LT(fit.p_false, 1e-6);
    EXPECT_LT(std::abs(fit.step[psi]), 4 * std::sqrt(fit.covariance(psi, psi)));
    EXPECT_EQ(fit.psi_variance_by_tolerance, 0);
  });
}

// The rest of the print shows that it is not a turn.
TEST(PrintFit, AnInkAsideIsSeenAndPsiIsRightAllTheSame) {
  const Rig nominal = scenes::usual_rig();
  for (const double aside_m : {-0.2e-3, -0.1e-3, 0.1e-3, 0.2e-3})
    for (std::uint64_t seed = 1; seed <= shots; ++seed) {
      SCOPED_TRACE("seed " + std::to_string(seed) + ", aside " + std::to_string(1e3 * aside_m));
      Rig printed = nominal;
      printed.instruments[0].marker = scenes::with_ink_aside(nominal.instruments[0].marker, aside_m);
      const Shot shot(seed, {}, printed);
      const Sight sight(nominal, shot.bgr);
      const FineFit fit = fit_finely(sight.scene(), sight.light(), shot.truth(true), {});
      EXPECT_GT(fit.off_probability, 0.8);
      EXPECT_LT(std::abs(shot.psi_error_rad(fit.unknowns)), 4 * std::sqrt(fit.psi_variance_rad2()));
    }
}

// A hidden boundary may lie anywhere, and a misprint then looks like a turn.
TEST(PrintFit, WhatHidesABoundaryLeavesPsiInDoubtUnlessThePrintWasMeasured) {
  for (const std::size_t boundary : {1U, 2U})
    scenes::for_each_shot(shots, [&](const Shot& shot) {
      SCOPED_TRACE("boundary " + std::to_string(boundary));
      const Marker& marker = shot.rig.instruments[0].marker;
      const auto p_false = [&](const Marker& believed) { return fit_of(shot, believed, boundary).p_false; };
      EXPECT_GT(p_false(marker), 1e-3);
      EXPECT_LT(fit_of(shot, marker, boundary, true).p_false, 1e-3) << "seen before";
      EXPECT_LT(p_false(measured(marker, 1e-5)), 1e-3);
      EXPECT_GT(p_false(measured(marker, 3e-4)), 1e-3) << "not to within what matters";
    });
}

// A frame that shows enough is fitted without it; another is held at it all the same.
TEST(PrintFit, AnRcmThatTheImageMissesIsNamedWhereItHoldsTheShaft) {
  scenes::for_each_shot(shots, [](const Shot& shot) {
    const Scene scene = shot.sight.scene();
    const PoseUnknowns truth = shot.truth(true);
    const EdgeBlur lens;
    const EdgeMeasurements edges = measure_edges(scene, shot.sight.light(), truth, film_mean_m, {2, 0, 1, 1}, lens);
    const CommonErrors errors = common_errors(edges, lens, std::nullopt, {}, {});
    const Eigen::Vector3d aside = truth.pose().camera_from_unrolled.rotation * Eigen::Vector3d::UnitX();
    for (const double off_m : {0.0, 0.05})
      for (const bool is_well_seen : {true, false}) {
        RcmPrior registration = *scene.registration;
        registration.camera_from_rcm.translation += off_m * aside;
        auto measurements = edges.all;
        const RcmBesideFit rcm{registration.of(truth.pose(), fine_fit_limits.least_rcm_sigma_m), true, is_well_seen};
        const auto fit = fit_print(measurements, rcm, 0, scene.marker, false, errors);
        ASSERT_TRUE(fit);
        EXPECT_EQ(fit->misses_rcm, off_m > 0) << is_well_seen;
        EXPECT_EQ(fit->through_rcm, !(fit->misses_rcm && is_well_seen)) << off_m;
      }
  });
}

// All that an image shows of a shaft and a print in diameters it shows of larger ones farther away.
TEST(PrintFit, TheDiameterOfAMeasuredPrintMakesNothingUncertainButThePlace) {
  scenes::for_each_shot(shots, [](const Shot& shot) {
    constexpr double wider = 5e-3;
    const PoseUnknowns truth = shot.truth(false);
    const EdgeBlur lens;
    const EdgeMeasurements edges =
        measure_edges(shot.sight.scene(), shot.sight.light(), truth, film_mean_m, {2, 0, 1, 1}, lens);
    Marker marker = measured(shot.rig.instruments[0].marker, 1e-5);
    const auto covariance = [&]() -> PoseMatrix {
      auto measurements = edges.all;
      CommonErrors errors = common_errors(edges, lens, std::nullopt, {}, {});
      errors.rig = RigErrors(shot.rig.camera, marker, truth.pose(), {});
      return fit_print(measurements, std::nullopt, 0, marker, false, errors).value().covariance;
    };
    const PoseMatrix of_exact = covariance();
    marker.sigmas.diameter_m = wider * marker.diameter_m;
    const PoseMatrix of_measured = covariance();
    const Rigid3& placed = truth.pose().camera_from_unrolled;
    PoseVector scaled = PoseVector::Zero();
    scaled.segment<3>(2) = wider * (placed.rotation.conjugate() * placed.translation);
    const PoseVector per_sigma = of_measured.diagonal().cwiseSqrt().cwiseInverse();
    const PoseMatrix off = of_measured - of_exact - scaled * scaled.transpose();
    EXPECT_LT((per_sigma.asDiagonal() * off * per_sigma.asDiagonal()).cwiseAbs().maxCoeff(), 0.01);
  });
}

TEST(PrintFit, TheTolerancesShareOfPsisVarianceGrowsWithIt) {
  const Shot& shot = scenes::usual_shot(1);
  Marker marker = shot.rig.instruments[0].marker;
  double before = 0;
  for (const double tolerance_m : {0.02e-3, 0.05e-3, 0.1e-3}) {
    marker.tolerance_m = tolerance_m;
    const PrintFit fit = fit_of(shot, marker);
    EXPECT_GT(fit.psi_variance_by_tolerance, before);
    EXPECT_GT(fit.covariance(psi, psi), 0.9 * fit.psi_variance_by_tolerance);
    before = fit.psi_variance_by_tolerance;
  }
}

TEST(PrintFit, AToleranceOfNothingChangesNothing) {
  scenes::for_each_shot(shots, [](const Shot& shot) {
    Marker marker = shot.rig.instruments[0].marker;
    const PrintFit without = fit_of(shot, marker);
    marker.tolerance_m = 1e-9;
    const PrintFit with = fit_of(shot, marker);
    EXPECT_LT(std::abs(with.step[psi] - without.step[psi]), 1e-6);
    EXPECT_NEAR(with.covariance(psi, psi), without.covariance(psi, psi), 1e-3 * without.covariance(psi, psi));
    EXPECT_NEAR(with.p_false, without.p_false, 1e-3 * without.p_false);
    EXPECT_LT(with.psi_variance_by_tolerance, 1e-3 * with.covariance(psi, psi));
  });
}

TEST(PrintFit, AnErrorIsFalseBeyondATenthOfARadian) {
  EXPECT_NEAR(p_false_of(0, 0.1 * 0.1), 0.3173, 1e-4);
  EXPECT_NEAR(p_false_of(0.1, 1e-8), 0.5, 1e-9);
  EXPECT_EQ(p_false_of(-0.3, 0.01), p_false_of(0.3, 0.01));
  EXPECT_LT(p_false_of(0, 0.02 * 0.02), 1e-6);
}

}  // namespace lapservo::internal::print_fit_test
