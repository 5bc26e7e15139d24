#include "lapservo/vision/surface_tracker.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/testing/camera_effects.h"
#include "lapservo/testing/motion.h"
#include "lapservo/testing/rigs.h"
#include "lapservo/testing/shots.h"
#include "lapservo/vision/colour/blob_search.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::internal::surface_tracker_test {

using scenes::Shot;
using scenes::usual_shot;

// Mean square of the error in sigmas of `o`.
double normalised_square(const Observation& o, const JointVector& truth) {
  Eigen::Vector4d error = o.rcm->q.vector() - truth.vector();
  error[0] = wrap_pi(error[0]), error[3] = wrap_pi(error[3]);
  return error.dot(o.rcm->covariance.ldlt().solve(error)) / 4;
}

double psi_error_rad(const Observation& o, const JointVector& truth) {
  return wrap_pi(o.rcm.value().q.psi_rad - truth.psi_rad);
}

void expect_right(const Observation& o, const JointVector& truth) {
  ASSERT_EQ(o.status, Status::ok) << to_string(o.status);
  ASSERT_TRUE(o.rcm);
  EXPECT_LT(normalised_square(o, truth), 4);
  EXPECT_LT(std::abs(psi_error_rad(o, truth)), 0.01);
}

// Where the marker's middle lies in the image of an ideal lens.
Eigen::Vector2d middle_px(const Rig& rig, std::size_t i, const JointVector& q) {
  return rig.camera.ideal_from_point(scenes::pose_of(rig, i, q).camera_from_unrolled * Eigen::Vector3d(0, 0, 0.012));
}

// Instruments that cross would hide one another: their middles 320 px apart in the image.
std::vector<JointVector> apart(const Rig& rig, Random& random) {
  for (;;) {
    const std::vector<JointVector> all = scenes::random_configurations(rig, random);
    bool clear = true;
    for (std::size_t i = 0; i < all.size(); ++i)
      for (std::size_t j = 0; j < i; ++j)
        clear = clear && (middle_px(rig, i, all[i]) - middle_px(rig, j, all[j])).norm() > 320;
    if (clear) return all;
  }
}

// Whose print was measured: it may show little of itself.
Rig measured_rig() {
  Rig rig = scenes::usual_rig();
  MarkerSigmas& sigmas = rig.instruments[0].marker.sigmas;
  sigmas.bands_upper_m = sigmas.bands_lower_m = std::array{1e-5, 1e-5, 1e-5};
  return rig;
}

// The usual rig with its registration off.
Rig moved_by(const Eigen::Vector3d& off_m) {
  Rig rig = scenes::usual_rig();
  rig.instruments[0].camera_from_rcm->translation += off_m;
  return rig;
}

const effects::CameraEffects sharpened{.sharpening = 0.9, .sharpening_px = 1.3};

std::vector<JointVector> slow_motion(const Rig& rig, std::uint64_t seed, int frames) {
  Random random(seed);
  const JointVector start = scenes::random_configuration(rig, 0, random);
  std::vector<JointVector> motion;
  for (int i = 0; i < frames; ++i) {
    JointVector q = start;
    q.theta_rad += 0.004 * i, q.phi_rad -= 0.003 * i, q.rho_m += 0.3e-3 * i, q.psi_rad += 0.03 * i;
    motion.push_back(q);
  }
  return motion;
}

// A hand's motion: not even.
JointVector moving_from(const JointVector& start, double time_s) {
  JointVector q = start;
  const double wave = std::sin(3 * time_s);
  q.theta_rad += 0.07 * wave, q.phi_rad -= 0.05 * wave, q.rho_m += 0.02 * time_s, q.psi_rad += 0.8 * time_s;
  return q;
}

// As a rolling shutter shows the motion at a frame's time: strips of the image, exposed one after another.
cv::Mat rolled(const Rig& rig, const JointVector& start, double frame_s, std::uint64_t seed) {
  constexpr int strip_rows = 8, reach_px = 130;
  cv::Mat image = scenes::render(rig, {moving_from(start, frame_s)}, seed);
  const int middle = static_cast<int>(middle_px(rig, 0, moving_from(start, frame_s)).y());
  for (int row = std::max(0, middle - reach_px); row < std::min(image.rows, middle + reach_px); row += strip_rows) {
    const cv::Range rows(row, std::min(row + strip_rows, image.rows));
    const double at_s = frame_s + rig.camera.exposed_after_s((rows.start + rows.end - 1) / 2.0);
    scenes::render(rig, {moving_from(start, at_s)}, seed).rowRange(rows).copyTo(image.rowRange(rows));
  }
  return image;
}

TEST(SurfaceTracker, SeesMotionThroughARollingShutter) {
  double squares = 0;
  int told = 0;
  for (const double readout_s : {0.025, -0.02}) {
    Rig rig = scenes::usual_rig();
    rig.camera.readout_s = readout_s;
    Random random(readout_s > 0 ? 5 : 6);
    const JointVector start = scenes::random_configuration(rig, 0, random);
    SurfaceTracker tracker(rig, {.frame_budget = {}});
    for (int i = 0; i < 8; ++i) {
      const double frame_s = i / 30.0;
      const Observation seen = tracker.track(rolled(rig, start, frame_s, 10 * i), frame_s)[0];
      EXPECT_TRUE(i >= 3 || seen.status != Status::ok) << "its motion is not known";
      if (seen.status == Status::ok) squares += normalised_square(seen, moving_from(start, frame_s)), ++told;
    }
  }
  EXPECT_GE(told, 8);
  EXPECT_LT(squares / told, 4);
}

// A defocused image can't show that the camera sharpens, and the next one may start from its blur: they are less sure
// then, and those that follow are corrected again.
TEST(SurfaceTracker, RemembersThatTheCameraSharpens) {
  const Rig rig = measured_rig();  // else what is remembered of the print makes psi surer, too
  SurfaceTracker following(rig, {.frame_budget = {}}), anew(rig, {.single = true});
  const auto motion = slow_motion(rig, 4, 5);
  for (std::size_t i = 0; i < motion.size(); ++i) {
    SCOPED_TRACE("frame " + std::to_string(i));
    const bool can_not_tell = i == 2;
    RenderOptions options;
    if (can_not_tell) options.sensor.blur_px = 2.5;
    const cv::Mat image = effects::seen_through(sharpened, scenes::render(rig, {motion[i]}, i, options), rig.camera);
    const Observation followed = following.track(image)[0], found = anew.track(image)[0];
    ASSERT_EQ(followed.status, Status::ok);
    ASSERT_EQ(found.status, Status::ok);
    if (can_not_tell) {
      EXPECT_GT(followed.sigma_tau_rad, 1.2 * found.sigma_tau_rad);
    } else if (i != 3) {
      EXPECT_LT(normalised_square(found, followed.rcm->q), 0.05);
      EXPECT_NEAR(followed.sigma_tau_rad, found.sigma_tau_rad, 0.1 * found.sigma_tau_rad);
    }
  }
}

TEST(SurfaceTracker, NoticesAtOnceThatTheCameraSharpens) {
  constexpr std::size_t switched_on = 4;
  const Rig rig = scenes::usual_rig();
  SurfaceTracker following(rig, {.frame_budget = {}}), anew(rig, {.single = true});
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    following.forget();
    const auto motion = slow_motion(rig, seed, 6);
    for (std::size_t i = 0; i < motion.size(); ++i) {
      const cv::Mat plain = scenes::render(rig, {motion[i]}, i);
      const cv::Mat image = i < switched_on ? plain : effects::seen_through(sharpened, plain, rig.camera);
      const Observation followed = following.track(image)[0], found = anew.track(image)[0];
      ASSERT_EQ(followed.status, Status::ok);
      EXPECT_LT(normalised_square(found, followed.rcm->q), 0.1) << "frame " << i;
      EXPECT_LT(followed.sigma_tau_rad, 1.5 * found.sigma_tau_rad) << "frame " << i;
    }
  }
}

TEST(SurfaceTracker, FindsAnInstrumentThatJumps) {
  const Rig rig = scenes::usual_rig();
  SurfaceTracker tracker(rig, {.frame_budget = {}});
  for (const std::uint64_t seed : {2, 1, 4, 3, 6, 5}) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    if (seed % 2 == 0) tracker.forget();
    expect_right(tracker.track(usual_shot(seed).bgr)[0], usual_shot(seed).q);
  }
}

TEST(SurfaceTracker, InstrumentsKeepTheirNamesInAnyOrderOfTheRig) {
  const Rig rig = scenes::usual_rig(3);
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const auto q = apart(rig, random);
    const cv::Mat image = scenes::render(rig, q, seed);
    for (const std::array<std::size_t, 3>& order : {std::array<std::size_t, 3>{0, 1, 2}, {2, 0, 1}, {1, 0, 2}}) {
      Rig shuffled = rig;
      for (std::size_t i = 0; i < 3; ++i) shuffled.instruments[i] = rig.instruments[order[i]];
      const auto observations = SurfaceTracker(shuffled, {.single = true}).track(image);
      for (std::size_t i = 0; i < 3; ++i) expect_right(observations[i], q[order[i]]);
    }
    // One of them gone: its place stays empty, whatever the others show.
    const cv::Mat without = scenes::render(rig, {q[0], q[1]}, seed);
    const auto observations = SurfaceTracker(rig, {.single = true}).track(without);
    for (std::size_t i = 0; i < 2; ++i) expect_right(observations[i], q[i]);
    EXPECT_NE(observations[2].status, Status::ok);
  }
}

// The camera was moved after registration, or this is another room's rig: what is said of q says how far to trust
// it, or is not said; what needs no registration stays right.
TEST(SurfaceTracker, AWrongRegistrationIsNoWrongRotation) {
  int seen = 0, with_q = 0;
  scenes::for_each_shot(10, [&](const Shot& shot) {
    Random random(shot.seed);
    const CentreLine line = shot.line();
    for (const double shift_m : {0.01, 0.04}) {
      const Observation o = Tracker(moved_by(shift_m * testing::random_direction(random))).track(shot.bgr)[0];
      if (o.status != Status::ok) continue;
      ++seen;
      EXPECT_LT(std::abs(wrap_pi(o.tau_rad - line.tau_rad)), std::max(0.05, 5 * o.sigma_tau_rad)) << shift_m;
      EXPECT_LT((o.edges_ideal_px[0] - line.ideal_px[0]).norm(), 1.5) << shift_m;
      EXPECT_LT((o.edges_ideal_px[3] - line.ideal_px[3]).norm(), 1.5) << shift_m;
      with_q += o.rcm.has_value();
    }
  });
  EXPECT_GE(seen, 16);
  EXPECT_LT(with_q, seen);
}

// The trocar slipped by 4 mm, and comes back.
TEST(SurfaceTracker, ARegistrationThatTheShaftAgreesWithAgainIsTakenUpAgain) {
  const Rig rig = scenes::usual_rig();
  int dropped = 0;
  scenes::for_each_shot(6, [&](const Shot& shot) {
    Tracker tracker(rig);
    bool was_dropped = false;
    std::uint64_t noise = 100 * shot.seed;
    for (const double slip_m : {4e-3, 4e-3, 4e-3, 3e-3, 2e-3, 1e-3, 0.0}) {
      const Rig slipped = moved_by(slip_m * Eigen::Vector3d(0.6, 0.8, 0));
      const auto q = configuration_of(scenes::pose_of(rig, 0, shot.q), *slipped.instruments[0].camera_from_rcm);
      const cv::Mat bgr = scenes::render(slipped, {*q}, ++noise);
      const Observation o = tracker.track(bgr)[0];
      was_dropped |= o.status == Status::ok && (!o.rcm || o.rcm->covariance(0, 0) > 1e-4);
      if (slip_m > 0) continue;
      expect_right(o, shot.q);
      const Observation anew = Tracker(rig).track(bgr)[0];
      ASSERT_TRUE(anew.rcm);
      EXPECT_LT(o.rcm->covariance.trace(), 1.5 * anew.rcm->covariance.trace());
    }
    dropped += was_dropped;
  });
  EXPECT_GE(dropped, 3) << "the test's own power";
}

TEST(SurfaceTracker, BandsThatTheMarkerHasAtNoAzimuthAreAMismatch) {
  Rig other = scenes::usual_rig();
  Marker& marker = other.instruments[0].marker;
  const double length_m = marker.length_m();
  marker.bands_upper_m = {0.1 * length_m, 0.3 * length_m, 0.6 * length_m};
  marker.bands_lower_m = {0.2 * length_m, 0.6 * length_m, 0.2 * length_m};
  scenes::for_each_shot(8, [&](const Shot& shot) {
    for (const Rig& rig : {other, scenes::without_rcm(other)})
      EXPECT_EQ(to_string(Tracker(rig).track(shot.bgr)[0].status), "marker_mismatch");
  });
}

// Two equal prints of which now one, now the other is the larger blob: of each a frame with its distal end hidden.
std::vector<cv::Mat> rivals_that_change_places(const Rig& both, Random& random, std::uint64_t seed) {
  constexpr int half_px = 20;
  for (;;) {
    const auto q = apart(both, random);
    const auto place_px = [&](std::size_t i, double along_m) {
      return both.camera.raw_from_point(scenes::pose_of(both, i, q[i]).camera_from_unrolled *
                                        Eigen::Vector3d(0, 0, along_m));
    };
    const cv::Mat frame = scenes::render(both, q, seed);
    std::vector<cv::Mat> frames;
    std::vector<bool> first_is_larger;
    for (std::size_t hidden = 0; hidden < 2; ++hidden) {
      const Eigen::Vector2d end_px = place_px(hidden, both.instruments[0].marker.length_m());
      const cv::Rect drop(cvRound(end_px.x()) - half_px, cvRound(end_px.y()) - half_px, 2 * half_px, 2 * half_px);
      frames.push_back(frame.clone());
      frames.back()(drop & cv::Rect({}, frame.size())).setTo(cv::Scalar(60, 70, 160));
      const Blob blob = largest_blobs(ImageView(frames.back()), ColourClasses(both.instruments)).at(0);
      const Eigen::Vector2d at_px(blob.samples[0].u, blob.samples[0].v);
      first_is_larger.push_back((place_px(0, 0) - at_px).norm() < (place_px(1, 0) - at_px).norm());
    }
    if (first_is_larger[0] != first_is_larger[1]) return frames;
  }
}

// Without the RCM nothing says which of two prints is the instrument's, nor when the budget ends before both are looked
// at, and the next frame has them in another order.
TEST(SurfaceTracker, TwoOfTheSamePrintStayAmbiguousWithinAnyBudget) {
  Rig both = scenes::usual_rig(2);
  both.instruments[1].marker = both.instruments[0].marker;
  Random random(5);
  int candidates = 0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const auto frames = rivals_that_change_places(both, random, seed);
    for (const double frame_budget : {1, 1500, 3000, 5000}) {
      Tracker tracker(scenes::without_rcm(scenes::usual_rig()), {.frame_budget = frame_budget});
      for (std::size_t i = 0; i < 6; ++i) {
        const Status status = tracker.track(frames[i % 2])[0].status;
        EXPECT_NE(status, Status::ok) << seed << ", " << frame_budget << ", frame " << i;
        candidates += status == Status::ambiguous;
      }
    }
  }
  EXPECT_GE(candidates, 30) << "the test's own power";
}

// Nor does a marker that was found while the instrument's was hidden stay when that, which passes the RCM, shows again.
TEST(SurfaceTracker, OfTwoOfTheSamePrintTheOneThroughTheRcmCounts) {
  Rig both = scenes::usual_rig(2), other = both;
  both.instruments[1].marker = both.instruments[0].marker;
  other.instruments = {both.instruments[1]};
  int strayed = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    Random random(seed);
    const auto q = apart(both, random);
    const cv::Mat hidden = scenes::render(other, {q[1]}, seed), shows = scenes::render(both, q, seed);
    for (const double frame_budget : {1, 3000, 8000}) {
      Tracker tracker(scenes::usual_rig(), {.frame_budget = frame_budget});
      for (int i = 0; i < 20; ++i) tracker.track(hidden);
      strayed += tracker.track(hidden)[0].status == Status::ok;
      for (int i = 0; i < 5; ++i) tracker.track(shows);
      expect_right(tracker.track(shows)[0], q[0]);
    }
  }
  EXPECT_GE(strayed, 9) << "the test's own power";
}

// A rig a few millimetres off looks like a misprint: what needs no registration is given all the same.
TEST(SurfaceTracker, AContradictedRegistrationIsNoMismatchedMarkerWithinABudget) {
  int contradicted = 0;
  scenes::for_each_shot(6, [&](const Shot& shot) {
    Random random(shot.seed);
    const Rig moved = moved_by(3e-3 * testing::random_direction(random));
    const Status whole = Tracker(moved, {.single = true}).track(shot.bgr)[0].status;
    Tracker tracker(moved);
    Status status = tracker.track(shot.bgr)[0].status;
    for (int more = 0; more < 2 && status != whole; ++more) status = tracker.track(shot.bgr)[0].status;
    EXPECT_EQ(to_string(status), to_string(whole));
    contradicted += whole == Status::ok;
  });
  EXPECT_GE(contradicted, 4) << "the test's own power";
}

// An instrument that turns before a tracker of the rig's, with a print of its own.
struct TurningInstrument {
  Rig rig;
  Random random;
  JointVector q;
  Tracker tracker;
  double time_s = 0;

  TurningInstrument(const Rig& of_rig, std::uint64_t seed)
      : rig(of_rig), random(seed), q(scenes::random_configuration(rig, 0, random)), tracker(rig) {}
  // Frames that are ok, of so many, while it turns by as much each time.
  int found(const ShaftModel& shaft, int frames, double step_rad) {
    Renderer renderer = scenes::renderer_of(rig, shaft);
    int found = 0;
    for (int i = 0; i < frames; ++i, q.psi_rad += step_rad) {
      time_s += 0.04;
      const cv::Mat bgr = renderer.render({placement_of(rig.instruments[0], q)}, random.bits());
      const Observation seen = tracker.track(bgr, time_s)[0];
      if (seen.status != Status::ok) continue;
      ++found;
      EXPECT_LT(std::abs(psi_error_rad(seen, q)), std::min(0.01, 4 * std::sqrt(seen.rcm->covariance(3, 3))));
    }
    return found;
  }
  // With the boundary between the first two bands hidden all round.
  ShaftModel bloody() const {
    constexpr int drops = 90;
    constexpr double drop_radius_m = 1.2e-3;
    ShaftModel shaft = shaft_of(rig.instruments[0]);
    for (int i = 0; i < drops; ++i) {
      const double tau_rad = two_pi * i / drops;
      shaft.blotches.push_back({tau_rad, boundaries_m(shaft.marker, tau_rad)[1], drop_radius_m});
    }
    return shaft;
  }
};

// Where blood hides an inner boundary, a misprint would look like a turn: not one that was seen before, unless the
// instrument may have been exchanged since.
TEST(SurfaceTracker, APrintThatWasSeenIsTrustedUnderBlood) {
  constexpr int markers = 8, frames = 4;
  constexpr double step_rad = 0.1;
  const Rig rig = scenes::usual_rig();
  int found = 0, found_after = 0, found_exchanged = 0;
  for (std::uint64_t seed = 1; seed <= markers; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    TurningInstrument unseen(rig, seed), seen(rig, seed), exchanged(rig, seed);
    found += unseen.found(unseen.bloody(), frames, step_rad);
    for (TurningInstrument* instrument : {&seen, &exchanged})
      EXPECT_EQ(instrument->found(shaft_of(rig.instruments[0]), frames, step_rad), frames);
    found_after += seen.found(seen.bloody(), frames, step_rad);
    exchanged.time_s += 3;
    found_exchanged += exchanged.found(exchanged.bloody(), frames, step_rad);
  }
  EXPECT_GE(found_after, 0.9 * markers * frames);
  EXPECT_LT(found_exchanged, 0.1 * markers * frames);
  EXPECT_LT(found, 0.1 * markers * frames) << "the test's own power";
}

TEST(SurfaceTracker, ADamagedFrameSaysNothingOfThePrint) {
  constexpr double step_rad = 0.35;
  const Rig rig = scenes::usual_rig();
  const ShaftModel exact = shaft_of(rig.instruments[0]);
  ShaftModel off = exact;
  off.marker.bands_upper_m[0] += 3e-4, off.marker.bands_upper_m[2] -= 3e-4;
  TurningInstrument instrument(rig, 3);
  EXPECT_EQ(instrument.found(off, 4, step_rad), 0);
  instrument.tracker.refuse(Status::damaged);
  EXPECT_EQ(instrument.found(exact, 1, step_rad), 0);
  instrument.tracker.reset();
  EXPECT_EQ(instrument.found(exact, 1, step_rad), 1);
}

// Strips of two of the marker's colours, as many as it takes for a search to outlast its budget.
cv::Mat with_strips(cv::Mat image, const Marker& marker) {
  constexpr int width = 160, height = 26;
  for (int k = 0; k < 8; ++k) {
    cv::Mat hsv(height, width, CV_8UC3), strip;
    for (int x = 0; x < width; ++x)
      hsv.col(x).setTo(cv::Scalar(marker.hues_deg[static_cast<std::size_t>(2 * x / width + k) % 3] / 2, 200, 180));
    cv::cvtColor(hsv, strip, cv::COLOR_HSV2BGR);
    strip.copyTo(image(cv::Rect(60 + (k % 4) * 220, 80 + (k / 4) * 250, width, height)));
  }
  return image;
}

// An ok is not kept in a frame without it, however far the search for it comes.
TEST(SurfaceTracker, WhatIsLostIsNotOkWhileItIsLookedFor) {
  int lost = 0;
  for (const std::size_t instruments : {1U, 2U})
    for (const bool registered : {true, false}) {
      Rig rig = scenes::usual_rig(instruments);
      Random random(1);
      const cv::Mat there = scenes::render(rig, scenes::random_configurations(rig, random), 1);
      const cv::Mat gone = with_strips(scenes::render_nothing(rig, 1), rig.instruments[0].marker);
      if (!registered) rig = scenes::without_rcm(rig);
      for (const double frame_budget : {1, 1500, 4000, 8000}) {
        Tracker tracker(rig, {.frame_budget = frame_budget});
        for (int i = 0; i < 3; ++i) tracker.track(there);
        const std::vector<Observation> before = tracker.track(there);
        for (int i = 0; i < 3; ++i) {
          const auto& after = tracker.track(gone);
          for (std::size_t k = 0; k < instruments; ++k) {
            EXPECT_TRUE(after[k].status != Status::ok || after[k].marker) << frame_budget << ", frame " << i;
            lost += before[k].status == Status::ok && after[k].status != Status::ok;
          }
        }
      }
    }
  EXPECT_GE(lost, 40) << "the test's own power";
}

// Frames with a budget find together what one frame's long search finds, and in the same frames each time.
TEST(SurfaceTracker, SpreadsALongSearchOverFrames) {
  const Rig rig = measured_rig();
  constexpr double frame_budget = 6000;
  constexpr int frames = 40;
  int found = 0, later = 0;
  for (std::uint64_t seed = 5; seed <= 6; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const scenes::BloodyMotion motion(rig, 0.6, seed, frames);
    if (SurfaceTracker(rig, {.single = true}).track(motion.frames[0])[0].status != Status::ok) continue;
    ++found;
    SurfaceTracker tracker(rig, {.frame_budget = frame_budget}), again(rig, {.frame_budget = frame_budget});
    int first = -1;
    for (int i = 0; i < frames && (first < 0 || i <= first + 1); ++i) {
      const auto frame = static_cast<std::size_t>(i);
      const Observation o = tracker.track(motion.frames[frame])[0], same = again.track(motion.frames[frame])[0];
      EXPECT_EQ(o.status, same.status);
      if (first < 0 && o.status == Status::ok) first = i;
      if (o.status != Status::ok) continue;
      EXPECT_EQ(o.rcm.value().q.vector(), same.rcm.value().q.vector());
      expect_right(o, motion.q[frame]);
    }
    EXPECT_GE(first, 0);
    later += first > 0;
  }
  EXPECT_EQ(found, 2);
  EXPECT_GE(later, 1) << "the test's own power";
}

// Whatever else is searched for, what shows plainly is found in the frame in which it appears.
TEST(SurfaceTracker, FindsWhatShowsPlainlyDuringALongSearch) {
  const Rig rig = scenes::usual_rig();
  int searched = 0;
  scenes::for_each_shot(4, [&](const Shot& shot) {
    const scenes::BloodyMotion hidden(rig, 1.3, shot.seed, 3);
    SurfaceTracker tracker(rig, {.frame_budget = 6000});
    for (const cv::Mat& frame : hidden.frames) searched += tracker.track(frame)[0].status != Status::ok;
    expect_right(tracker.track(shot.bgr)[0], shot.q);
  });
  EXPECT_GE(searched, 6);
}

// A temporary has no frames to come.
TEST(Tracker, SearchesTheOnlyFrameOfATemporaryWhole) {
  const Rig rig = measured_rig();
  int found = 0;
  for (std::uint64_t seed = 5; seed <= 6; ++seed) {
    const scenes::BloodyMotion motion(rig, 0.6, seed, 1);
    const cv::Mat& frame = motion.frames[0];
    const Status whole = SurfaceTracker(rig, {.single = true}).track(frame)[0].status;
    EXPECT_EQ(Tracker(rig, {.frame_budget = 1}).track(frame)[0].status, whole) << "seed " << seed;
    found += whole == Status::ok;
  }
  EXPECT_EQ(found, 2);
}

// The image shows psi's mean over the exposure.
TEST(SurfaceTracker, ATurnWithinTheExposureGivesPsiOfItsMiddle) {
  double squares = 0, from_rest_squares = 0;
  scenes::for_each_shot(3, [&](const Shot& shot) {
    for (const double turn_rad : {0.1, -0.25, 0.3}) {
      SCOPED_TRACE("turn " + std::to_string(turn_rad));
      const Observation even =
          Tracker(shot.rig).track(scenes::render_moving(shot.rig, shot.q, {.turn_rad = turn_rad}))[0];
      expect_right(even, shot.q);
      const double error_rad = psi_error_rad(even, shot.q);
      squares += error_rad * error_rad / even.rcm->covariance(3, 3) / 9;
      // Its mean is a twelfth of the turn from its middle, and what an edge fit makes of it no farther.
      const Observation from_rest = Tracker(shot.rig).track(
          scenes::render_moving(shot.rig, shot.q, {.turn_rad = turn_rad, .from_rest = true}))[0];
      ASSERT_EQ(to_string(from_rest.status), "ok");
      const double from_rest_rad = psi_error_rad(from_rest, shot.q);
      EXPECT_LT(std::abs(from_rest_rad), std::abs(turn_rad) / 12 + 0.002);
      from_rest_squares += from_rest_rad * from_rest_rad / from_rest.rcm->covariance(3, 3) / 9;
    }
  });
  EXPECT_LT(std::sqrt(squares), 1.5);
  EXPECT_LT(std::sqrt(from_rest_squares), 1.5);
}

// One that turns on evenly has no more sigma than one that stands still, whatever frames were dropped; one that was at
// rest has.
TEST(SurfaceTracker, TellsAnEvenTurnFromAStartByTheFramesBefore) {
  constexpr double turn_rad = 0.1, period_s = 0.04;
  const Shot& shot = usual_shot(2);
  const auto sigma_of_third_frame = [&](bool even, int dropped) {
    Tracker tracker(shot.rig);
    for (int before = 2; before > 0; --before) {
      const int periods = before + dropped;
      JointVector q = shot.q;
      q.psi_rad -= even ? turn_rad * periods : turn_rad / 4;  // of which it has come so far in the middle
      tracker.track(scenes::render_moving(shot.rig, q, {.turn_rad = even ? turn_rad : 0}), -periods * period_s);
    }
    const cv::Mat third = scenes::render_moving(shot.rig, shot.q, {.turn_rad = turn_rad, .from_rest = !even});
    return std::sqrt(tracker.track(third, 0)[0].rcm.value().covariance(3, 3));
  };
  for (const int dropped : {0, 1, 2}) EXPECT_LT(sigma_of_third_frame(true, dropped), 0.003) << dropped;
  EXPECT_GT(sigma_of_third_frame(false, 0), 0.005);
}

// A recorder adds to each frame a share of the one before.
TEST(SurfaceTracker, FramesOfTwoMomentsAreNotTaken) {
  const Rig rig = scenes::usual_rig();
  constexpr int frames = 24;
  int blended = 0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed)
    for (const double share : {0.0, 0.2, 0.4, 0.5}) {
      SCOPED_TRACE("seed " + std::to_string(seed) + ", of the frame before " + std::to_string(share));
      Random random(seed);
      const JointVector start = scenes::random_configuration(rig, 0, random);
      SurfaceTracker tracker(rig, {.frame_budget = {}});
      cv::Mat before;
      for (int i = 0; i < frames; ++i) {
        JointVector q = start;
        q.theta_rad += 0.1 * std::sin(0.5 * i), q.psi_rad += 0.6 * std::sin(0.4 * i);
        const cv::Mat frame = scenes::render(rig, {q}, seed + static_cast<std::uint64_t>(i));
        cv::Mat sum = frame;
        if (share > 0 && i > 0) cv::addWeighted(frame, 1 - share, before, share, 0, sum);
        before = frame;
        const Observation o = tracker.track(sum)[0];
        if (share > 0)
          blended += o.status == Status::blended;
        else
          EXPECT_EQ(o.status, Status::ok) << i << " " << to_string(o.status);
        // In the second frame the marker may be taken for unmoved: only a step that was seen shows two moments.
        if (o.status == Status::ok && i > 1) {
          EXPECT_LT(std::abs(psi_error_rad(o, q)), Observation::false_rad) << i;
        }
      }
    }
  EXPECT_GT(blended, 3 * 3 * frames / 3);  // others are refused for what adding does to them
}

// A rig whose instrument comes along the image's lower or right border, and the planes through the camera and it.
struct BesideBorder {
  Rig rig = scenes::usual_rig();
  Eigen::Vector3d border;   // of the image in the camera's frame, at depth 1
  Eigen::Vector3d outside;  // across it

  explicit BesideBorder(bool right) : outside(right ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY()) {
    const Camera& camera = rig.camera;
    border = {right ? (camera.width_px - camera.cx_px) / camera.fx_px : 0,
              right ? 0 : (camera.height_px - camera.cy_px) / camera.fy_px, 1};
    const Eigen::Vector3d rcm = 0.09 * border + Eigen::Vector3d(right ? 0 : -0.1, right ? -0.09 : 0, 0);
    rig.instruments[0].camera_from_rcm = Rigid3{rotation_between(Eigen::Vector3d::UnitX(), 0.1 * border - rcm), rcm};
  }
  // The proximal end, so far along the border, the axis so far outside of it.
  JointVector at(double depth_m, double along_m, double outside_m) const {
    const Eigen::Vector3d along = Eigen::Vector3d::UnitZ().cross(outside).cwiseAbs();
    const Eigen::Vector3d place = depth_m * border + along_m * along + outside_m * outside;
    return configuration_through(*rig.instruments[0].camera_from_rcm, place).value();
  }
};

// One occluding contour and parts of all boundaries show.
TEST(SurfaceTracker, FindsAShaftThatIsHalfOutOfTheFrame) {
  int found = 0, all = 0;
  double sum = 0, squares = 0, normalised = 0;
  for (const bool right : {false, true}) {
    const BesideBorder place(right);
    Renderer renderer = scenes::renderer_of(place.rig, shaft_of(place.rig.instruments[0]));
    Random random(right ? 7 : 8);
    for (int i = 0; i < 20; ++i, ++all) {
      SCOPED_TRACE((right ? "right " : "lower ") + std::to_string(i));
      const double depth_m = random.uniform(0.085, 0.115), along_m = random.uniform(-0.028, 0);
      JointVector q = place.at(depth_m, along_m, random.uniform(-1.5e-3, 1e-3));
      q.psi_rad = random.uniform(-pi, pi);
      const Observation o = Tracker(place.rig).track(
          renderer.render({placement_of(place.rig.instruments[0], q)}, static_cast<std::uint64_t>(i)))[0];
      if (o.status != Status::ok) continue;
      const double error_rad = psi_error_rad(o, q);
      EXPECT_LT(std::abs(error_rad), 0.05);
      ++found, sum += error_rad, squares += error_rad * error_rad;
      normalised += error_rad * error_rad / o.rcm->covariance(3, 3);
    }
  }
  EXPECT_GE(found, 0.95 * all);
  EXPECT_LT(std::sqrt(squares / found - sum * sum / found / found), 0.006);
  EXPECT_LT(std::sqrt(normalised / found), 1.5);
}

}  // namespace lapservo::internal::surface_tracker_test
