#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "bench/accuracy_study.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/kinematics/visibility.h"
#include "lapservo/marker/azimuths.h"
#include "lapservo/sim/blood.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/tissue.h"
#include "lapservo/testing/camera_effects.h"
#include "lapservo/testing/motion.h"
#include "lapservo/testing/scenes.h"
#include "lapservo/vision/colour/colour_evidence.h"

namespace lapservo::bench {
namespace {
using namespace acceptance;
using namespace internal;

enum Hardship : std::size_t {
  misprint,
  blood,
  processing,
  crossing,
  small,
  motion,
  soft_and_dim,
  wrong_rig,
  hardships
};
using Hardships = std::bitset<hardships>;
constexpr std::array<const char*, hardships> names{"misprint", "blood",  "processing", "crossing",
                                                   "small",    "motion", "soft, dim",  "wrong rig"};

// One in five frames has three, the others one or two.
Hardships draw_hardships(Random& random) {
  Hardships drawn;
  const std::size_t count = 1 + static_cast<std::size_t>(random.uniform(0, 2.5));
  while (drawn.count() < count) drawn.set(random.bits() % hardships);
  return drawn;
}

scenes::Motion draw_motion(Random& random) {
  const double way_px = random.uniform(1, 12), way_rad = random.uniform(-pi, pi);
  scenes::Motion drawn;
  drawn.along_and_across_px = way_px * Eigen::Vector2d(std::cos(way_rad), std::sin(way_rad));
  drawn.turn_rad = random.uniform(-0.25, 0.25);
  drawn.from_rest = random.uniform() < 0.5;
  return drawn;
}

// A few of the many tissues there are, as one takes as long to make as a frame.
cv::Mat tissue_for(const Camera& camera, Random& random) {
  static const std::vector<cv::Mat> all = [&] {
    std::vector<cv::Mat> made;
    for (std::uint64_t seed = 1; seed <= 20; ++seed)
      made.push_back(make_tissue(camera.width_px, camera.height_px, seed));
    return made;
  }();
  return all[random.bits() % all.size()];
}

// Errors of a careless calibration: focal lengths, the RCM's place, the diameter.
void make_wrong(Rig& rig, Random& random) {
  const auto off_by = [&](double fraction) { return random.uniform(1 - fraction, 1 + fraction); };
  rig.camera.fx_px *= off_by(0.03), rig.camera.fy_px *= off_by(0.03);
  for (Instrument& instrument : rig.instruments) {
    for (double& along_m : instrument.camera_from_rcm->translation) along_m += random.uniform(-3e-3, 3e-3);
    instrument.marker.diameter_m *= off_by(0.03);
  }
}

struct Placed {
  Rig rig;
  std::vector<JointVector> q;
};

// In view; a marker that is smaller in the image is one of a thinner instrument or farther away.
Placed placed(Hardships drawn, Random& random) {
  constexpr double nearest_m = 0.075, farthest_m = 0.115, steepest_rad = 0.5, border_px = 30;
  Placed out{scenes::usual_rig(drawn[crossing] ? 2 : 1), {}};
  const bool is_thin = drawn[crossing] || random.uniform() < 0.5;
  const double diameter_m = random.uniform() < 0.5 ? 3e-3 : 5e-3, farther = random.uniform(1.5, 3.3);
  if (drawn[small] && is_thin)
    for (Instrument& instrument : out.rig.instruments)
      instrument.marker = scenes::scaled_to(instrument.marker, diameter_m);
  if (drawn[crossing]) {
    out.q = scenes::crossing_pair(out.rig, random, steepest_rad).q;
    return out;
  }
  Instrument& instrument = out.rig.instruments[0];
  const double times = drawn[small] && !is_thin ? farther : 1;
  instrument.camera_from_rcm->translation *= times;
  const ViewRange range{times * nearest_m, times * farthest_m, {steepest_rad, border_px}};
  out.q = {random_configuration_in_view(out.rig.camera, instrument.marker, *instrument.camera_from_rcm, range, random)
               .value()};
  return out;
}

std::vector<ShaftModel> shafts_to_render(const Rig& rig, Hardships drawn, Random& random) {
  std::vector<ShaftModel> shafts;
  for (const Instrument& instrument : rig.instruments) {
    ShaftModel shaft = shaft_of(instrument);
    if (drawn[misprint])
      shaft.marker = off_print(shaft.marker, random.uniform() < 0.5 ? Off::bands : Off::middle_ink, random);
    if (drawn[blood]) shaft.blotches = blood_over(shaft.marker, random.uniform(0.05, 0.6), random);
    shafts.push_back(shaft);
  }
  return shafts;
}

cv::Mat exposed(const Placed& at, Hardships drawn, Random& random) {
  RenderOptions options;
  if (drawn[soft_and_dim])
    options.sensor.blur_px = random.uniform(1, 3), options.sensor.gains = Light::Constant(random.uniform(0.15F, 0.5F));
  Exposure exposure{{placement_of(at.rig.instruments[0], at.q[0])}};
  if (drawn[motion]) exposure = scenes::moving_exposure(at.rig, at.q[0], draw_motion(random));
  for (auto& moment : exposure)
    for (std::size_t i = 1; i < at.q.size(); ++i) moment.push_back(placement_of(at.rig.instruments[i], at.q[i]));
  return Renderer(at.rig.camera, shafts_to_render(at.rig, drawn, random), tissue_for(at.rig.camera, random), options)
      .render_exposure(exposure, random.bits());
}

struct HostileFrame {
  Hardships hardships;
  TrueFrame frame;
};

HostileFrame draw_frame(std::uint64_t seed) {
  Random random(seed);
  const Hardships drawn = draw_hardships(random);
  Placed at = placed(drawn, random);
  TrueFrame frame{at.rig, exposed(at, drawn, random), {}};
  for (std::size_t i = 0; i < at.q.size(); ++i) frame.truths.push_back(truth_of(at.rig, i, at.q[i]));
  if (drawn[processing]) {
    const auto& conditions = effects::conditions();
    const auto effect = effects::draw(conditions[1 + random.bits() % (conditions.size() - 1)], random.bits());
    frame.bgr = effects::seen_through(effect, frame.bgr, frame.rig.camera);
    if (random.uniform() < 0.5) frame.rig.camera = effects::calibrated(effect, frame.rig.camera);
  }
  if (drawn[wrong_rig]) make_wrong(frame.rig, random);
  return {drawn, std::move(frame)};
}

// About the shaft, whatever the registration says.
double error_rad(const Observation& seen, const Truth& truth) {
  return wrap_pi(seen.tau_rad - truth.tau_rad);
}

bool is_wrong(const Observation& seen, const Truth& truth) {
  return seen.status == Status::ok && std::abs(error_rad(seen, truth)) > Observation::false_rad;
}

// Markers, how many are ok, and how many of these wrong.
struct Count {
  int markers = 0, ok = 0, wrong = 0;
  void add(const Observation& seen, const Truth& truth) {
    ++markers, ok += seen.status == Status::ok, wrong += is_wrong(seen, truth);
  }
};

std::string listed(Hardships drawn) {
  std::string list;
  for (std::size_t h = 0; h < hardships; ++h)
    if (drawn[h]) list += (list.empty() ? "" : " + ") + std::string(names[h]);
  return list;
}

// By decades of p_false: 1e-2 to 1e-1, 1e-3 to 1e-2, ...
constexpr int decades = 6;
int decade_of(double p_false) {
  return std::clamp(static_cast<int>(-std::log10(std::max(p_false, 1e-12))) - 1, 0, decades - 1);
}

std::vector<Observation> seen_with(const TrueFrame& frame, double max_p_false) {
  TrackerOptions options{.method = Method::surface, .single = true};
  options.max_p_false = max_p_false;
  return Tracker(frame.rig, options).track(frame.bgr);
}

void print(const std::string& name, const Count& count) {
  std::printf("| %s | %d | %d | %d |\n", name.c_str(), count.markers, count.ok, count.wrong);
}

// Counts what the pixels show in their places by the true pose.
class ColourCounts {
 public:
  void add(const Scene& scene, const ShaftPose& pose) {
    const auto view = view_cylinder(pose.camera_from_unrolled, scene.marker.radius_m());
    if (!view) return;
    for (int i = 0; i < lines; ++i) add_line(scene, pose, visible_azimuth_rad(*view, line_reach, i, lines));
    for (const double side : {-1.0, 1.0})
      for (const double radii : {1.1, 1.2, 1.4})
        for (int k = 0; k < places; ++k)
          add(scene, Place::beside,
              pose.camera_from_unrolled * surface_point(radii * scene.marker.radius_m(),
                                                        view->facing_azimuth_rad + side * pi / 2, at_m(scene, k)));
  }
  void print() const {
    std::puts("| place | its band | another | grey | other |\n| --- | --- | --- | --- | --- |");
    for (std::size_t place = 0; place < counts_.size(); ++place) {
      auto of = counts_[place];
      if (place > 0) of[0] = of[1] / 3, of[1] -= of[0];  // no band belongs there
      const double all = of[0] + of[1] + of[2] + of[3];
      std::printf("| %s | %.3f | %.3f | %.3f | %.3f |\n", place_names[place], of[0] / all, of[1] / all, of[2] / all,
                  of[3] / all);
    }
  }

 private:
  static constexpr int lines = 9, places = 40;
  static constexpr double line_reach = 0.85, beyond = 0.15, guard = 0.03;  // of the visible half angle; of the length
  static constexpr std::array<const char*, 3> place_names{"band", "shaft", "beside"};

  static double at_m(const Scene& scene, int k) {
    return scene.marker.length_m() * ((1 + 2 * beyond) * (k + 0.5) / places - beyond);
  }
  void add_line(const Scene& scene, const ShaftPose& pose, double azimuth_rad) {
    const auto ends_m = boundaries_m(scene.marker, marker_azimuth_rad(scene.marker, azimuth_rad, pose.psi_rad));
    for (int k = 0; k < places; ++k) {
      const double along_m = at_m(scene, k), guard_m = guard * scene.marker.length_m();
      if (std::any_of(ends_m.begin(), ends_m.end(), [&](double end_m) { return std::abs(end_m - along_m) < guard_m; }))
        continue;
      const auto band = std::upper_bound(ends_m.begin(), ends_m.end(), along_m) - ends_m.begin() - 1;
      const bool on_band = band >= 0 && band < 3;
      add(scene, on_band ? Place::band : Place::shaft,
          pose.camera_from_unrolled * surface_point(scene.marker.radius_m(), azimuth_rad, along_m),
          on_band ? scene.bands[static_cast<std::size_t>(band)] : Scene::outside);
    }
  }
  void add(const Scene& scene, Place place, const Eigen::Vector3d& point, std::uint8_t its_band = Scene::outside) {
    if (!scene.field.contains(point)) return;
    const Eigen::Vector2d raw_px = scene.camera.raw_from_point(point);
    const std::uint8_t colour = scene.class_at(raw_px);
    if (colour == Scene::outside) return;
    Shows shows = Shows::another_band;
    if (!scene.is_ours(colour))
      shows = grey_or_other(scene.image.pixel(static_cast<int>(raw_px.x() + 0.5), static_cast<int>(raw_px.y() + 0.5)));
    else if (colour == its_band)
      shows = Shows::its_band;
    counts_[static_cast<std::size_t>(place)][static_cast<std::size_t>(shows)] += 1;
  }

  std::array<std::array<double, 4>, 3> counts_{};
};

}  // namespace

void print_colour_frequencies(int frames, std::uint64_t seed) {
  ColourCounts counts;
  for (int i = 0; i < frames; ++i) {
    const auto [drawn, frame] = draw_frame(1'000'000 * seed + static_cast<std::uint64_t>(i));
    if (!drawn[blood] || drawn[wrong_rig]) continue;
    const scenes::Sight sight(frame.rig, frame.bgr);
    for (std::size_t k = 0; k < frame.truths.size(); ++k)
      counts.add(sight.scene(k), scenes::pose_of(frame.rig, k, frame.truths[k].q));
  }
  counts.print();
}

void print_false_accepts(int frames, std::uint64_t seed) {
  Count all;
  std::array<Count, hardships> by_hardship;
  std::array<Count, decades> by_p_false;
  for (int i = 0; i < frames; ++i) {
    const auto [drawn, frame] = draw_frame(1'000'000 * seed + static_cast<std::uint64_t>(i));
    const auto usual = seen_with(frame, Observation::usual_max_p_false), any = seen_with(frame, 0.1);
    for (std::size_t k = 0; k < frame.truths.size(); ++k) {
      all.add(usual[k], frame.truths[k]);
      for (std::size_t h = 0; h < hardships; ++h)
        if (drawn[h]) by_hardship[h].add(usual[k], frame.truths[k]);
      if (any[k].p_false) by_p_false[static_cast<std::size_t>(decade_of(*any[k].p_false))].add(any[k], frame.truths[k]);
      if (is_wrong(usual[k], frame.truths[k]))
        std::fprintf(stderr, "frame %d, %s, %s: off by %.3f rad, sigma %.4f rad, p_false %.1e\n", i,
                     frame.truths[k].instrument.c_str(), listed(drawn).c_str(), error_rad(usual[k], frame.truths[k]),
                     usual[k].sigma_tau_rad, usual[k].p_false.value_or(0));
    }
    if ((i + 1) % 1000 == 0) std::fprintf(stderr, "%d of %d frames, %d ok and wrong\n", i + 1, frames, all.wrong);
  }
  std::puts("| frames with | markers | ok | wrong |\n| --- | --- | --- | --- |");
  for (std::size_t h = 0; h < hardships; ++h) print(names[h], by_hardship[h]);
  print("all", all);
  std::puts("\n| p_false, of a tracker that takes 0.1 | markers | ok | wrong |\n| --- | --- | --- | --- |");
  for (int d = 0; d < decades; ++d)
    print((d + 1 < decades ? fmt::format("1e-{} to 1e-{}", d + 2, d + 1) : fmt::format("below 1e-{}", d + 1)),
          by_p_false[static_cast<std::size_t>(d)]);
}

}  // namespace lapservo::bench
