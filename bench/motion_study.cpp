#include <algorithm>
#include <cmath>
#include <optional>

#include "bench/accuracy_study.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"
#include "lapservo/kinematics/visibility.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/tissue.h"
#include "lapservo/testing/camera_effects.h"
#include "lapservo/testing/motion.h"
#include "lapservo/testing/scenes.h"

namespace lapservo::bench {
namespace {
using namespace acceptance;
using namespace internal;

struct Between {
  double low, high;
  double draw(Random& random) const { return random.uniform(low, high); }
};

// The drawn quantities of each frame; everything else stands still.
struct Kind {
  std::string name;
  std::optional<Between> way_px = {};           ///< of the marker's middle, any way
  std::optional<Between> along_across_px = {};  ///< instead: each of both
  std::optional<Between> turns_rad = {};
  std::optional<Between> radius_px = {};  ///< of a shaft that is farther away than usual, with its RCM
  std::optional<double> turn_rad = {};    ///< by so much, to either side
  bool from_rest = false, lit_from_aside = false, subsampled = false;
  Off off = Off::nowhere;
  double diameter_m = 0.0084;  ///< of the instrument; its print is as much smaller
  bool soft_and_dim = false;   ///< 1.6 px of blur, 0.3 of the light
};

constexpr Between some_turn{-0.1, 0.1}, box{-9, 9}, smallest{11, 14}, slow{1, 6};
const std::vector<Kind> kinds{
    {.name = "still"},
    {.name = "2-4px", .way_px = Between{2, 4}, .turns_rad = some_turn},
    {.name = "4-6px", .way_px = Between{4, 6}, .turns_rad = some_turn},
    {.name = "6-10px", .way_px = Between{6, 10}, .turns_rad = some_turn},
    {.name = "10-12px", .way_px = Between{10, 12}, .turns_rad = some_turn},
    {.name = "aside", .way_px = Between{2, 10}, .turns_rad = some_turn, .lit_from_aside = true},
    {.name = "17-23px_radius", .way_px = slow, .radius_px = Between{17, 23}},
    {.name = "14-17px_radius", .way_px = slow, .radius_px = Between{14, 17}},
    {.name = "11-14px_radius", .way_px = slow, .radius_px = smallest},
    {.name = "bands_off", .along_across_px = box, .turns_rad = some_turn, .off = Off::bands},
    {.name = "ink_aside", .along_across_px = box, .turns_rad = some_turn, .off = Off::middle_ink},
    {.name = "small_bands_off", .way_px = slow, .radius_px = smallest, .off = Off::bands},
    {.name = "small_ink_aside", .way_px = slow, .radius_px = smallest, .off = Off::middle_ink},
    {.name = "soft_dim", .soft_and_dim = true},
    {.name = "soft_dim_bands_off", .off = Off::bands, .soft_and_dim = true},
    {.name = "soft_dim_ink_aside", .off = Off::middle_ink, .soft_and_dim = true},
    {.name = "5mm", .diameter_m = 5e-3},
    {.name = "5mm_bands_off", .off = Off::bands, .diameter_m = 5e-3},
    {.name = "5mm_ink_aside", .off = Off::middle_ink, .diameter_m = 5e-3},
    {.name = "3mm", .diameter_m = 3e-3},
    {.name = "3mm_bands_off", .off = Off::bands, .diameter_m = 3e-3},
    {.name = "3mm_ink_aside", .off = Off::middle_ink, .diameter_m = 3e-3},
    {.name = "turn_0.05", .turn_rad = 0.05},
    {.name = "turn_0.1", .turn_rad = 0.1},
    {.name = "turn_0.25", .turn_rad = 0.25},
    {.name = "turn_0.4", .turn_rad = 0.4},
    {.name = "from_rest_0.05", .turn_rad = 0.05, .from_rest = true},
    {.name = "from_rest_0.1", .turn_rad = 0.1, .from_rest = true},
    {.name = "from_rest_0.25", .turn_rad = 0.25, .from_rest = true},
    {.name = "from_rest_0.4", .turn_rad = 0.4, .from_rest = true},
    {.name = "420_from_rest_0.25", .turn_rad = 0.25, .from_rest = true, .subsampled = true}};

struct Drawn {
  scenes::Motion motion;
  double farther = 1;  ///< than usual, the instrument and its RCM
};

Drawn draw(const Kind& kind, Random& random) {
  constexpr double usual_radius_px = 36;
  Drawn drawn;
  scenes::Motion& motion = drawn.motion;
  motion.from_rest = kind.from_rest;
  if (kind.way_px) {
    const double length_px = kind.way_px->draw(random), way_rad = random.uniform(-pi, pi);
    motion.along_and_across_px = length_px * Eigen::Vector2d(std::cos(way_rad), std::sin(way_rad));
  }
  if (kind.along_across_px)
    for (double& way_px : motion.along_and_across_px) way_px = kind.along_across_px->draw(random);
  if (kind.turns_rad) motion.turn_rad = kind.turns_rad->draw(random);
  if (kind.turn_rad) motion.turn_rad = random.uniform() < 0.5 ? *kind.turn_rad : -*kind.turn_rad;
  if (kind.radius_px) drawn.farther = usual_radius_px / kind.radius_px->draw(random);
  return drawn;
}

// A lamp a hand's breadth aside of the camera.
Lighting light_from_aside(Random& random) {
  const double way_rad = random.uniform(-pi, pi);
  const Eigen::Vector3d aside_m = 0.05 * Eigen::Vector3d(std::cos(way_rad), std::sin(way_rad), 0);
  Lighting lighting;
  for (Eigen::Vector3d& lamp_m : lighting.lamps_in_camera_m) lamp_m += aside_m;
  return lighting;
}

cv::Mat picture_of(const Rig& rig, const JointVector& q, const Kind& kind, const scenes::Motion& motion,
                   std::uint64_t seed, Random& random) {
  RenderOptions options;
  if (kind.lit_from_aside) options.lighting = light_from_aside(random);
  if (kind.soft_and_dim) options.sensor.blur_px = 1.6, options.sensor.gains = Light::Constant(0.3F);
  static const cv::Mat tissue = make_tissue(rig.camera.width_px, rig.camera.height_px, 5);
  const cv::Mat bgr = Renderer(rig.camera, {shaft_of(rig.instruments[0])}, tissue, options)
                          .render_exposure(scenes::moving_exposure(rig, q, motion), seed);
  effects::CameraEffects effects;
  effects.subsampled = kind.subsampled;
  return kind.subsampled ? effects::seen_through(effects, bgr, rig.camera) : bgr;
}

TrueFrame drawn_frame(const Kind& kind, std::uint64_t seed, int index) {
  constexpr double nearest_m = 0.075, farthest_m = 0.115, steepest_rad = 0.35, border_px = 30;
  const std::uint64_t of_frame = 10'000 * seed + static_cast<std::uint64_t>(index);
  Random random(of_frame);
  const auto [motion, farther] = draw(kind, random);
  Rig rig = scenes::usual_rig();
  Instrument& instrument = rig.instruments[0];
  instrument.marker = scenes::scaled_to(instrument.marker, kind.diameter_m);
  instrument.camera_from_rcm->translation *= farther;
  const ViewRange range{farther * nearest_m, farther * farthest_m, {steepest_rad, border_px}};
  const Marker nominal = instrument.marker;
  const JointVector q =
      random_configuration_in_view(rig.camera, nominal, *instrument.camera_from_rcm, range, random).value();
  instrument.marker = off_print(nominal, kind.off, random);
  TrueFrame frame{rig, picture_of(rig, q, kind, motion, of_frame, random), {truth_of(rig, 0, q)}};
  take_print_for(frame, nominal);
  return frame;
}

Score score_kind(const Kind& kind, int frames, std::uint64_t seed) {
  Score score;
  for (int i = 0; i < frames; ++i) score_alone(drawn_frame(kind, seed, i), score);
  return score;
}

}  // namespace

std::vector<TrueFrame> motion_frames(const std::string& name, int frames, std::uint64_t seed) {
  const auto kind = std::find_if(kinds.begin(), kinds.end(), [&](const Kind& k) { return k.name == name; });
  std::vector<TrueFrame> drawn;
  for (int i = 0; i < frames; ++i) drawn.push_back(drawn_frame(*kind, seed, i));
  return drawn;
}

std::vector<Row> motion_rows() {
  std::vector<Row> rows;
  for (const Kind& kind : kinds)
    rows.push_back({kind.name, [kind](int frames, std::uint64_t seed) { return score_kind(kind, frames, seed); }});
  return rows;
}

}  // namespace lapservo::bench
