// Markers that are not as the rig says: printed, cut and wrapped by hand. Rendered as they are, tracked with the rig's.
// LAPSERVO_PRINTS and LAPSERVO_PRINT_POSES set how many (20 and 3; the figures of docs/accuracy.md are of 200 and 10).

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>

#include <gtest/gtest.h>

#include "acceptance/frame_sets.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"

namespace lapservo::acceptance {
namespace {

constexpr double mm = 1e-3;
constexpr double steepest_rad = 0.35;

int from_environment(const char* name, int otherwise) {
  const char* text = std::getenv(name);
  return text ? std::atoi(text) : otherwise;
}

struct Print {
  Marker marker;
  double error_m;  // standard deviation of the bands' lengths
};

// Every band is off by itself, at either edge; the last takes up what keeps the ends circles.
Print random_print(const Marker& nominal, Random& random) {
  Print print{nominal, random.uniform(0.02 * mm, 0.3 * mm)};
  auto &upper = print.marker.bands_upper_m, &lower = print.marker.bands_lower_m;
  for (double& band : upper) band += print.error_m * random.normal();
  for (std::size_t i = 0; i < 2; ++i) lower[i] += print.error_m * random.normal();
  lower[2] = print.marker.length_m() - lower[0] - lower[1];
  print.marker.seam_rad += 0.05 * random.normal();
  return print;
}

struct Tally {
  int frames = 0, wrong = 0;
  std::map<std::string, int> statuses;
  std::vector<double> errors_rad, errors_sigmas;

  // The seam's error is none that a picture could show.
  void add(const Observation& o, double true_psi_rad, double seam_error_rad) {
    ++frames;
    ++statuses[std::string(status_word(o.status))];
    if (o.status != Status::ok || !o.rcm) return;
    const double error_rad = wrap_pi(o.rcm->q.psi_rad - true_psi_rad - seam_error_rad);
    wrong += std::abs(error_rad) > 0.1;
    errors_rad.push_back(error_rad);
    errors_sigmas.push_back(error_rad / std::sqrt(o.rcm->covariance(3, 3)));
  }
  void show(const std::string& name) const {
    std::printf("%s: %d frames", name.c_str(), frames);
    for (const auto& [status, count] : statuses) std::printf(", %d %s", count, status.c_str());
    std::printf("; psi rms %.1f mrad, largest %.1f mrad, error / sigma %.2f, %d wrong\n", 1e3 * rms(errors_rad),
                1e3 * largest(errors_rad), rms(errors_sigmas), wrong);
  }
};

class Prints : public ::testing::Test {
 protected:
  const int prints = from_environment("LAPSERVO_PRINTS", 20), poses = from_environment("LAPSERVO_PRINT_POSES", 3);
  Random random_{7};

  // What is seen of a print in random places, by a tracker that takes it for the rig's.
  void track(const Marker& print, const Rig& rig, bool single, Tally& tally, std::uint64_t seed) const {
    RenderedSet set;
    set.rig = rig;
    set.configurations = random_configurations(rig, poses, seed, steepest_rad);
    set.seed = seed;
    set.rig.instruments[0].marker = print;
    Tracker tracker(rig, {.method = Method::surface, .single = single});
    for (const TrueFrame& frame : rendered_frames(set))
      tally.add(tracker.track(frame.bgr)[0], frame.truths[0].q.psi_rad,
                print.seam_rad - rig.instruments[0].marker.seam_rad);
  }
};

TEST_F(Prints, ThatAreOffAreNotTrusted) {
  const Rig rig = example_rig();
  Tally all;
  std::map<int, Tally> by_error;
  for (int i = 0; i < prints; ++i) {
    const Print print = random_print(rig.instruments[0].marker, random_);
    const auto seed = static_cast<std::uint64_t>(1000 + i);
    Tally tally;
    track(print.marker, rig, true, tally, seed);
    for (Tally* to : {&all, &by_error[static_cast<int>(print.error_m / (0.05 * mm))]}) {
      to->frames += tally.frames, to->wrong += tally.wrong;
      for (const auto& [status, count] : tally.statuses) to->statuses[status] += count;
      to->errors_rad.insert(to->errors_rad.end(), tally.errors_rad.begin(), tally.errors_rad.end());
      to->errors_sigmas.insert(to->errors_sigmas.end(), tally.errors_sigmas.begin(), tally.errors_sigmas.end());
    }
  }
  for (const auto& [error, tally] : by_error)
    tally.show("bands off by " + std::to_string(error * 5) + " to " + std::to_string(error * 5 + 5) + " / 100 mm");
  all.show("all");
  EXPECT_EQ(all.wrong, 0);
  EXPECT_LE(rms(all.errors_sigmas), 2);
}

}  // namespace
}  // namespace lapservo::acceptance
