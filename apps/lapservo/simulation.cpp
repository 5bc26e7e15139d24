#include "apps/lapservo/simulation.h"

#include "apps/lapservo/numbers.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/error.h"
#ifdef LAPSERVO_MUJOCO_ARM
#include "lapservo/mujoco_arm/mujoco_arm.h"
#endif

namespace lapservo::app {
namespace {

EndoscopeMotion motion_of(const std::vector<double>& numbers) {
  constexpr double m_per_mm = 1e-3;
  EndoscopeMotion motion{numbers[0], numbers[1], Eigen::Vector3d(&numbers[2]), Eigen::Vector3d(&numbers[5])};
  motion.translation_m *= m_per_mm;
  motion.rotation_rad *= internal::rad_from_deg(1);
  return motion;
}

std::unique_ptr<Simulator> with_arm(const SimulationOptions& options, const Rig& rig, const SimulatorConfig& config,
                                    const JointVector& q_measured) {
  if (options.dynamics == "first-order") return std::make_unique<Simulator>(rig, config, q_measured);
#ifdef LAPSERVO_MUJOCO_ARM
  internal::MujocoArmConfig arm;
  arm.joints = config.arm;
  return std::make_unique<Simulator>(rig, config, std::make_unique<internal::MujocoArm>(arm, q_measured.vector()));
#else
  throw InputError("--dynamics", "is mujoco, which this program was built without: it needs libmujoco-dev");
#endif
}

}  // namespace

void add_simulation_options(CLI::App& command, SimulationOptions& options, const std::string& only) {
  command
      .add_option("--dynamics", options.dynamics,
                  only + "first-order, or mujoco: motors with PD servos, friction, gravity, elastic transmissions")
      ->capture_default_str()
      ->check(CLI::IsMember({"first-order", "mujoco"}));
  command
      .add_option("--endoscope-motion", options.endoscope_motion,
                  only +
                      "at,duration,x,y,z,rx,ry,rz: then (s) and for so long (s; 0: at once) the camera moves in its "
                      "own frame by so many mm, and turns about that vector by its length in degrees")
      ->check(finite_number())
      ->delimiter(',')
      ->expected(8);
}

std::unique_ptr<Simulator> make_simulator(const SimulationOptions& options, const Rig& rig,
                                          const SimulatorConfig& config, const JointVector& q_measured) {
  auto simulator = with_arm(options, rig, config, q_measured);
  if (!options.endoscope_motion.empty()) simulator->move_endoscope(motion_of(options.endoscope_motion));
  return simulator;
}

}  // namespace lapservo::app
