// camera_effects [POSES [SEED [CONDITION...]]]: how well and how honestly the tracker does on pictures as cameras give
// them, rendered; a row of docs/notes/accuracy.md for each condition, with the camera as calibration would have it and
// as if nobody had calibrated. A condition's strength is drawn anew for every frame. h264 is a marker in motion,
// tracked, as a recorder keeps it. LAPSERVO_OFF=1: each frame's print is off in its bands, 2: in an ink that lies aside
// (random_print.h). LAPSERVO_BLOOD: so much of the marker is hidden [%]. With "samples" for POSES it looks at the
// ray-traced samples of rotation, illumination and tilt, where they are there (frame_sets.h).
#include "lapservo/testing/camera_effects.h"

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "acceptance/frame_sets.h"
#include "acceptance/random_print.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"
#include "lapservo/marker/decoder.h"

namespace {
using namespace lapservo;
using namespace lapservo::acceptance;
using namespace lapservo::internal;

constexpr double steepest_rad = 0.35;

void print_row(const std::string& name, const Score& s) {
  const auto mrad = [](double rad) { return 1e3 * rad; };
  std::printf(
      "| %s | %d | %.0f %% | %+.2f | %.2f | %.2f | %.2f | %.2f, %.2f | %.3f | %.3f | %.2f | %.2f, %.2f, %.2f | %d |\n",
      name.c_str(), s.expected, 100 * s.found_fraction(), mrad(mean(s.psi_rad)), mrad(standard_deviation(s.psi_rad)),
      mrad(rms(s.psi_rad)), mrad(largest(s.psi_rad)), mrad(rms(s.theta_rad)), mrad(rms(s.phi_rad)), 1e3 * rms(s.rho_m),
      rms(s.edge_px), rms(s.psi_sigmas), rms(s.theta_sigmas), rms(s.phi_sigmas), rms(s.rho_sigmas), s.wrong);
  std::fflush(stdout);
}

// Of a print each, off as LAPSERVO_OFF says, which the tracker takes for the rig's. Its seam's error shows in no
// picture.
std::vector<TrueFrame> frames_of_off_prints(const RenderedSet& all, Off off) {
  std::vector<TrueFrame> frames;
  for (const auto& q : all.configurations) {
    RenderedSet one = all;
    one.configurations = {q};
    one.seed = 100'000 * all.seed + frames.size();
    Random random(one.seed);
    Marker& marker = one.rig.instruments[0].marker;
    marker = off_print(marker, off, random);
    TrueFrame frame = rendered_frames(one)[0];
    frame.rig = all.rig;
    frame.truths[0].q.psi_rad += marker.seam_rad - all.rig.instruments[0].marker.seam_rad;
    frames.push_back(std::move(frame));
  }
  return frames;
}

Off how_prints_are_off() {
  return static_cast<Off>(from_environment("LAPSERVO_OFF", 0));
}

// With prints that are off, it is the rig that is.
std::vector<TrueFrame> ray_traced_frames(std::uint64_t seed) {
  std::vector<TrueFrame> frames;
  Random random(seed);
  for (const char* set : {"rotation", "illumination", "tilt"})
    for (TrueFrame& frame : sample_frames(set)) {
      Marker& marker = frame.rig.instruments[0].marker;
      const Marker printed = marker;
      do marker = off_print(printed, how_prints_are_off(), random);
      while (!decoding_problem(marker).empty());
      frame.truths[0].q.psi_rad += printed.seam_rad - marker.seam_rad;
      frames.push_back(std::move(frame));
    }
  return frames;
}

std::vector<TrueFrame> still_frames(int poses, std::uint64_t seed) {
  RenderedSet set;
  set.rig = example_rig();
  set.configurations = random_configurations(set.rig, poses, seed, steepest_rad);
  set.seed = seed;
  set.blood = from_environment("LAPSERVO_BLOOD", 0) / 100.0;
  const Off off = how_prints_are_off();
  return off == Off::nowhere ? rendered_frames(set) : frames_of_off_prints(set, off);
}

void score_condition(const std::string& condition, const std::vector<TrueFrame>& frames, std::uint64_t seed) {
  Score calibrated, uncalibrated;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const effects::CameraEffects drawn = effects::draw(condition, seed * 1000 + i);
    TrueFrame frame = frames[i];
    frame.bgr = effects::seen_through(drawn, frames[i].bgr, frame.rig.camera);
    const auto add = [&](Score& score) {
      score.add(frame, Tracker(frame.rig, {.method = Method::surface, .single = true}).track(frame.bgr));
    };
    add(uncalibrated);
    frame.rig.camera = effects::calibrated(drawn, frame.rig.camera);
    add(calibrated);
  }
  const bool calibration_tells =
      condition == "ca" || condition == "rec709" || condition == "tone" || condition == "camera";
  print_row(condition, calibrated);
  if (calibration_tells) print_row(condition + ", uncalibrated", uncalibrated);
}

// To and fro between two poses, through libavcodec.
void score_video(int poses, std::uint64_t seed) {
  constexpr int frames_each = 30;
  Score score;
  for (int i = 0; i * frames_each < poses; ++i) {
    RenderedSet set;
    set.rig = example_rig();
    set.seed = seed + static_cast<std::uint64_t>(i);
    const auto ends = random_configurations(set.rig, 2, set.seed, steepest_rad);
    const Eigen::Vector4d from = ends[0][0].vector(), to = ends[1][0].vector();
    for (int k = 0; k < frames_each; ++k)
      set.configurations.push_back(
          {JointVector::from_vector(from + (to - from) * (0.5 - 0.5 * std::cos(two_pi * k / frames_each)) / 4)});
    auto frames = rendered_frames(set);
    compress(frames);
    Tracker tracker(set.rig);
    for (const TrueFrame& frame : frames) score.add(frame, tracker.track(frame.bgr));
  }
  print_row("h264", score);
}

}  // namespace

int main(int argc, char** argv) {
  const bool of_samples = argc > 1 && std::string(argv[1]) == "samples";
  const int poses = argc > 1 ? std::atoi(argv[1]) : 30;
  const auto seed = static_cast<std::uint64_t>(argc > 2 ? std::atoll(argv[2]) : 1);
  std::vector<std::string> conditions(argv + std::min(argc, 3), argv + argc);
  if (conditions.empty()) {
    conditions = effects::conditions();
    if (!of_samples) conditions.push_back("h264");
  }
  std::puts(
      "| set | instruments | found | psi mean [mrad] | std | rms | largest | theta, phi rms [mrad] | rho rms [mm] | "
      "e0..e3 rms [px] | z | z of theta, phi, rho | wrong |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
  const auto frames = of_samples ? ray_traced_frames(seed) : still_frames(poses, seed);
  for (const std::string& condition : conditions)
    condition == "h264" ? score_video(poses, seed) : score_condition(condition, frames, seed);
}
