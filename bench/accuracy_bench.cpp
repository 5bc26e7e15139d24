// accuracy_bench [POSES [SEED...]]: the roll about the shaft's axis by lapservo's marker and by bundles of AprilTags
// and of ArUco tags on a film of the same size, rendered at the same poses with the same light, lens and noise: rows of
// docs/comparison.md. Each bundle's layout and settings are those with the smallest error on poses of another seed.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "acceptance/frame_sets.h"
#include "bench/tag_bundle.h"
#include "bench/tag_detectors.h"
#include "lapservo/core/angles.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/tissue.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::bench {
namespace {
using namespace internal;
using acceptance::example_rig;
using acceptance::random_configurations;

constexpr std::uint64_t tuning_seed = 900, background_seed = 7;
constexpr int tuning_poses = 20;
constexpr double wrong_rad = 0.1, usual_lean_rad = 0.35;

struct Scene {
  Rig rig;
  JointVector q;
  std::uint64_t noise;

  Rigid3 camera_from_marker() const {
    const Instrument& instrument = rig.instruments[0];
    return lapservo::camera_from_marker(instrument.marker, *instrument.camera_from_rcm, q);
  }
};

std::vector<Scene> scenes(int count, std::uint64_t seed, double steepest_rad) {
  const Rig rig = example_rig();
  std::vector<Scene> all;
  for (const auto& configuration : random_configurations(rig, count, seed, steepest_rad))
    all.push_back({rig, configuration[0], seed * 1000 + all.size()});
  return all;
}

template <typename Take>
void render_each(const std::vector<Scene>& all, const PrintedCells& print, const Take& take) {
  const Rig& rig = all[0].rig;
  ShaftModel shaft = shaft_of(rig.instruments[0]);
  shaft.cells = print;
  Renderer renderer(rig.camera, {shaft}, make_tissue(rig.camera.width_px, rig.camera.height_px, background_seed));
  for (const Scene& scene : all)
    take(scene, renderer.render({placement_of(scene.rig.instruments[0], scene.q)}, scene.noise));
}

// Undoes a camera's response: grey in linear light, as 8 bits of which the film's white takes nearly all.
cv::Mat linear_grey(const cv::Mat& bgr, const Camera& camera) {
  constexpr double gain = 1.6;
  const auto table = camera.response.table();
  cv::Mat grey(bgr.size(), CV_8UC1);
  for (int v = 0; v < bgr.rows; ++v)
    for (int u = 0; u < bgr.cols; ++u) {
      const auto& pixel = bgr.at<cv::Vec3b>(v, u);
      const double light = 0.114 * table[pixel[0]] + 0.587 * table[pixel[1]] + 0.299 * table[pixel[2]];
      grey.at<std::uint8_t>(v, u) = cv::saturate_cast<std::uint8_t>(255 * gain * light);
    }
  return grey;
}

cv::Mat encoded_grey(const cv::Mat& bgr, const Camera&) {
  cv::Mat grey;
  cv::cvtColor(bgr, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

using Grey = cv::Mat (*)(const cv::Mat&, const Camera&);

struct Score {
  std::vector<double> error_rad;
  int frames = 0, wrong = 0;
  double tags = 0;

  void add(const std::optional<Rigid3>& pose, const Scene& scene) {
    ++frames;
    if (!pose) return;
    error_rad.push_back(roll_between_rad(scene.camera_from_marker().rotation, pose->rotation));
    wrong += std::abs(error_rad.back()) > wrong_rad;
  }
  double found_percent() const { return 100.0 * static_cast<double>(error_rad.size()) / frames; }
  double rms_rad() const { return acceptance::rms(error_rad); }
  // Frames that are missing count as much as large errors do.
  double cost() const {
    double squares = (frames - static_cast<double>(error_rad.size())) * wrong_rad * wrong_rad;
    for (const double error : error_rad) squares += std::min(error * error, wrong_rad * wrong_rad);
    return squares / frames;
  }
};

void print_row(const std::string& name, const Score& score) {
  std::printf("| %s | %.0f %% | %+.2f | %.2f | %.1f | %d |\n", name.c_str(), score.found_percent(),
              1e3 * acceptance::mean(score.error_rad), 1e3 * score.rms_rad(),
              1e3 * acceptance::largest(score.error_rad), score.wrong);
  std::fflush(stdout);
}

// Frames as a bundle's detectors get them.
struct Prepared {
  TagBundle bundle;
  std::vector<cv::Mat> greys;
};

Prepared prepared(const std::vector<Scene>& all, const TagDictionary& dictionary, int around, Grey grey) {
  const Rig& rig = all[0].rig;
  Prepared of{TagBundle(rig.instruments[0].marker, dictionary.tags, around), {}};
  render_each(all, of.bundle.print(),
              [&](const Scene&, const cv::Mat& frame) { of.greys.push_back(grey(frame, rig.camera)); });
  return of;
}

Score score_bundle(const std::vector<Scene>& all, const Prepared& frames, const TagDetector& detector) {
  const Camera& camera = all[0].rig.camera;
  Score score;
  for (std::size_t i = 0; i < all.size(); ++i) {
    std::vector<FoundTag> found;
    for (const SeenTag& seen : detector.detect(frames.greys[i])) {
      if (seen.tag >= frames.bundle.size()) continue;
      FoundTag tag{seen.tag, {}};
      for (std::size_t k = 0; k < 4; ++k)
        tag.ideal_px[k] = camera.ideal_from_raw(seen.raw_px[k]).value_or(seen.raw_px[k]);
      found.push_back(tag);
    }
    score.tags += static_cast<double>(found.size());
    score.add(bundle_pose(frames.bundle, found, camera, detector.corners), all[i]);
  }
  return score;
}

struct LapservoScores {
  Score alone, registered;  // without and with camera_from_rcm
};

LapservoScores score_lapservo(const std::vector<Scene>& all) {
  const Rig registered = all[0].rig;
  Rig alone = registered;
  alone.instruments[0].camera_from_rcm.reset();
  LapservoScores scores;
  const auto score = [](const Rig& rig, const Scene& scene, const cv::Mat& frame, Score& into) {
    const Observation seen = Tracker(rig, {.single = true}).track(frame)[0];
    into.add(seen.status == Status::ok && seen.marker ? std::optional(seen.marker->camera_from_marker) : std::nullopt,
             scene);
  };
  render_each(all, {}, [&](const Scene& scene, const cv::Mat& frame) {
    score(alone, scene, frame, scores.alone);
    score(registered, scene, frame, scores.registered);
  });
  return scores;
}

struct Choice {
  std::string library;
  const TagDictionary* dictionary = nullptr;
  const TagDetector* detector = nullptr;
  int around = 0;

  std::string text() const { return fmt::format("{}, {} round, {}", dictionary->name, around, detector->settings); }
};

Choice best(const std::string& library, const std::vector<TagDictionary>& dictionaries,
            const std::vector<Scene>& tuning) {
  Choice best{library};
  double least = 0;
  for (const TagDictionary& dictionary : dictionaries)
    for (const int around : {6, 7, 8, 9, 10, 12, 14}) {
      const Prepared frames = prepared(tuning, dictionary, around, linear_grey);
      for (const TagDetector& detector : dictionary.detectors) {
        const Choice choice{library, &dictionary, &detector, around};
        const Score score = score_bundle(tuning, frames, detector);
        std::fprintf(stderr, "%s: %.0f %% found, roll %+.2f mrad, rms %.2f, %.1f tags a frame\n", choice.text().c_str(),
                     score.found_percent(), 1e3 * acceptance::mean(score.error_rad), 1e3 * score.rms_rad(),
                     score.tags / score.frames);
        if (!best.detector || score.cost() < least) least = score.cost(), best = choice;
      }
    }
  std::printf("%s: %s\n", library.c_str(), best.text().c_str());
  return best;
}

void compare(const std::vector<Scene>& all, double steepest_rad, const std::vector<Choice>& choices) {
  std::printf("\nThe shaft leans up to %.0f degrees, %zu frames:\n\n", deg_from_rad(steepest_rad), all.size());
  std::printf(
      "| | found | roll, mean [mrad] | rms | largest | beyond 0.1 rad |\n| --- | --- | --- | --- | --- | --- |\n");
  const LapservoScores ours = score_lapservo(all);
  print_row("lapservo", ours.alone);
  print_row("lapservo, camera_from_rcm known", ours.registered);
  for (const auto& [grey, suffix] :
       {std::pair<Grey, const char*>{linear_grey, ""}, {encoded_grey, ", sRGB left as it is"}})
    for (const Choice& choice : choices)
      print_row(choice.library + suffix,
                score_bundle(all, prepared(all, *choice.dictionary, choice.around, grey), *choice.detector));
}

int run(int poses, const std::vector<std::uint64_t>& seeds) {
  cv::setNumThreads(1);
  const auto tuning = scenes(tuning_poses, tuning_seed, usual_lean_rad);
  const std::vector<TagDictionary> april = april_tags(), aruco = aruco_tags();
  const std::vector<Choice> choices{best("a bundle of AprilTags", april, tuning),
                                    best("a bundle of ArUco tags", aruco, tuning)};
  for (const double steepest_rad : {usual_lean_rad, std::atan(1.2)}) {
    std::vector<Scene> all;
    for (const std::uint64_t seed : seeds)
      for (Scene& scene : scenes(poses, seed, steepest_rad)) all.push_back(std::move(scene));
    compare(all, steepest_rad, choices);
  }
  return 0;
}

}  // namespace
}  // namespace lapservo::bench

int main(int count, char** values) {
  const int poses = count > 1 ? std::atoi(values[1]) : 60;
  std::vector<std::uint64_t> seeds;
  for (int i = 2; i < count; ++i) seeds.push_back(std::strtoull(values[i], nullptr, 10));
  if (seeds.empty()) seeds = {1, 2};
  if (poses < 1) {
    std::fprintf(stderr, "accuracy_bench [POSES [SEED...]]\n");
    return 2;
  }
  return lapservo::bench::run(poses, seeds);
}
