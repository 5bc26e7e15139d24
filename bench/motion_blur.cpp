// motion_blur [FRAMES [SEED [KIND...]]]: how well and how honestly the tracker does on single pictures of instruments
// that move or turn while the shutter is open, rendered; a row of docs/notes/accuracy.md for each kind. Psi's truth is
// that in the middle of the exposure, less the seam's error, which no picture shows.
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "acceptance/frame_sets.h"
#include "acceptance/random_print.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"
#include "lapservo/kinematics/visibility.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/tissue.h"
#include "lapservo/testing/camera_effects.h"
#include "lapservo/testing/motion.h"
#include "lapservo/testing/scenes.h"

namespace {
using namespace lapservo;
using namespace lapservo::acceptance;
using namespace lapservo::internal;

// What is drawn for one frame.
struct Drawn {
  scenes::Motion motion;
  double farther = 1;  ///< than usual, the instrument and its RCM
  Off off = Off::nowhere;
  bool lit_from_aside = false, subsampled = false;
};

scenes::Motion any_way(double length_px, Random& random) {
  const double way_rad = random.uniform(-pi, pi);
  return {.along_and_across_px = length_px * Eigen::Vector2d(std::cos(way_rad), std::sin(way_rad))};
}

Drawn moving(double least_px, double most_px, Random& random) {
  Drawn drawn;
  drawn.motion = any_way(random.uniform(least_px, most_px), random);
  drawn.motion.turn_rad = random.uniform(-0.1, 0.1);
  return drawn;
}

Drawn small(double least_radius_px, double most_radius_px, Random& random) {
  constexpr double usual_radius_px = 36;
  Drawn drawn;
  drawn.motion = any_way(random.uniform(1, 6), random);
  drawn.farther = usual_radius_px / random.uniform(least_radius_px, most_radius_px);
  return drawn;
}

Drawn small_and_still(double least_radius_px, double most_radius_px, Random& random) {
  Drawn drawn = small(least_radius_px, most_radius_px, random);
  drawn.motion = {};
  return drawn;
}

Drawn turning(double turn_rad, bool from_rest, bool subsampled, Random& random) {
  Drawn drawn;
  drawn.motion.turn_rad = random.uniform() < 0.5 ? turn_rad : -turn_rad;
  drawn.motion.from_rest = from_rest;
  drawn.subsampled = subsampled;
  return drawn;
}

// Up to 9 px along and across, turns up to 0.1 rad.
Drawn moving_print(Off off, Random& random) {
  Drawn drawn;
  const double along_px = random.uniform(-9, 9), across_px = random.uniform(-9, 9);
  drawn.motion = {.along_and_across_px = {along_px, across_px}, .turn_rad = random.uniform(-0.1, 0.1)};
  drawn.off = off;
  return drawn;
}

Drawn small_print(Off off, Random& random) {
  Drawn drawn = small(11, 14, random);
  drawn.off = off;
  return drawn;
}

Drawn lit_from_aside(Random& random) {
  Drawn drawn = moving(2, 10, random);
  drawn.lit_from_aside = true;
  return drawn;
}

using Draw = std::function<Drawn(Random&)>;
const std::vector<std::pair<std::string, Draw>>& kinds() {
  static const std::vector<std::pair<std::string, Draw>> all{
      {"still", [](Random&) { return Drawn{}; }},
      {"2-4px", [](Random& r) { return moving(2, 4, r); }},
      {"4-6px", [](Random& r) { return moving(4, 6, r); }},
      {"6-10px", [](Random& r) { return moving(6, 10, r); }},
      {"10-12px", [](Random& r) { return moving(10, 12, r); }},
      {"aside", [](Random& r) { return lit_from_aside(r); }},
      {"17-23px_radius", [](Random& r) { return small(17, 23, r); }},
      {"14-17px_radius", [](Random& r) { return small(14, 17, r); }},
      {"11-14px_radius", [](Random& r) { return small(11, 14, r); }},
      {"17-23px_still", [](Random& r) { return small_and_still(17, 23, r); }},
      {"14-17px_still", [](Random& r) { return small_and_still(14, 17, r); }},
      {"11-14px_still", [](Random& r) { return small_and_still(11, 14, r); }},
      {"bands_off", [](Random& r) { return moving_print(Off::bands, r); }},
      {"ink_aside", [](Random& r) { return moving_print(Off::middle_ink, r); }},
      {"small_bands_off", [](Random& r) { return small_print(Off::bands, r); }},
      {"small_ink_aside", [](Random& r) { return small_print(Off::middle_ink, r); }},
      {"turn_0.05", [](Random& r) { return turning(0.05, false, false, r); }},
      {"turn_0.1", [](Random& r) { return turning(0.1, false, false, r); }},
      {"turn_0.25", [](Random& r) { return turning(0.25, false, false, r); }},
      {"turn_0.4", [](Random& r) { return turning(0.4, false, false, r); }},
      {"from_rest_0.05", [](Random& r) { return turning(0.05, true, false, r); }},
      {"from_rest_0.1", [](Random& r) { return turning(0.1, true, false, r); }},
      {"from_rest_0.25", [](Random& r) { return turning(0.25, true, false, r); }},
      {"from_rest_0.4", [](Random& r) { return turning(0.4, true, false, r); }},
      {"420", [](Random& r) { return turning(0, false, true, r); }},
      {"420_from_rest_0.25", [](Random& r) { return turning(0.25, true, true, r); }},
  };
  return all;
}

// A lamp a hand's breadth aside of the camera.
Lighting light_from_aside(Random& random) {
  const double way_rad = random.uniform(-pi, pi);
  const Eigen::Vector3d aside_m = 0.05 * Eigen::Vector3d(std::cos(way_rad), std::sin(way_rad), 0);
  Lighting lighting;
  for (Eigen::Vector3d& lamp_m : lighting.lamps_in_camera_m) lamp_m += aside_m;
  return lighting;
}

// Errors, and errors in sigmas, of frames that are ok.
struct Errors {
  int frames = 0, wrong = 0;
  std::map<std::string, int> statuses;
  std::vector<double> psi_rad, psi_sigmas_rad, psi, theta, phi, rho;

  void add(const Observation& o, const JointVector& truth) {
    ++frames, ++statuses[std::string(to_string(o.status))];
    if (o.status != Status::ok || !o.rcm) return;
    Eigen::Vector4d error = o.rcm->q.vector() - truth.vector();
    error[0] = wrap_pi(error[0]), error[3] = wrap_pi(error[3]);
    const Eigen::Vector4d sigma = o.rcm->covariance.diagonal().cwiseSqrt();
    wrong += std::abs(error[3]) > 0.1;
    psi_rad.push_back(error[3]), psi_sigmas_rad.push_back(sigma[3]);
    theta.push_back(error[0] / sigma[0]), phi.push_back(error[1] / sigma[1]);
    rho.push_back(error[2] / sigma[2]), psi.push_back(error[3] / sigma[3]);
  }
};

Observation observed(const Rig& believed, const Drawn& drawn, const JointVector& q, const Marker& print,
                     std::uint64_t seed, Random& random) {
  Rig rig = believed;
  rig.instruments[0].marker = print;
  RenderOptions options;
  if (drawn.lit_from_aside) options.lighting = light_from_aside(random);
  static const cv::Mat tissue = make_tissue(rig.camera.width_px, rig.camera.height_px, 5);
  cv::Mat bgr = Renderer(rig.camera, {shaft_of(rig.instruments[0])}, tissue, options)
                    .render_exposure(scenes::moving_exposure(rig, q, drawn.motion), seed);
  if (drawn.subsampled) {
    effects::CameraEffects effects;
    effects.subsampled = true;
    bgr = effects::seen_through(effects, bgr, rig.camera);
  }
  return Tracker(believed, {.method = Method::surface, .single = true}).track(bgr)[0];
}

Errors errors_of(const Draw& draw, int frames, std::uint64_t seed) {
  constexpr double nearest_m = 0.075, farthest_m = 0.115, steepest_rad = 0.35, border_px = 30;
  Errors errors;
  for (int i = 0; i < frames; ++i) {
    const std::uint64_t of_frame = 10'000 * seed + static_cast<std::uint64_t>(i);
    Random random(of_frame);
    const Drawn drawn = draw(random);
    Rig rig = scenes::usual_rig();
    const Instrument& instrument = rig.instruments[0];
    rig.instruments[0].camera_from_rcm->translation *= drawn.farther;
    const ViewRange range{drawn.farther * nearest_m, drawn.farther * farthest_m, {steepest_rad, border_px}};
    JointVector q =
        random_configuration_in_view(rig.camera, instrument.marker, *instrument.camera_from_rcm, range, random).value();
    const Marker print = off_print(instrument.marker, drawn.off, random);
    const Observation o = observed(rig, drawn, q, print, of_frame, random);
    q.psi_rad += print.seam_rad - instrument.marker.seam_rad;
    errors.add(o, q);
  }
  return errors;
}

void print_row(const std::string& name, const Errors& e) {
  const double found = 100.0 * static_cast<double>(e.psi.size()) / std::max(1, e.frames);
  std::printf("| %s | %d | %.0f %% | %+.1f, %.1f | %.1f | %.1f | %.2f, %.1f | %.2f, %.1f | %.2f, %.1f | %d |",
              name.c_str(), e.frames, found, 1e3 * mean(e.psi_rad), 1e3 * rms(e.psi_rad), 1e3 * largest(e.psi_rad),
              1e3 * rms(e.psi_sigmas_rad), rms(e.psi), largest(e.psi), rms(e.theta), largest(e.theta), rms(e.rho),
              largest(e.rho), e.wrong);
  for (const auto& [status, count] : e.statuses)
    if (status != "ok") std::printf(" %d %s", count, status.c_str());
  std::printf("\n");
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  const int frames = argc > 1 ? std::atoi(argv[1]) : 40;
  const auto seed = static_cast<std::uint64_t>(argc > 2 ? std::atoll(argv[2]) : 1);
  const std::vector<std::string> asked(argv + std::min(argc, 3), argv + argc);
  std::puts(
      "| kind | frames | found | psi mean, rms [mrad] | largest | sigma rms | psi's error / sigma, largest | theta's | "
      "rho's | wrong |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
  for (const auto& [name, draw] : kinds())
    if (asked.empty() || std::find(asked.begin(), asked.end(), name) != asked.end())
      print_row(name, errors_of(draw, frames, seed));
}
