#pragma once

#include <array>
#include <optional>
#include <span>

#include "lapservo/marker/marker.h"
#include "lapservo/vision/edges/edge_measurements.h"
#include "lapservo/vision/model/common_errors.h"
#include "lapservo/vision/model/residual_lines.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// What is assumed of prints that are not the rig's.
struct PrintLimits {
  /// How far a print is off when it is [mm], and how often that is; all others are the rig's. Each is about half as
  /// often as the one before: with all sizes alike frames that tell nothing lost 17 % of what was found.
  std::array<double, 8> sigmas_mm{0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64};
  std::array<double, 8> fractions{0.05, 0.025, 0.0125, 0.00625, 0.006, 0.0016, 0.0008, 0.0004};
  /// And whether the picture shows that the print is the rig's goes by these: a third are off, by any size. By the
  /// others a print that is off by 0.1 mm is so rare that one which looks like a turn but for little passed for exact.
  std::array<double, 8> suspected_fractions{0, 0.05, 0.05, 0.05, 0.05, 0.05, 0.05, 0.02};
  /// A print is suspicious where, by these fractions, it is off by far_off_mm and more (psi by 0.04 rad) with such a
  /// probability: 1200 exact prints in sharp, soft (1.6 px), dim and noisy pictures have at most 0.005, in defocus, the
  /// dark and after a camera's processing mostly less than 0.05; of 94 prints that are off by 0.05 to 0.3 mm and were
  /// `ok` without this (of 5400) 74 have more than 0.05. And by how many times that of residuals that are zero it is
  /// so: what a small or compressed picture can't tell is no suspicion.
  double far_off_mm = 0.04, suspicious = 0.02, suspicious_of_usual = 6;
  /// Of such a print's psi sigma is told to be so many times the mean over all sizes': either it is exact or far off.
  double suspected_told = 1.2;
  /// From this size on, inks lie aside. With smaller ones exact prints in small pictures had more sigma, and a wrong
  /// registration was no longer seen.
  double least_ink_aside_mm = 0.06;
  double min_weight = 1e-6, min_suspected_weight = 1e-4;  ///< less is too unlikely to count
  double off_sigmas = 3;  ///< beyond what shows, for how far an inner boundary may be off
};
inline constexpr PrintLimits print_limits;

/// A pose, given that the print may lie elsewhere than the rig says: each boundary at either edge of the print (tau = 0
/// and tau -> 2 pi, linear between; the ends are circles). These six errors are normal, independent and alike; large
/// ones have a seventh beside them that both inner boundaries share: an ink that lies aside.
struct PrintFit {
  UnknownVector step;                    ///< to the mean of pose and film, from where the measurements were taken
  UnknownMatrix covariance;              ///< of the pose's unknowns; of a suspicious print wider in psi
  double psi_variance = 0;               ///< by which picture and print are judged
  double off_probability = 0;            ///< that the print is off by more than the tolerance
  double psi_variance_by_tolerance = 0;  ///< of it, what the rig's tolerance adds to an exact print's
  double psi_variance_by_print = 0;      ///< and what the print adds beyond the tolerance
  /// That it is off by print_limits.far_off_mm and more, where many prints are.
  double far_off_probability = 1;
  /// And of one that is suspicious (print_limits), what it adds where many prints are off; else, and of measured bands,
  /// 0.
  double psi_variance_suspected = 0;
  /// How far off the rig's place on the print an inner boundary may lie as a whole, were all others where the rig says:
  /// what the residuals say and three sigma more; of both the worse. Where one is hidden the other's error is a turn,
  /// and nothing shows it: a metre and more.
  double inner_off_m = 3;
};

/// Tells the print's errors from the settled measurements' residuals. How large they usually are is not known, so the
/// pose is a mean over the rig's print and prints that are off by 5 um to 0.6 mm, each weighted by how likely it
/// makes the residuals. On return the residuals are those that the step and the print's likeliest errors leave.
/// `lines` are those of these residuals, `film_prior` as the fit has it. Nullopt when a direction is not seen at all.
std::optional<PrintFit> fit_print(std::span<Measurement> measurements, const ResidualLines& lines, int pose_unknowns,
                                  double film_prior, const Marker& marker, const CommonErrors& errors);

}  // namespace lapservo::internal
