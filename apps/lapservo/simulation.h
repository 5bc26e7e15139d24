#pragma once

#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "lapservo/sim/simulator.h"

namespace lapservo::app {

/// How the simulated arm and its endoscope are made.
struct SimulationOptions {
  std::string dynamics = "first-order";
  std::vector<double> endoscope_motion;  ///< s, s, 3 x mm, 3 x degrees
};

/// `only`: precedes what the options say, for a command that does other things too.
void add_simulation_options(CLI::App& command, SimulationOptions& options, const std::string& only);

/// Throws InputError for dynamics that this program was built without.
std::unique_ptr<Simulator> make_simulator(const SimulationOptions& options, const Rig& rig,
                                          const SimulatorConfig& config, const JointVector& q_measured);

}  // namespace lapservo::app
