#include "apps/lapservo/simulation.h"

#include <algorithm>
#include <cstdint>

#include "lapservo/core/angles.h"
#include "lapservo/core/error.h"
#include "lapservo/core/random.h"

namespace lapservo::app {
namespace {

EndoscopeMotion motion_of(const SimulationOptions& options) {
  constexpr double m_per_mm = 1e-3;
  const std::vector<double>& numbers = options.endoscope_motion;
  EndoscopeMotion motion{numbers[0], numbers[1], Eigen::Vector3d(&numbers[2]), Eigen::Vector3d(&numbers[5])};
  motion.translation_m *= m_per_mm;
  motion.rotation_rad *= internal::rad_from_deg(1);
  if (options.endoscope_profile == "smooth") motion.profile = MotionProfile::smooth;
  return motion;
}

std::vector<Blotch> blotches_of(const SimulationOptions& options, const Marker& marker, std::uint64_t seed) {
  internal::Random random(seed);
  std::vector<Blotch> blotches;
  for (int i = 0; i < options.blood; ++i)
    blotches.push_back(
        {random.uniform(0, internal::two_pi), random.uniform(0, marker.length_m()), random.uniform(5e-4, 2e-3)});
  return blotches;
}

}  // namespace

void add_simulation_options(Command command, SimulationOptions& options, const std::string& only) {
  command
      .add_option("--endoscope-motion", options.endoscope_motion,
                  only +
                      "at,duration,x,y,z,rx,ry,rz: then (s) and for so long (s; 0: at once) the camera moves in its "
                      "own frame by so many mm, and turns about that vector by its length in degrees")
      .finite_number()
      .delimiter(',')
      .expected(8);
  command
      .add_option("--endoscope-profile", options.endoscope_profile,
                  only + "how it moves: even, at one speed, or smooth, from rest to rest")
      .shows_default()
      .one_of({"even", "smooth"});
  command.add_option("--exposure-ms", options.exposure_ms, only + "the shutter is open for so long: motion blur")
      .shows_default()
      .number_between(0.0, 200.0);
  command.add_option("--smoke", options.smoke, only + "fraction of grey veil in front of everything")
      .shows_default()
      .number_between(0.0, 1.0);
  command.add_option("--blood", options.blood, only + "so many blotches on the marker")
      .shows_default()
      .whole_number_between(0, 100);
  command
      .add_option("--light", options.light,
                  only + "at,duration,times: then (s) and for so long (s) so many times as much light")
      .finite_number()
      .delimiter(',')
      .expected(3);
  command
      .add_option("--registration-error", options.registration_error,
                  only + "x,y,z: the true RCM lies by so many mm, in the camera's frame, beside the rig's")
      .finite_number()
      .delimiter(',')
      .expected(3);
  command
      .add_option("--lens-error", options.lens_error,
                  only + "the true focal length is by this fraction longer than the rig's")
      .shows_default()
      .number_between(-0.5, 0.5);
}

Rig true_rig_of(const SimulationOptions& options, const Rig& rig) {
  Rig truth = rig;
  truth.camera.fx_px *= 1 + options.lens_error;
  truth.camera.fy_px *= 1 + options.lens_error;
  auto& camera_from_rcm = truth.instruments.front().camera_from_rcm;
  if (camera_from_rcm && !options.registration_error.empty())
    camera_from_rcm->translation += 1e-3 * Eigen::Vector3d(options.registration_error.data());
  return truth;
}

std::unique_ptr<Simulator> make_simulator(const SimulationOptions& options, const Rig& true_rig,
                                          const SimulatorConfig& config, const JointVector& q_measured) {
  SimulatorConfig all = config;
  all.endoscope.exposure_s = options.exposure_ms / 1000;
  all.render.smoke = static_cast<float>(options.smoke);
  all.blotches = blotches_of(options, true_rig.instruments.front().marker, config.seed);
  auto simulator = std::make_unique<Simulator>(true_rig, all, q_measured);
  if (!options.light.empty())
    simulator->change_light({options.light[0], options.light[0] + options.light[1]},
                            static_cast<float>(std::max(0.0, options.light[2])));
  if (!options.endoscope_motion.empty())
    simulator->move_endoscope(motion_of(options));
  else if (options.endoscope_profile != SimulationOptions().endoscope_profile)
    throw InputError("--endoscope-profile",
                     "says how the endoscope moves, and --endoscope-motion, which makes it, is not given");
  return simulator;
}

}  // namespace lapservo::app
