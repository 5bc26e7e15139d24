#pragma once

#include "apps/lapservo/cli/command.h"

namespace lapservo::app {

// Each adds its subcommand (one file each).
void add_align(Command app);
void add_calibrate(Command app);
void add_calibrate_camera(Command calibrate);
void add_calibrate_colour(Command calibrate);
void add_calibrate_marker(Command calibrate);
void add_calibrate_registration(Command calibrate);
void add_calibrate_tip(Command calibrate);
void add_check(Command app);
void add_estimate_rcm(Command app);
void add_experiment(Command app);
void add_marker(Command app);
void add_record(Command app);
void add_render(Command app);
void add_sample(Command app);
void add_servo(Command app);
void add_sim_robot(Command app);
void add_track(Command app);
void add_view(Command app);

}  // namespace lapservo::app
