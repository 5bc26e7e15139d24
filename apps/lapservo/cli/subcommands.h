#pragma once

#include "apps/lapservo/cli/command.h"

namespace lapservo::app {

// Each adds its subcommand (one file each) and, when the command line names it, sets `run`.
void add_calibrate(CLI::App& app, Run& run);
void add_calibrate_all(CLI::App& calibrate, Run& run);
void add_calibrate_camera(CLI::App& calibrate, Run& run);
void add_calibrate_colour(CLI::App& calibrate, Run& run);
void add_calibrate_marker(CLI::App& calibrate, Run& run);
void add_calibrate_registration(CLI::App& calibrate, Run& run);
void add_check(CLI::App& app, Run& run);
void add_estimate_rcm(CLI::App& app, Run& run);
void add_experiment(CLI::App& app, Run& run);
void add_marker(CLI::App& app, Run& run);
void add_record(CLI::App& app, Run& run);
void add_render(CLI::App& app, Run& run);
void add_sample(CLI::App& app, Run& run);
void add_servo(CLI::App& app, Run& run);
void add_sim_robot(CLI::App& app, Run& run);
void add_track(CLI::App& app, Run& run);
void add_view(CLI::App& app, Run& run);

}  // namespace lapservo::app
