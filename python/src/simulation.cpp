#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "lapservo/core/error.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/renderer.h"
#include "lapservo/sim/simulator.h"
#include "lapservo/sim/tissue.h"
#include "python/src/bindings.h"
#include "python/src/conversions.h"

namespace lapservo::python {
namespace {
using namespace internal;

// Frames of a rig's instruments before tissue.
class RigRenderer {
 public:
  RigRenderer(Rig rig, const RenderOptions& options, double film_m, std::uint64_t seed)
      : rig_(std::move(rig)),
        renderer_(rig_.camera, shafts(rig_, film_m), make_tissue(rig_.camera.width_px, rig_.camera.height_px, seed),
                  options) {}

  Image render(const Array<"q", Eigen::Dynamic, 4>& given, std::uint64_t seed) {
    const std::vector<Eigen::Vector4d> q = rows_of(given.value);
    if (!given.value.allFinite()) throw InputError("Renderer.render", "q", "not a number", "finite numbers");
    if (q.size() != rig_.instruments.size())
      throw InputError("Renderer.render", "q", std::to_string(q.size()) + " configurations",
                       "one for each instrument: " + std::to_string(rig_.instruments.size()));
    std::vector<ShaftPlacement> placements;
    for (std::size_t i = 0; i < q.size(); ++i) {
      if (!rig_.instruments[i].camera_from_rcm)
        throw InputError("Renderer", "camera_from_rcm", "missing", "a transform: it says where the instrument is");
      placements.push_back(placement_of(rig_.instruments[i], JointVector::from_vector(q[i])));
    }
    return array_of(renderer_.render(placements, seed));  // with Python's lock: threads may share the renderer
  }

 private:
  static std::vector<ShaftModel> shafts(const Rig& rig, double film_m) {
    std::vector<ShaftModel> all = shafts_of(rig);
    for (ShaftModel& shaft : all) shaft.film_m = film_m;
    return all;
  }
  Rig rig_;
  Renderer renderer_;
};

std::unique_ptr<Simulator> make_simulator(const Rig& rig, const Array<"q", 4>& q, std::uint64_t seed,
                                          double frame_rate_hz, double latency_s, double exposure_s,
                                          const Array<"joint_offset", 4>& joint_offset,
                                          const Array<"backlash", 4>& backlash) {
  SimulatorConfig config;
  config.seed = seed;
  config.endoscope.frame_rate_hz = frame_rate_hz;
  config.endoscope.latency_s = latency_s;
  config.endoscope.exposure_s = exposure_s;
  config.arm.joint_offset = joint_offset.value;
  config.arm.backlash = backlash.value;
  return std::make_unique<Simulator>(rig, config, JointVector::from_vector(q.value));
}

}  // namespace

void bind_simulation(py::module_& m) {
  const RenderOptions usual;
  py::class_<RigRenderer>(m, "Renderer", "Frames of a rig's instruments before tissue, from physical geometry.")
      .def(py::init([](const Rig& rig, double blur_px, double noise, double light, double smoke, double film_m,
                       std::uint64_t seed) {
             for (const double number : {blur_px, noise, light, smoke, film_m})
               if (!(number >= 0 && std::isfinite(number)))
                 throw InputError("Renderer", "blur_px, noise, light, smoke or film_m", fmt::format("{}", number),
                                  "0 or more");
             RenderOptions options;
             options.sensor.blur_px = blur_px;
             options.sensor.read_noise *= noise;
             options.sensor.shot_noise *= noise * noise;
             options.sensor.gains = Light::Constant(static_cast<float>(light));
             options.smoke = static_cast<float>(smoke);
             return std::make_unique<RigRenderer>(rig, options, film_m, seed);
           }),
           py::arg("rig"), py::kw_only(), py::arg("blur_px") = usual.sensor.blur_px, py::arg("noise") = 1.0,
           py::arg("light") = 1.0, py::arg("smoke") = 0.0, py::arg("film_m") = ShaftModel{}.film_m, py::arg("seed") = 1,
           "noise, light: as factors; smoke: a veil, 0 to 1; film_m: of the print's film; seed: of the tissue.")
      .def("render", &RigRenderer::render, py::arg("q"), py::arg("seed") = 1,
           "uint8[H, W, 3]. q: float[N, 4], a row an instrument, or float[4] of a rig of one; seed: of the noise.");

  const ArmConfig arm;
  const EndoscopeConfig endoscope;
  py::class_<Simulator, Robot, ImageStream, Clock> simulator(m, "Simulator",
                                                             R"(Arm, endoscope and clock of a simulated theatre.

All three ports of run() at once. Time is simulated: it passes in sleep_until() and step() only. The same arguments and
commands give the same frames.)");
  simulator
      .def(py::init(&make_simulator), py::arg("rig"), py::arg("q"), py::kw_only(), py::arg("seed") = 1,
           py::arg("frame_rate_hz") = endoscope.frame_rate_hz, py::arg("latency_s") = endoscope.latency_s,
           py::arg("exposure_s") = endoscope.exposure_s, py::arg("joint_offset") = arm.joint_offset,
           py::arg("backlash") = arm.backlash,
           "q: float[4], the measured joints at the start; joint_offset: instrument less measured joints.")
      .def("step", &Simulator::step, py::arg("dt_s"), "Lets time pass.")
      .def_property_readonly("true_q",
                             read_only<Simulator>([](const Simulator& self) { return self.true_q().vector(); }),
                             "float[4]: where the instrument is")
      .def("set_light", &Simulator::set_light, py::arg("light"), "On the scene from now on; 1 is usual.")
      .def(
          "cover_marker",
          [](Simulator& self, double begin_s, double end_s) {
            self.cover_marker({begin_s, end_s});
          },
          py::arg("begin_s"), py::arg("end_s"), "Something lies over the whole marker then.");
  refuse_subclasses(simulator, "Robot, ImageStream or Clock");
}

}  // namespace lapservo::python
