#pragma once

#include "apps/lapservo/cli/command.h"

namespace lapservo::app {

// Each adds its subcommand (one file each) and, when the command line names it, sets `run`.
void add_align(Command app, Run& run);
void add_calibrate(Command app, Run& run);
void add_calibrate_all(Command calibrate, Run& run);
void add_calibrate_camera(Command calibrate, Run& run);
void add_calibrate_colour(Command calibrate, Run& run);
void add_calibrate_marker(Command calibrate, Run& run);
void add_calibrate_registration(Command calibrate, Run& run);
void add_calibrate_tip(Command calibrate, Run& run);
void add_check(Command app, Run& run);
void add_estimate_rcm(Command app, Run& run);
void add_experiment(Command app, Run& run);
void add_marker(Command app, Run& run);
void add_record(Command app, Run& run);
void add_render(Command app, Run& run);
void add_sample(Command app, Run& run);
void add_servo(Command app, Run& run);
void add_sim_robot(Command app, Run& run);
void add_track(Command app, Run& run);
void add_view(Command app, Run& run);

}  // namespace lapservo::app
