#pragma once

#include <filesystem>
#include <vector>

#include "lapservo/experiments/html_report.h"
#include "lapservo/experiments/setup.h"
#include "lapservo/experiments/statistics.h"

namespace lapservo {

/// The paper's section V-C: ten trials, each a pure rotation by a full turn from its own initial rotation.
struct RotationResult {
  static constexpr int trials = 10, steps = 40;  ///< a trial passes the seam of the marker once
  static constexpr double first_rad = -3.5, last_rad = -1.25;

  struct Sample {
    int trial, step;
    double true_rad;      ///< psi, from the trial's initial rotation on, not wrapped
    double measured_rad;  ///< the turn nearest to the truth
    double sigma_rad;     ///< as the method says
    double error_rad() const { return measured_rad - true_rad; }
  };
  struct OfMethod {
    Method method;
    std::vector<Sample> samples;   ///< of the frames where the instrument was found
    std::vector<Spread> by_trial;  ///< of the error, radians
    Spread all, in_sigmas;         ///< of the error, radians; of the error over its sigma
  };
  std::vector<OfMethod> methods;
};

RotationResult measure_rotation(const ExperimentSetup& setup);

/// rotation.csv: every sample; rotation_trials.csv: Table I.
void write_data(const RotationResult& result, const std::filesystem::path& folder);

ReportSection section_of(const RotationResult& result, const ExperimentSetup& setup);

/// The initial rotation of a trial.
double initial_rotation_rad(int trial);

/// Sums up samples that are there.
RotationResult::OfMethod summed_up(Method method, std::vector<RotationResult::Sample> samples);

}  // namespace lapservo
