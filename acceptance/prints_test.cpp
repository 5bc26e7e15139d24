// Markers that are not as the rig says: printed, cut and wrapped by hand. Rendered as they are, tracked with the rig's.
// LAPSERVO_PRINTS, LAPSERVO_PRINT_POSES and LAPSERVO_PRINT_SEED set how many (20 and 3; the figures of
// docs/notes/accuracy.md are of 200 and 10) and which.

#include <array>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "acceptance/frame_sets.h"
#include "acceptance/random_print.h"
#include "acceptance/tally.h"
#include "lapservo/core/random.h"

namespace lapservo::acceptance::prints_test {
using namespace internal;

constexpr double mm = 1e-3;

class Prints : public ::testing::Test {
 protected:
  const int prints = from_environment("LAPSERVO_PRINTS", 20);
  int poses = from_environment("LAPSERVO_PRINT_POSES", 3);
  int seed = from_environment("LAPSERVO_PRINT_SEED", 7);
  const Rig rig = example_rig();
  const Marker& nominal = rig.instruments[0].marker;
  Random random{static_cast<std::uint64_t>(seed)};

  // In random places, or on the way between two.
  std::vector<std::vector<JointVector>> places(int number, bool moving) const {
    constexpr double step = 0.02;
    auto all = random_configurations(rig, moving ? 2 : poses, static_cast<std::uint64_t>(1000 * seed + number));
    if (!moving) return all;
    const Eigen::Vector4d from = all[0][0].vector(), to = all[1][0].vector();
    all.clear();
    for (int i = 0; i < poses; ++i) all.push_back({JointVector::from_vector(from + step * i * (to - from))});
    return all;
  }

  // The measurements of a print by a tracker with the rig `believed`.
  Tally seen(const Marker& print, const Rig& believed, int number, bool moving, const Sensor& sensor = {}) const {
    RenderedSet set;
    set.rig = rig;
    set.configurations = places(number, moving);
    set.options.sensor = sensor;
    set.seed = static_cast<std::uint64_t>(number);
    set.rig.instruments[0].marker = print;
    Tracker tracker(believed, {.method = Method::surface, .single = !moving});
    Tally tally;
    for (const TrueFrame& frame : rendered_frames(set))
      tally.add(tracker.track(frame.bgr)[0], frame.truths[0].q.psi_rad, print.seam_rad - nominal.seam_rad);
    return tally;
  }

  // Seen with defocus, too little light or both.
  Tally seen_poorly(Off off) const {
    struct Poor {
      const char* name;
      bool blurred, dark;
    };
    constexpr std::array<Poor, 3> kinds{{{"defocused", true, false}, {"dark", false, true}, {"both", true, true}}};
    Tally all;
    int number = 10'000 * (1 + static_cast<int>(off));
    for (const Poor& kind : kinds) {
      Tally tally;
      for (int i = 0; i < (prints + 3) / 4; ++i, ++number) {
        Random drawn(static_cast<std::uint64_t>(seed) * 1'000'000 + static_cast<std::uint64_t>(number));
        Sensor sensor;
        const double blur_px = drawn.uniform(2, 3.2), light = drawn.uniform(0.1, 0.3);
        if (kind.blurred) sensor.blur_px = blur_px;
        if (kind.dark) sensor.gains = Light::Constant(static_cast<float>(light));
        tally.add(seen(off_print(nominal, off, drawn), rig, number, false, sensor));
      }
      tally.show(kind.name);
      all.add(tally);
    }
    all.show("poor images");
    return all;
  }

  double random_error_m() { return random.uniform(0.02 * mm, 0.3 * mm); }
};

TEST_F(Prints, ThatAreOffAreNotTrusted) {
  Tally all;
  for (int i = 0; i < prints; ++i)
    all.add(seen(random_print(nominal, random_error_m(), false, random).marker, rig, i, false));
  all.show("all");
  EXPECT_EQ(all.wrong, 0);
  EXPECT_LE(rms(all.errors_sigmas), 2);
  EXPECT_GE(all.fraction("marker_mismatch"), 0.8);
}

// Nearly all that are ok are off by less than 0.05 mm: the errors of a few look like a rotation, and the image shows
// little of them. Sigma was too small for them by 2.19 in this draw.
TEST_F(Prints, ThatLookLikeATurnHaveASigmaThatHolds) {
  constexpr int drawn = 200;
  constexpr double most_m = 0.05 * mm;
  seed = 21, poses = 10, random = Random(21);
  Tally all;
  for (int i = 0; i < drawn; ++i)
    if (const Print print = random_print(nominal, random_error_m(), false, random); print.error_m < most_m)
      all.add(seen(print.marker, rig, i, false));
  all.show("off by less than 0.05 mm");
  EXPECT_EQ(all.wrong, 0);
  EXPECT_LE(rms(all.errors_sigmas), 2);
}

TEST_F(Prints, ThatAreTrackedOrAskewAreNotTrustedEither) {
  for (const bool askew : {false, true}) {
    Tally all;
    for (int i = 0; i < prints; ++i)
      all.add(seen(random_print(nominal, random_error_m(), askew, random).marker, rig, i, true));
    all.show(askew ? "tracked, distal end askew" : "tracked");
    EXPECT_EQ(all.wrong, 0);
    EXPECT_LE(rms(all.errors_sigmas), 2);
  }
}

// Errors of a print that show worse are not taken for a rotation: least of all those of both inner boundaries, alike.
// The errors of the rest equal a rotation (docs/notes/accuracy.md).
TEST_F(Prints, InPoorPicturesAreHardlyEverTrustedWhereTheyAreOff) {
  const Tally bands = seen_poorly(Off::bands), ink = seen_poorly(Off::middle_ink), exact = seen_poorly(Off::nowhere);
  EXPECT_LE(bands.fraction("ok"), 0.15);
  EXPECT_LE(bands.wrong, 0.03 * bands.frames);
  EXPECT_LE(ink.fraction("ok"), 0.15);
  EXPECT_EQ(ink.wrong, 0);
  EXPECT_GE(exact.fraction("ok"), 0.95);
  EXPECT_LE(rms(exact.errors_sigmas), 1.5);
}

// Whoever says how far the print may be off gets a pose whose sigma holds.
TEST_F(Prints, WithinTheToleranceAreFound) {
  Rig tolerant = rig;
  tolerant.instruments[0].marker.tolerance_m = 0.1 * mm;
  Tally all;
  for (int i = 0; i < prints; ++i)
    all.add(seen(random_print(nominal, 0.06 * mm, false, random).marker, tolerant, i, false));
  all.show("tolerated");
  EXPECT_GE(all.fraction("ok"), 0.9);
  EXPECT_LE(rms(all.errors_sigmas), 2);
}

}  // namespace lapservo::acceptance::prints_test
