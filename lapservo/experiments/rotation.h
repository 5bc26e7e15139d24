#pragma once

#include <array>
#include <filesystem>
#include <span>
#include <vector>

#include "lapservo/experiments/setup.h"
#include "lapservo/experiments/statistics.h"
#include "lapservo/report/html_report.h"

namespace lapservo::internal {

/// The paper's section V-C: ten trials, each a pure rotation by a full turn from its own initial rotation. The paper
/// has one set of ten; here there are three, each with positions, a background and noise of its own.
struct RotationResult {
  static constexpr int sets = 3, trials = 10, steps = 40;  ///< a trial passes the seam of the marker once
  static constexpr double turn_s = 10;                     ///< a trial's duration
  static constexpr double first_rad = -3.5, last_rad = -1.25;
  /// The paper's Table I, by trial.
  static constexpr std::array<double, trials> paper_mean_rad{0.0232,  0.0199,  0.0110,  0.0394, 0.0219,
                                                             -0.0073, -0.0062, -0.0030, 0.0224, 0.0273};
  static constexpr std::array<double, trials> paper_deviation_rad{0.0916, 0.0853, 0.0768, 0.0765, 0.0778,
                                                                  0.0623, 0.0579, 0.0604, 0.0579, 0.0713};

  struct Sample {
    int set, trial, step;
    double true_rad;      ///< psi, from the trial's initial rotation on, not wrapped
    double measured_rad;  ///< the turn nearest to the truth
    double sigma_rad;     ///< as the method says
    double error_rad() const { return measured_rad - true_rad; }
    double time_s() const { return turn_s * step / steps; }
  };
  struct OfMethod {
    Method method;
    std::vector<Sample> samples;          ///< of the frames where the instrument was found
    std::vector<Spread> by_trial;         ///< of the error, radians: those of the first set, then the next
    Spread all, in_sigmas;                ///< of all sets: the error, radians; the error over its sigma
    double under_100mrad, under_200mrad;  ///< fractions of the errors
  };
  std::vector<OfMethod> methods;
};

RotationResult measure_rotation(const ExperimentSetup& setup);

/// rotation.csv: every sample; rotation_trials.csv: Table I, of every set.
void write_data(const RotationResult& result, const std::filesystem::path& folder);

ReportSection section_of(const RotationResult& result, const ExperimentSetup& setup);

/// The initial rotation of a trial.
double initial_rotation_rad(int trial);

/// Mean and deviation of the union of equally long parts, given each part's mean and deviation.
struct Pooled {
  double mean, deviation, rms;
};
Pooled pooled(std::span<const double> means, std::span<const double> deviations);

/// Sums up samples that are there.
RotationResult::OfMethod summed_up(Method method, std::vector<RotationResult::Sample> samples);

}  // namespace lapservo::internal
