#include "apps/lapservo/cli/subcommands.h"

namespace lapservo::app {

void add_calibrate(Command app) {
  Command calibrate = app.add_subcommand("calibrate", "Measure what a rig says, and write it down.");
  calibrate.require_subcommand();
  calibrate.footer(
      "Examples:\n"
      "  lapservo calibrate all --rig rig.yaml --turn turn.mp4 --swing swing.mp4 --joints joints.csv\n"
      "  lapservo calibrate camera boards/ --board 9x6 --square-mm 5 --rig rig.yaml\n"
      "  lapservo calibrate colour motion.mp4 --rig rig.yaml --out rig.yaml\n"
      "  lapservo calibrate marker turn.mp4 --rig rig.yaml --out rig.yaml\n"
      "  lapservo calibrate registration swing.mp4 --joints joints.csv --rig rig.yaml --out rig.yaml\n"
      "  lapservo calibrate tip --pivot pivot.mp4 --rig rig.yaml --out rig.yaml");
  add_calibrate_all(calibrate);
  add_calibrate_camera(calibrate);
  add_calibrate_colour(calibrate);
  add_calibrate_marker(calibrate);
  add_calibrate_registration(calibrate);
  add_calibrate_tip(calibrate);
}

}  // namespace lapservo::app
