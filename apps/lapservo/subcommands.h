#pragma once

#include <functional>

#include <CLI/CLI.hpp>

namespace lapservo::app {

/// What a parsed command line asks for; returns the exit code: 0, or 1 when nothing was found or nothing converged.
/// Throws InputError for bad input, which main() prints in one line and ends with 2.
using Run = std::function<int()>;

// Each adds its subcommand (one file each) and, when the command line names it, sets `run`.
void add_calibrate(CLI::App& app, Run& run);
void add_calibrate_all(CLI::App* calibrate, Run& run);
void add_calibrate_camera(CLI::App* calibrate, Run& run);
void add_calibrate_colour(CLI::App* calibrate, Run& run);
void add_calibrate_marker(CLI::App* calibrate, Run& run);
void add_calibrate_registration(CLI::App* calibrate, Run& run);
void add_check(CLI::App& app, Run& run);
void add_estimate_rcm(CLI::App& app, Run& run);
void add_experiment(CLI::App& app, Run& run);
void add_marker(CLI::App& app, Run& run);
void add_reference(CLI::App& app, Run& run);
void add_render(CLI::App& app, Run& run);
void add_servo(CLI::App& app, Run& run);
void add_sim_robot(CLI::App& app, Run& run);
void add_track(CLI::App& app, Run& run);

}  // namespace lapservo::app
