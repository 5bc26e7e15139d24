// Two instruments whose markers touch or cross in the image, one before the other. LAPSERVO_PAIRS and
// LAPSERVO_PAIR_SEED set how many of each kind (4; a fourth of them moving) and which (seed 1).

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "acceptance/frame_sets.h"
#include "acceptance/random_print.h"
#include "acceptance/tally.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"
#include "lapservo/sim/blood.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/tissue.h"
#include "lapservo/testing/sample_frames.h"
#include "lapservo/testing/scenes.h"

namespace lapservo::acceptance::crossing_test {
using namespace internal;

constexpr double mm = 1e-3;

struct PairTally : Tally {
  int tell = 0, found_of_those = 0;  // whose psi can be observed

  int found() const { return static_cast<int>(errors_rad.size()); }
  void add(const Observation& o, double true_psi_rad, bool tells_psi, bool swapped) {
    const int found_before = found(), wrong_before = wrong;
    Tally::add(o, true_psi_rad, 0);
    if (swapped) wrong = wrong_before + 1;
    tell += tells_psi, found_of_those += tells_psi && found() > found_before;
  }
  void add(const PairTally& other) {
    Tally::add(other);
    tell += other.tell, found_of_those += other.found_of_those;
  }
  void print(const std::string& name) const {
    std::printf("| %s | %d | %d | %d | %d | %.1f | %.1f | %.2f | %d |\n", name.c_str(), frames, found(), tell,
                found_of_those, 1e3 * rms(errors_rad), 1e3 * largest(errors_rad), rms(errors_sigmas), wrong);
    std::fflush(stdout);
  }
};

// Patches of all colours, the markers' among them, instead of tissue.
cv::Mat make_colourful(cv::Size size, Random& random) {
  cv::Mat light(size, CV_32FC3, cv::Scalar(0.1, 0.1, 0.15));
  for (int i = 0; i < 60; ++i) {
    std::array<double, 3> colour;
    for (double& channel : colour) channel = random.uniform(0.01, 0.5);
    const int u = static_cast<int>(random.uniform(0, size.width)), v = static_cast<int>(random.uniform(0, size.height));
    const int half_u = static_cast<int>(random.uniform(10, 70)), half_v = static_cast<int>(random.uniform(10, 70));
    cv::ellipse(light, {u, v}, {half_u, half_v}, random.uniform(0, 180), 0, 360,
                cv::Scalar(colour[0], colour[1], colour[2]), cv::FILLED, cv::LINE_AA);
  }
  cv::GaussianBlur(light, light, {}, 1);
  return light;
}

// A pair and its image, to be spoilt.
struct Spoilt {
  std::vector<ShaftModel>& shafts;
  RenderOptions& options;
  Random& random;

  void misprint(Marker& marker, double error_m) const {
    const bool askew = random.uniform() < 0.2;
    marker = random_print(marker, error_m, askew, random).marker;
  }
  void misprint(double least_m, double most_m) const {
    for (ShaftModel& shaft : shafts) misprint(shaft.marker, random.uniform(least_m, most_m));
  }
  void misprint_one() const {
    const double error_m = random.uniform(0.05 * mm, 0.3 * mm);
    misprint(shafts[random.uniform() < 0.5 ? 0 : 1].marker, error_m);
  }
  void bleed(double least, double most) const {
    for (ShaftModel& shaft : shafts) shaft.blotches = blood_over(shaft.marker, random.uniform(least, most), random);
  }
  void film() const {
    for (ShaftModel& shaft : shafts) shaft.film_m = random.uniform(0, 0.3 * mm);
  }
  void noise(double most) const {
    const double times = random.uniform(1, most);
    options.sensor.read_noise *= times, options.sensor.shot_noise *= times * times;
  }
  void darken() const { options.lighting.diffuse *= static_cast<float>(random.uniform(0.2, 1)); }
};

struct Kind {
  std::string name;
  bool exact = false;  // the rig is right, and the image a good one
  double steepest_rad = 0.35;
  std::function<void(const Spoilt&)> spoil = [](const Spoilt&) {};
  bool colourful = false;
};

std::vector<Kind> kinds() {
  using S = const Spoilt&;
  return {{"as the rig says", true},
          {.name = "colourful surroundings", .exact = true, .colourful = true},
          {"steep", true, 0.8},
          {"film of 0 to 0.3 mm", false, 0.35, [](S s) { s.film(); }},
          {"noise, dark", false, 0.35, [](S s) { s.noise(6), s.darken(); }},
          {"blood", false, 0.35, [](S s) { s.bleed(0.05, 0.5); }},
          {"smoke", false, 0.35, [](S s) { s.options.smoke = static_cast<float>(s.random.uniform(0.2, 0.7)); }},
          {"out of focus", false, 0.35, [](S s) { s.options.sensor.blur_px = s.random.uniform(0.8, 4); }},
          {"print off by 0.05 to 0.3 mm", false, 0.35, [](S s) { s.misprint(0.05 * mm, 0.3 * mm); }},
          {"one print off by 0.05 to 0.3 mm", false, 0.5, [](S s) { s.misprint_one(); }},
          {"one print off, blood, film, noise", false, 0.5,
           [](S s) { s.misprint_one(), s.bleed(0, 0.3), s.film(), s.noise(3); }},
          {"print off by 0.01 to 0.06 mm", false, 0.35, [](S s) { s.misprint(0.01 * mm, 0.06 * mm); }},
          {"print off, blood", false, 0.35, [](S s) { s.misprint(0.05 * mm, 0.3 * mm), s.bleed(0.05, 0.4); }},
          {"print off, steep, noise, film", false, 0.8,
           [](S s) { s.misprint(0.05 * mm, 0.3 * mm), s.film(), s.noise(4); }}};
}

// A pair and what it takes to see it. Where `moving`, its frames are tracked, not looked at each on its own.
class Pair {
 public:
  Pair(const Rig& rig, const Kind& kind, std::uint64_t seed) : rig_(rig), random_(seed), seed_(seed) {
    pair_ = scenes::crossing_pair(rig, random_, kind.steepest_rad);
    shafts_ = shafts_of(rig);
    RenderOptions options;
    kind.spoil({shafts_, options, random_});
    const cv::Size size(rig.camera.width_px, rig.camera.height_px);
    const cv::Mat surroundings =
        kind.colourful ? make_colourful(size, random_) : make_tissue(size.width, size.height, seed);
    renderer_.emplace(rig.camera, shafts_, surroundings, options);
  }
  cv::Mat frame() {
    std::vector<ShaftPlacement> placements;
    for (std::size_t k = 0; k < 2; ++k) placements.push_back(placement_of(rig_.instruments[k], pair_.q[k]));
    return renderer_->render(placements, ++seed_);
  }
  void move() {
    for (std::size_t k = 0; k < 2; ++k) {
      JointVector& q = pair_.q[k];
      const double way = k == 0 ? 1 : -1;
      q.psi_rad += 0.03, q.rho_m += 0.2 * mm * way, q.theta_rad += 0.004 * way;
    }
  }
  // The seam's error is invisible.
  double true_psi_rad(std::size_t k) const {
    return pair_.q[k].psi_rad + shafts_[k].marker.seam_rad - rig_.instruments[k].marker.seam_rad;
  }
  // Whether what is taken for one lies nearer to where the other is.
  bool swapped(const Observation& o, std::size_t k) const {
    if (o.status != Status::ok) return false;
    const auto away_m = [&](std::size_t of) {
      const Rigid3 there = *rig_.instruments[of].camera_from_rcm * rcm_from_unrolled(pair_.q[of]);
      return (there.translation - o.camera_from_unrolled.translation).norm();
    };
    return away_m(1 - k) < away_m(k);
  }
  const scenes::CrossingPair& pair() const { return pair_; }

 private:
  const Rig& rig_;
  Random random_;
  std::uint64_t seed_;
  scenes::CrossingPair pair_;
  std::vector<ShaftModel> shafts_;
  std::optional<Renderer> renderer_;
};

class Crossing : public ::testing::Test {
 protected:
  const int pairs = from_environment("LAPSERVO_PAIRS", 4);
  const int seed = from_environment("LAPSERVO_PAIR_SEED", 1);
  const Rig rig = scenes::usual_rig(2);

  struct Tallies {
    PairTally front, behind;
    PairTally both() const {
      PairTally sum = front;
      sum.add(behind);
      return sum;
    }
  };

  void look(Tracker& tracker, Pair& pair, const std::string& name, Tallies& tallies) const {
    const auto& seen = tracker.track(pair.frame());
    for (std::size_t k = 0; k < 2; ++k) {
      const scenes::CrossingPair& of = pair.pair();
      PairTally& part = of.hidden[k] > 0 ? tallies.behind : tallies.front;
      const int wrong = part.wrong;
      part.add(seen[k], pair.true_psi_rad(k), of.tells_psi(k), pair.swapped(seen[k], k));
      if (part.wrong > wrong)
        std::printf("%s, instrument %zu: wrong, %.2f of it hidden, %.2f of its inner boundaries\n", name.c_str(), k,
                    of.hidden[k], of.hidden_inner[k]);
    }
  }

  Tallies looked_at(const Kind& kind, int number, bool moving) const {
    Tallies tallies;
    for (int i = 0; i < (moving ? (pairs + 3) / 4 : pairs); ++i) {
      Pair pair(rig, kind, static_cast<std::uint64_t>(1'000'000 * number + 1000 * seed + i));
      Tracker tracker(rig, {.single = !moving});
      const int frames = moving ? 8 : 1;
      for (int frame = 0; frame < frames; ++frame, pair.move())
        look(tracker, pair, kind.name + ", pair " + std::to_string(i) + ", frame " + std::to_string(frame), tallies);
    }
    return tallies;
  }

  struct Sums {
    PairTally exact, exact_in_front, all;
  };
  Sums looked_at_all(bool moving) const {
    Sums sums;
    int number = 0;
    std::puts(
        "| | markers | detected | with observable psi | detected | psi rms [mrad] | largest | error / sigma | wrong |\n"
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for (const Kind& kind : kinds()) {
      const Tallies tallies = looked_at(kind, ++number, moving);
      tallies.front.print(kind.name + ": nothing before it"), tallies.behind.print("behind the other");
      sums.all.add(tallies.both());
      if (!kind.exact) continue;
      sums.exact.add(tallies.both());
      if (!kind.colourful) sums.exact_in_front.add(tallies.front);
    }
    sums.exact.print("**exact, all**"), sums.all.print("**all**");
    EXPECT_EQ(sums.all.wrong, 0);
    EXPECT_LT(rms(sums.exact.errors_sigmas), 1.5);
    return sums;
  }
};

// Psi can hardly be measured where little of an inner boundary is visible; it is refused where a misprint would not
// show either.
TEST_F(Crossing, BothInstrumentsAreFound) {
  const auto [exact, exact_in_front, all] = looked_at_all(false);
  EXPECT_LT(rms(all.errors_sigmas), 1.5);
  EXPECT_GE(exact_in_front.found(), 0.95 * exact_in_front.frames);
  EXPECT_GE(exact.found_of_those, 0.75 * exact.tell);
}

// Hidden parts are reported from the first frame on.
TEST_F(Crossing, BothAreFollowed) {
  const Sums sums = looked_at_all(true);
  EXPECT_GE(sums.exact.found_of_those, 0.6 * sums.exact.tell);
}

// Where the sides of both meet looks like the end of the one behind, who is found first: it is the rig's first.
TEST(CrossingShafts, WhoIsFoundBeforeTheOneInFrontIsFittedAgain) {
  Rig rig = load_rig(testing::source_folder() / "configs/example.yaml");
  rig.instruments.push_back(rig.instruments[0]);
  Instrument& front = rig.instruments[1];
  front.name = "PSM2", front.marker.hues_deg = {210, 300, 60};
  front.camera_from_rcm = Rigid3{Eigen::Quaterniond(-0.099733438577, 0.3694588619, 0.891952595138, 0.240777820035),
                                 {0.077781746, -0.067215762, 0.059220278}};
  const std::vector<ShaftPlacement> there{
      placement_of(rig.instruments[0], {-0.1641038, 1.7301631, 0.1325724, 0.6178003}),
      placement_of(front, {0.2389108, 1.4187707, 0.0751822, 2.6400651})};
  Renderer renderer(rig.camera, shafts_of(rig), make_tissue(rig.camera.width_px, rig.camera.height_px, 9), {});
  int found = 0;
  for (std::uint64_t noise = 1; noise <= 6; ++noise) {
    const Observation behind = Tracker(rig).track(renderer.render(there, noise))[0];
    if (behind.status != Status::ok) continue;
    ++found;
    EXPECT_LT(std::abs(wrap_pi(behind.rcm.value().q.psi_rad - 0.6178003)), Observation::false_rad) << noise;
  }
  EXPECT_GE(found, 1) << "the test's own power";
}

}  // namespace lapservo::acceptance::crossing_test
