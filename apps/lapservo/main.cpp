#include "apps/lapservo/cli/command.h"
#include "apps/lapservo/cli/subcommands.h"

int main(int argc, char** argv) {
  using namespace lapservo::app;
  return run_program(argc, argv,
                     {add_track, add_view, add_calibrate, add_align, add_check, add_experiment,
#ifdef LAPSERVO_BAGS
                      add_record,
#endif
                      add_render, add_sample, add_servo, add_sim_robot, add_marker, add_estimate_rcm});
}
