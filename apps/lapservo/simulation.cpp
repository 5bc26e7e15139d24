#include "apps/lapservo/simulation.h"

#include "lapservo/core/error.h"
#ifdef LAPSERVO_MUJOCO_ARM
#include "lapservo/mujoco_arm/mujoco_arm.h"
#endif

namespace lapservo::app {

void add_simulation_options(CLI::App& command, SimulationOptions& options, const std::string& only) {
  command
      .add_option("--dynamics", options.dynamics,
                  only + "first-order, or mujoco: motors with PD servos, friction, gravity, elastic transmissions")
      ->capture_default_str()
      ->check(CLI::IsMember({"first-order", "mujoco"}));
}

std::unique_ptr<Simulator> make_simulator(const SimulationOptions& options, const Rig& rig,
                                          const SimulatorConfig& config, const JointVector& q_measured) {
  if (options.dynamics == "first-order") return std::make_unique<Simulator>(rig, config, q_measured);
#ifdef LAPSERVO_MUJOCO_ARM
  internal::MujocoArmConfig arm;
  arm.joints = config.arm;
  return std::make_unique<Simulator>(rig, config, std::make_unique<internal::MujocoArm>(arm, q_measured.vector()));
#else
  throw InputError("--dynamics", "is mujoco, which this program was built without: it needs libmujoco-dev");
#endif
}

}  // namespace lapservo::app
