#include "lapservo/experiments/tracking.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "lapservo/control/paper_trajectory.h"
#include "lapservo/control/random_start.h"
#include "lapservo/control/tracking_law.h"
#include "lapservo/core/error.h"
#include "lapservo/experiments/stage.h"
#include "lapservo/rcm/projected_rcm.h"
#include "lapservo/servo/convergence.h"
#include "lapservo/servo/image_features.h"
#include "lapservo/servo/image_window.h"
#include "lapservo/servo/run.h"
#include "lapservo/servo/servo_log.h"
#include "lapservo/sim/simulator.h"
#include "lapservo/sim/tissue.h"

namespace lapservo::internal {
namespace {

constexpr double period_s = tracking_period_s, window_margin_px = 20;

std::vector<TrackingScenario> scenarios() {
  std::vector<TrackingScenario> all{
      {"default", "the default", ControlMode::fused, Method::surface, 0.08, 20},
      {"paper", "the paper\u2019s law and eyes", ControlMode::paper, Method::centerline, 0.08, 60},
      {"paper_surface", "the paper\u2019s law, our eyes", ControlMode::paper, Method::surface, 0.08, 60},
      {"uncalibrated", "uncalibrated", ControlMode::uncalibrated, Method::surface, 0.08, 20},
      {"hidden", "the marker hidden for 2 s", ControlMode::fused, Method::surface, 0.08, 13, 7, 9}};
  for (const int latency_ms : {0, 150, 250})
    all.push_back({fmt::format("latency_{}", latency_ms), fmt::format("latency {} ms", latency_ms), ControlMode::fused,
                   Method::surface, latency_ms / 1000.0, 10});
  return all;
}

// The uncalibrated loop's estimate of the RCM: its image, the intersection of the centre lines of 20 frames.
Eigen::Vector2d estimate_rcm_px(const ExperimentSetup& setup) {
  constexpr int positions = 20;
  constexpr double nominal_sigma_px = 0.1;
  Random random(setup.seed + 17);
  Stage stage(setup.rig, make_tissue(setup.rig.camera.width_px, setup.rig.camera.height_px, setup.seed + 17));
  Eyes eyes(without_registration(setup.rig), {Method::surface});
  std::vector<LineObservation> lines;
  int frame = 0;
  for (const JointVector& q : spread_positions(setup.rig, positions, random)) {
    const Observation seen = eyes.observe(stage.render(q, 1, frame_seed(setup.seed + 17, frame++)))[0];
    if (seen.status == Status::ok)
      lines.push_back(line_between(seen.edges_ideal_px[0], seen.edges_ideal_px[3], nominal_sigma_px));
  }
  const auto fit = estimate_projected_rcm(lines);
  if (fit.status != RcmStatus::ok) throw InputError("rig", "the RCM's image can't be estimated from 20 positions");
  return fit.point_px;
}

class Recorder : public RunObserver {
 public:
  Recorder(TrackingRun& run, const FeatureModel& true_model, const Simulator& simulator, const JointLimits& limits,
           std::function<bool()> keep_going)
      : run_(run), true_model_(true_model), simulator_(simulator), limits_(limits), keep_going_(std::move(keep_going)) {
    for (const char* what : {"desired_", "true_", "error_"})
      for (const std::string_view feature : FeatureVector::names)
        run_.table.columns.push_back({what + std::string(feature), {}});
    for (const std::string_view joint : JointVector::names)
      run_.table.columns.push_back({"true_" + std::string(joint), {}});
    for (const char* what : {"holds", "limited", "delay_s"}) run_.table.columns.push_back({what, {}});
  }

  bool on_tick(const ControlTick& tick) override {
    const InstrumentTruth truth = truth_at(true_model_, simulator_.true_q());
    const Eigen::Vector4d features = truth.features.value_or(Eigen::Vector4d::Constant(std::nan("")));
    const Eigen::Vector4d& desired = tick.input.desired.features;
    const ControlStep& control = tick.decision.control;
    const bool holds = control.action == ControlAction::hold;
    run_.table.time_s.push_back(tick.input.time_s);
    std::size_t column = 0;
    const auto put = [&](double value) { run_.table.columns[column++].values.push_back(value); };
    for (const Eigen::Vector4d& four : {desired, features, feature_error(features, desired), truth.q})
      for (const double value : four) put(value);
    put(holds);
    put(control.limited);
    run_.delay_s = control.delay_is_known ? control.delay_s : std::nan("");
    put(run_.delay_s);
    run_.rate_fraction =
        std::max(run_.rate_fraction, control.setpoint.velocity.cwiseAbs().cwiseQuotient(limits_.rate).maxCoeff());
    note_hold(tick.input.time_s, holds);
    return keep_going_();
  }

 private:
  void note_hold(double time_s, bool holds) {
    const TrackingScenario& scenario = run_.scenario;
    if (!scenario.hidden_from_s) return;
    const double lost_s = *scenario.hidden_from_s + scenario.latency_s,
                 back_s = *scenario.hidden_to_s + scenario.latency_s;
    if (holds && !run_.held_s && time_s >= lost_s - period_s) run_.held_s = time_s - lost_s;
    if (!holds && run_.held_s && !run_.resumed_s && time_s >= back_s - period_s) run_.resumed_s = time_s - back_s;
  }

  TrackingRun& run_;
  FeatureModel true_model_;
  const Simulator& simulator_;
  JointLimits limits_;
  std::function<bool()> keep_going_;
};

Eigen::Vector4d error_at(const TimeTable& table, std::size_t i) {
  Eigen::Vector4d error;
  for (std::size_t k = 0; k < 4; ++k) error[static_cast<Eigen::Index>(k)] = table.columns[8 + k].values[i];
  return error;
}

// Slope of the logarithm of a feature's error, from the last limited motion at the start until the feed-forward of a
// late image is as large as the error.
std::optional<double> decay_per_s(const TrackingRun& run, int feature) {
  const Eigen::Vector4d least(0.01, 10, 8, 8);
  constexpr double start_s = 5;  // motions are limited in it, if ever
  const auto& error = run.table.columns[8 + static_cast<std::size_t>(feature)].values;
  const auto& limited = run.table.column("limited").values;
  std::size_t from = 0;
  for (std::size_t i = 0; i < error.size() && run.table.time_s[i] < start_s; ++i)
    if (limited[i] > 0 || run.table.time_s[i] < 4 * run.scenario.latency_s) from = i + 1;
  double n = 0, t = 0, y = 0, tt = 0, ty = 0;
  for (std::size_t i = from; i < error.size() && std::abs(error[i]) > least[feature]; ++i) {
    const double time_s = run.table.time_s[i], value = std::log(std::abs(error[i]));
    n += 1, t += time_s, y += value, tt += time_s * time_s, ty += time_s * value;
  }
  constexpr double fewest = 20;
  return n >= fewest ? std::optional(-(n * ty - t * y) / (n * tt - t * t)) : std::nullopt;
}

void sum_up(TrackingRun& run) {
  const TimeTable& table = run.table;
  Convergence convergence, again;
  double counted = 0;
  for (std::size_t i = 0; i < table.time_s.size(); ++i) {
    const Eigen::Vector4d error = error_at(table, i);
    convergence.add(table.time_s[i], error);
    // The last third; of the run with the hidden marker all that comes after the marker is back.
    if (table.time_s[i] < run.scenario.hidden_to_s.value_or(2 * run.scenario.duration_s / 3)) continue;
    again.add(table.time_s[i], error);
    run.steady_rms += error.cwiseAbs2();
    run.steady_mean += error;
    run.steady_largest = run.steady_largest.cwiseMax(error.cwiseAbs());
    ++counted;
  }
  run.converged_s = convergence.first_s();
  if (run.scenario.hidden_to_s && again.first_s()) run.back_s = *again.first_s() - *run.scenario.hidden_to_s;
  run.steady_rms = (run.steady_rms / std::max(1.0, counted)).cwiseSqrt();
  run.steady_mean /= std::max(1.0, counted);
  for (int i = 0; i < 4; ++i) run.decay_per_s[i] = decay_per_s(run, i).value_or(NAN);
}

// One for all runs: from where even the longest can be followed, by the paper's law, too.
JointVector common_start(const ExperimentSetup& setup) {
  TrackingScenario longest = scenarios().front();
  for (const TrackingScenario& scenario : scenarios())
    if (scenario.duration_s > longest.duration_s && scenario.mode == ControlMode::paper) longest = scenario;
  Random random(setup.seed + 3);
  return random_start(sinusoids(paper_sinusoids()), longest.duration_s, feature_model(setup.rig),
                      tracking_controller(longest, setup.rig.camera), ArmConfig{}.joint_offset, random, "rig");
}

// Nothing when it was stopped.
std::optional<TrackingRun> run_scenario(const TrackingScenario& scenario, const ExperimentSetup& setup,
                                        const JointVector& start, const Eigen::Vector2d& rcm_px, int done_before,
                                        int total) {
  TrackingRun run;
  run.scenario = scenario;
  const Trajectory trajectory = sinusoids(paper_sinusoids());
  Simulator simulator(setup.rig, tracking_simulator(scenario, setup.seed), start);
  if (scenario.hidden_from_s) simulator.cover_marker({*scenario.hidden_from_s, *scenario.hidden_to_s});

  RunConfig config{
      known_exactly(setup.rig), tracking_controller(scenario, setup.rig.camera), {}, {scenario.method, false}};
  if (scenario.mode == ControlMode::uncalibrated) {
    config.rig.instruments[0].camera_from_rcm.reset();
    config.rcm_px = rcm_px;
  }
  int done = done_before;
  bool stopped = false;
  Recorder recorder(run, feature_model(setup.rig), simulator, config.controller.limits, [&] {
    stopped = !setup.keep_going(++done, total);
    return !stopped;
  });
  SupervisorConfig supervision;
  supervision.max_loop_hold_s = scenario.duration_s;  // nobody is there to say start
  Supervisor arm(simulator, simulator, supervision);
  lapservo::run(arm, simulator, simulator, config, trajectory, scenario.duration_s, recorder);
  if (stopped) return std::nullopt;
  sum_up(run);
  return run;
}

int periods_of(const TrackingScenario& scenario) {
  return static_cast<int>(std::lround(scenario.duration_s / period_s));
}

}  // namespace

SimulatorConfig tracking_simulator(const TrackingScenario& scenario, std::uint64_t seed) {
  SimulatorConfig config;
  config.seed = seed;
  config.endoscope.frame_rate_hz = 30;  // of most endoscopes
  config.endoscope.latency_s = scenario.latency_s;
  return config;
}

ControllerConfig tracking_controller(const TrackingScenario& scenario, const Camera& camera) {
  ControllerConfig config =
      scenario.mode == ControlMode::paper ? paper_controller(tracking_period_s) : ControllerConfig{};
  config.mode = scenario.mode;
  config.period_s = tracking_period_s;
  config.window = image_window(camera, window_margin_px);
  return config;
}

TrackingResult measure_tracking(const ExperimentSetup& setup) {
  TrackingResult result;
  result.estimated_rcm_px = estimate_rcm_px(setup);
  const JointVector start = common_start(setup);
  int total = 0, done = 0;
  for (const TrackingScenario& scenario : scenarios()) total += periods_of(scenario);
  for (const TrackingScenario& scenario : scenarios()) {
    std::optional<TrackingRun> run;
    if (result.missing.empty()) run = run_scenario(scenario, setup, start, result.estimated_rcm_px, done, total);
    if (run)
      result.runs.push_back(std::move(*run));
    else
      result.missing.push_back(scenario.title);
    done += periods_of(scenario);
  }
  if (result.runs.empty()) throw Interrupted{};
  return result;
}

void write_data(const TrackingResult& result, const std::filesystem::path& folder) {
  for (const TrackingRun& run : result.runs) write_data(run.table, folder / ("tracking_" + run.scenario.id + ".csv"));
}

}  // namespace lapservo::internal
