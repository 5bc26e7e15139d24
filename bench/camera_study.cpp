#include <cmath>
#include <optional>

#include <opencv2/core.hpp>

#include "bench/accuracy_study.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"
#include "lapservo/marker/decoder.h"
#include "lapservo/testing/camera_effects.h"

namespace lapservo::bench {
namespace {
using namespace acceptance;
using namespace internal;

constexpr double steepest_rad = 0.35;

Off how_prints_are_off() {
  return static_cast<Off>(from_environment("LAPSERVO_OFF", 0));
}

// Frames of one print each, whose rig has the tracker's print.
std::vector<TrueFrame> frames_of_off_prints(const RenderedSet& all, Off off) {
  std::vector<TrueFrame> frames;
  for (const auto& q : all.configurations) {
    RenderedSet one = all;
    one.configurations = {q};
    one.seed = 100'000 * all.seed + frames.size();
    Random random(one.seed);
    Marker& marker = one.rig.instruments[0].marker;
    marker = off_print(marker, off, random);
    frames.push_back(rendered_frames(one)[0]);
    take_print_for(frames.back(), all.rig.instruments[0].marker);
  }
  return frames;
}

std::vector<TrueFrame> still_frames(int count, std::uint64_t seed) {
  RenderedSet set;
  set.rig = example_rig();
  set.configurations = random_configurations(set.rig, count, seed, steepest_rad);
  set.seed = seed;
  set.blood = from_environment("LAPSERVO_BLOOD", 0) / 100.0;
  const Off off = how_prints_are_off();
  return off == Off::nowhere ? rendered_frames(set) : frames_of_off_prints(set, off);
}

// With misprinted markers, the rig is the wrong one.
std::vector<TrueFrame> ray_traced_frames(int most, std::uint64_t seed) {
  std::vector<TrueFrame> frames;
  Random random(seed);
  for (const char* set : {"rotation", "illumination", "tilt"})
    for (TrueFrame& frame : sample_frames(set)) {
      const Marker printed = frame.rig.instruments[0].marker;
      Marker marker;
      do marker = off_print(printed, how_prints_are_off(), random);
      while (!decoding_problem(marker).empty());
      take_print_for(frame, marker);
      frames.push_back(std::move(frame));
    }
  frames.resize(std::min(frames.size(), static_cast<std::size_t>(most)));
  return frames;
}

using Frames = std::vector<TrueFrame> (*)(int, std::uint64_t);

std::vector<Row> rows_of(Frames frames_of) {
  std::vector<Row> rows;
  for (const std::string& condition : effects::conditions())
    for (const bool calibrated : {true, false}) {
      const bool calibration_tells =
          condition == "ca" || condition == "rec709" || condition == "tone" || condition == "camera";
      if (!calibrated && !calibration_tells) continue;
      rows.push_back({condition + (calibrated ? "" : "_uncalibrated"), [=](int count, std::uint64_t seed) {
                        Score score;
                        std::uint64_t of_frame = seed * 1000;
                        for (TrueFrame& frame : frames_of(count, seed)) {
                          const effects::CameraEffects drawn = effects::draw(condition, of_frame++);
                          frame.bgr = effects::seen_through(drawn, frame.bgr, frame.rig.camera);
                          if (calibrated) frame.rig.camera = effects::calibrated(drawn, frame.rig.camera);
                          score_alone(frame, score);
                        }
                        return score;
                      }});
    }
  return rows;
}

// To and fro between two poses, over a part of the way, through libavcodec or added to a share of the frame before.
Score score_video(double part, std::optional<Encoder> encoder, int count, std::uint64_t seed) {
  constexpr int frames_each = 30;
  constexpr double of_last = 0.4;
  Score score;
  for (int i = 0; i * frames_each < count; ++i) {
    RenderedSet set;
    set.rig = example_rig();
    set.seed = seed + static_cast<std::uint64_t>(i);
    const auto ends = random_configurations(set.rig, 2, set.seed, steepest_rad);
    const Eigen::Vector4d from = ends[0][0].vector(), to = ends[1][0].vector();
    for (int k = 0; k < frames_each; ++k)
      set.configurations.push_back(
          {JointVector::from_vector(from + (to - from) * (0.5 - 0.5 * std::cos(two_pi * k / frames_each)) * part)});
    auto frames = rendered_frames(set);
    if (encoder) compress(frames, *encoder);
    for (std::size_t k = frames.size(); !encoder && k-- > 1;)
      cv::addWeighted(frames[k].bgr, 1 - of_last, frames[k - 1].bgr, of_last, 0, frames[k].bgr);
    Tracker tracker(set.rig);
    for (const TrueFrame& frame : frames) score.add(frame, tracker.track(frame.bgr));
  }
  return score;
}

}  // namespace

std::vector<Row> camera_rows() {
  std::vector<Row> rows = rows_of(still_frames);
  constexpr double slow = 0.25, fast = 1;
  const auto add_video = [&](const std::string& name, double part, std::optional<Encoder> encoder) {
    rows.push_back({name, [=](int count, std::uint64_t seed) { return score_video(part, encoder, count, seed); }});
  };
  add_video("h264", slow, Encoder::opencv);
  add_video("x265", slow, Encoder::x265);
  add_video("x265_rgb", slow, Encoder::x265_rgb);
  add_video("blended", fast, std::nullopt);
  return rows;
}

std::vector<Row> samples_rows() {
  return rows_of(ray_traced_frames);
}

}  // namespace lapservo::bench
