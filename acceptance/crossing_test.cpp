// Two instruments whose markers touch or cross in the image, one before the other. LAPSERVO_PAIRS and
// LAPSERVO_PAIR_SEED set how many (40) and which (seed 1).

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>

#include <gtest/gtest.h>

#include "acceptance/frame_sets.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"
#include "lapservo/testing/scenes.h"

namespace lapservo::acceptance {
using namespace internal;
namespace {

struct Tally {
  int all = 0, tell = 0, found = 0, found_of_those = 0, wrong = 0;
  double squares = 0, normalised = 0, largest_rad = 0;

  void add(const Observation& o, double true_psi_rad, bool tells_psi) {
    ++all, tell += tells_psi;
    if (o.status != Status::ok || !o.rcm) return;
    ++found, found_of_those += tells_psi;
    const double error_rad = wrap_pi(o.rcm->q.psi_rad - true_psi_rad);
    wrong += std::abs(error_rad) > 0.1;
    squares += error_rad * error_rad;
    normalised += error_rad * error_rad / o.rcm->covariance(3, 3);
    largest_rad = std::max(largest_rad, std::abs(error_rad));
  }
  void print(const char* name) const {
    std::printf("| %s | %d | %d | %d | %d | %.1f | %.1f | %.2f | %d |\n", name, all, found, tell, found_of_those,
                1e3 * std::sqrt(squares / std::max(1, found)), 1e3 * largest_rad,
                std::sqrt(normalised / std::max(1, found)), wrong);
  }
};

// Of one of whose inner boundaries little shows psi can hardly be told.
TEST(Crossing, BothInstrumentsAreFound) {
  const int pairs = from_environment("LAPSERVO_PAIRS", 40);
  const auto seed = static_cast<std::uint64_t>(from_environment("LAPSERVO_PAIR_SEED", 1));
  const Rig rig = scenes::usual_rig(2);
  Random random(seed);
  Tally front, back, both;
  for (int i = 0; i < pairs; ++i) {
    const scenes::CrossingPair pair = scenes::crossing_pair(rig, random);
    const cv::Mat image = scenes::render(rig, pair.q, static_cast<std::uint64_t>(i));
    const auto observations = Tracker(rig, {.single = true}).track(image);
    for (std::size_t k = 0; k < 2; ++k) {
      Tally& part = pair.hidden[k] > 0 ? back : front;
      if (observations[k].status != Status::ok)
        std::printf("pair %d, instrument %zu: %s, %.2f of it hidden, %.2f of its inner boundaries\n", i, k,
                    std::string(to_string(observations[k].status)).c_str(), pair.hidden[k], pair.hidden_inner[k]);
      for (Tally* tally : {&part, &both}) tally->add(observations[k], pair.q[k].psi_rad, pair.tells_psi(k));
    }
  }
  std::printf(
      "| | markers | found | of which psi can be told | found | psi rms [mrad] | largest | error / sigma | wrong |\n");
  front.print("nothing before it"), back.print("behind the other"), both.print("both");
  EXPECT_EQ(both.wrong, 0);
  EXPECT_GE(both.found_of_those, 0.95 * both.tell);
  EXPECT_LT(std::sqrt(both.normalised / both.found), 1.5);
}

}  // namespace
}  // namespace lapservo::acceptance
