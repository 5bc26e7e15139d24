#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"
#include "lapservo/experiments/data_file.h"
#include "lapservo/experiments/setup.h"
#include "lapservo/report/html_report.h"
#include "lapservo/sim/simulator.h"

namespace lapservo::internal {

/// One run of the closed loop in the simulator.
struct TrackingScenario {
  std::string id;     ///< a word, for the file's name
  std::string title;  ///< of the figures
  ControlMode mode = ControlMode::fused;
  Method method = Method::surface;
  double latency_s = 0.08;
  double duration_s = 20;
  std::optional<double> hidden_from_s = {}, hidden_to_s = {};  ///< the marker is covered then
};

struct TrackingRun {
  TrackingScenario scenario;
  TimeTable table;                    ///< what tracking_ID.csv holds
  std::optional<double> converged_s;  ///< from when on true errors are first within 1 px and 5 mrad for a second
  /// True errors s_rad, r, l, d px over the last third, or from the hidden marker's return on.
  Eigen::Vector4d steady_rms = Eigen::Vector4d::Zero(), steady_mean = Eigen::Vector4d::Zero(),
                  steady_largest = Eigen::Vector4d::Zero();
  Eigen::Vector4d decay_per_s = Eigen::Vector4d::Zero();  ///< of each feature's error at the start; NaN: not measured
  double delay_s = 0;                                     ///< the estimate at the end; NaN: none
  double rate_fraction = 0;                               ///< largest setpoint rate as a fraction of its limit
  std::optional<double> held_s, resumed_s;                ///< after the marker was hidden, after it was back
  std::optional<double> back_s;                           ///< from the marker's return to within 1 px and 5 mrad
};

/// The paper's section V-D: from a random start in the field of view the instrument tracks the trajectory of its
/// features, steered by what the simulated endoscope sees (30 frames/s, 80 ms late, sensor noise, an arm with lag,
/// backlash and 3 mm and 2 degrees of kinematic offsets).
struct TrackingResult {
  std::vector<TrackingRun> runs;
  Eigen::Vector2d estimated_rcm_px = Eigen::Vector2d::Zero();  ///< what the uncalibrated run goes by
  std::vector<std::string> missing = {};                       ///< titles of runs not finished: it was stopped
};

inline constexpr double tracking_period_s = 1.0 / 60;
/// The arm and the endoscope of a run.
SimulatorConfig tracking_simulator(const TrackingScenario& scenario, std::uint64_t seed);
/// The controller of a run.
ControllerConfig tracking_controller(const TrackingScenario& scenario, const Camera& camera);

/// Stopped, it has the runs that were finished. Throws Interrupted when there is none.
TrackingResult measure_tracking(const ExperimentSetup& setup);

/// tracking_ID.csv: every period of a run.
void write_data(const TrackingResult& result, const std::filesystem::path& folder);

ReportSection section_of(const TrackingResult& result, const ExperimentSetup& setup);

}  // namespace lapservo::internal
