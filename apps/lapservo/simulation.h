#pragma once

#include <memory>
#include <string>
#include <vector>

#include "apps/lapservo/command.h"
#include "lapservo/sim/simulator.h"

namespace lapservo::app {

/// How the simulated arm and its endoscope are made.
struct SimulationOptions {
  std::vector<double> endoscope_motion;  ///< s, s, 3 x mm, 3 x degrees
  std::string endoscope_profile = "even";
  double exposure_ms = 0, smoke = 0;
  int blood = 0;                           ///< blotches
  std::vector<double> light;               ///< s, s, times
  std::vector<double> registration_error;  ///< 3 x mm
  double lens_error = 0;                   ///< fraction of the focal length
};

/// `only`: precedes what the options say, for a command that does other things too.
void add_simulation_options(Command command, SimulationOptions& options, const std::string& only);

/// As things are in the simulation, where `rig` is what is believed of them.
Rig true_rig_of(const SimulationOptions& options, const Rig& rig);

/// `true_rig`: see true_rig_of().
std::unique_ptr<Simulator> make_simulator(const SimulationOptions& options, const Rig& true_rig,
                                          const SimulatorConfig& config, const JointVector& q_measured);

}  // namespace lapservo::app
