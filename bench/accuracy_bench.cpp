// accuracy_bench [POSES [SEED...]]: the roll about the shaft's axis by lapservo's marker and by bundles of AprilTags
// and of ArUco tags on a film of the same size, rendered at the same poses with the same light, lens and noise: rows of
// docs/comparison.md. Each bundle's layout and settings are those with the smallest error on the poses of another seed.
#include <apriltag/apriltag.h>
#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h11.h>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <opencv2/aruco.hpp>
#include <opencv2/imgproc.hpp>

#include "acceptance/frame_sets.h"
#include "bench/tag_bundle.h"
#include "lapservo/core/angles.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/tissue.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::bench {
namespace {
using namespace internal;
using acceptance::example_rig;
using acceptance::random_configurations;

constexpr std::uint64_t tuning_seed = 900, background_seed = 7;
constexpr double wrong_rad = 0.1;

struct Scene {
  Rig rig;
  JointVector q;
  std::uint64_t noise;

  Rigid3 camera_from_marker() const {
    const Instrument& instrument = rig.instruments[0];
    return *instrument.camera_from_rcm * rcm_from_unrolled(q) *
           Rigid3{
               Eigen::Quaterniond(Eigen::AngleAxisd(q.psi_rad + instrument.marker.seam_rad, Eigen::Vector3d::UnitZ())),
               Eigen::Vector3d::Zero()};
  }
};

std::vector<Scene> scenes(int count, std::uint64_t seed, double steepest_rad) {
  const Rig rig = example_rig();
  std::vector<Scene> all;
  for (const auto& configuration : random_configurations(rig, count, seed, steepest_rad))
    all.push_back({rig, configuration[0], seed * 1000 + all.size()});
  return all;
}

// How a pose is turned about the true axis.
double roll_error_rad(const Rigid3& camera_from_marker, const Scene& scene) {
  const Eigen::Matrix3d off =
      (scene.camera_from_marker().rotation.conjugate() * camera_from_marker.rotation).toRotationMatrix();
  return std::atan2(off(1, 0) - off(0, 1), off(0, 0) + off(1, 1));
}

Renderer renderer_of(const Rig& rig, const PrintedCells& print) {
  ShaftModel shaft = shaft_of(rig.instruments[0]);
  shaft.cells = print;
  return Renderer(rig.camera, {shaft}, make_tissue(rig.camera.width_px, rig.camera.height_px, background_seed));
}

// What a camera's response did, undone: grey in linear light, as 8 bits.
cv::Mat linear_grey(const cv::Mat& bgr, const Camera& camera) {
  const auto table = camera.response.table();
  cv::Mat grey(bgr.size(), CV_8UC1);
  for (int v = 0; v < bgr.rows; ++v)
    for (int u = 0; u < bgr.cols; ++u) {
      const auto& pixel = bgr.at<cv::Vec3b>(v, u);
      const double light = 0.114 * table[pixel[0]] + 0.587 * table[pixel[1]] + 0.299 * table[pixel[2]];
      grey.at<std::uint8_t>(v, u) = cv::saturate_cast<std::uint8_t>(255 * light);
    }
  return grey;
}

cv::Mat encoded_grey(const cv::Mat& bgr, const Camera&) {
  cv::Mat grey;
  cv::cvtColor(bgr, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

using Grey = cv::Mat (*)(const cv::Mat&, const Camera&);
using Corners = std::array<Eigen::Vector2d, 4>;

struct Detector {
  std::string name;
  std::vector<TagCells> tags;
  std::function<std::vector<FoundTag>(const cv::Mat& grey)> detect;
};

using Family = std::shared_ptr<apriltag_family_t>;

// The library keeps its own to itself.
void free_image(image_u8_t* image) {
  std::free(image->buf);
  std::free(image);
}

std::vector<TagCells> cells_of(const Family& family) {
  std::vector<TagCells> tags;
  for (std::uint32_t i = 0; i < family->ncodes; ++i) {
    const std::unique_ptr<image_u8_t, decltype(&free_image)> image(apriltag_to_image(family.get(), static_cast<int>(i)),
                                                                   free_image);
    TagCells tag;
    tag.size = family->width_at_border;
    const int margin = (family->total_width - tag.size) / 2;
    for (int r = 0; r < tag.size; ++r)
      for (int c = 0; c < tag.size; ++c)
        tag.dark.push_back(image->buf[(r + margin) * image->stride + c + margin] < 128);
    tags.push_back(std::move(tag));
  }
  return tags;
}

Detector apriltag_detector(const std::string& name, const Family& family) {
  const std::shared_ptr<apriltag_detector_t> detector(apriltag_detector_create(), apriltag_detector_destroy);
  apriltag_detector_add_family_bits(detector.get(), family.get(), 1);
  detector->quad_decimate = 1, detector->refine_edges = true, detector->nthreads = 1;
  const auto detect = [family, detector](const cv::Mat& grey) {
    image_u8_t image{grey.cols, grey.rows, static_cast<int>(grey.step[0]), grey.data};
    zarray_t* const detections = apriltag_detector_detect(detector.get(), &image);
    std::vector<FoundTag> found;
    for (int i = 0; i < zarray_size(detections); ++i) {
      apriltag_detection_t* one = nullptr;
      zarray_get(detections, i, &one);
      FoundTag tag{static_cast<std::size_t>(one->id), {}};
      // Theirs begins below left; a pixel's centre is at a half.
      constexpr std::array order{3, 2, 1, 0};
      for (std::size_t k = 0; k < 4; ++k) tag.ideal_px[k] = {one->p[order[k]][0] - 0.5, one->p[order[k]][1] - 0.5};
      found.push_back(tag);
    }
    apriltag_detections_destroy(detections);
    return found;
  };
  return {"AprilTag " + name, cells_of(family), detect};
}

std::vector<TagCells> cells_of(const cv::Ptr<cv::aruco::Dictionary>& dictionary) {
  std::vector<TagCells> tags;
  for (int i = 0; i < dictionary->bytesList.rows; ++i) {
    TagCells tag;
    tag.size = dictionary->markerSize + 2;
    cv::Mat image;
    cv::aruco::drawMarker(dictionary, i, tag.size, image, 1);
    for (int r = 0; r < tag.size; ++r)
      for (int c = 0; c < tag.size; ++c) tag.dark.push_back(image.at<std::uint8_t>(r, c) < 128);
    tags.push_back(std::move(tag));
  }
  return tags;
}

Detector aruco_detector(const std::string& name, int words, int refinement, const std::string& refinement_name) {
  const auto dictionary = cv::aruco::getPredefinedDictionary(words);
  const auto parameters = cv::aruco::DetectorParameters::create();
  parameters->cornerRefinementMethod = refinement;
  parameters->cornerRefinementWinSize = 3;
  parameters->minMarkerPerimeterRate = 0.01;
  parameters->adaptiveThreshWinSizeMax = 53;
  const auto detect = [dictionary, parameters](const cv::Mat& grey) {
    std::vector<std::vector<cv::Point2f>> corners;
    std::vector<int> ids;
    cv::aruco::detectMarkers(grey, dictionary, corners, ids, parameters);
    std::vector<FoundTag> found;
    for (std::size_t i = 0; i < ids.size(); ++i) {
      FoundTag tag{static_cast<std::size_t>(ids[i]), {}};
      for (std::size_t k = 0; k < 4; ++k) tag.ideal_px[k] = {corners[i][k].x, corners[i][k].y};
      found.push_back(tag);
    }
    return found;
  };
  return {fmt::format("ArUco {}, corners by {}", name, refinement_name), cells_of(dictionary), detect};
}

struct Score {
  std::vector<double> error_rad;
  int frames = 0, wrong = 0;
  double tags = 0;
  Eigen::Vector2d beside_px = Eigen::Vector2d::Zero();  // corners, from where they truly are
  int corners = 0;

  void add(const std::optional<Rigid3>& pose, const Scene& scene) {
    ++frames;
    if (!pose) return;
    error_rad.push_back(roll_error_rad(*pose, scene));
    wrong += std::abs(error_rad.back()) > wrong_rad;
  }
  double rms_rad() const { return acceptance::rms(error_rad); }
};

void print_row(const std::string& name, const Score& score) {
  std::vector<double> right;
  for (const double error : score.error_rad)
    if (std::abs(error) <= wrong_rad) right.push_back(error);
  std::printf("| %s | %.0f %% | %+.2f | %.2f | %.2f | %.1f | %d |\n", name.c_str(),
              100.0 * static_cast<double>(score.error_rad.size()) / score.frames, 1e3 * acceptance::mean(right),
              1e3 * acceptance::rms(right), 1e3 * score.rms_rad(), 1e3 * acceptance::largest(score.error_rad),
              score.wrong);
  std::fflush(stdout);
}

struct Layout {
  const Detector* detector;
  int around;
};

std::vector<cv::Mat> rendered(const std::vector<Scene>& all, const PrintedCells& print) {
  Renderer renderer = renderer_of(all[0].rig, print);
  std::vector<cv::Mat> frames;
  for (const Scene& scene : all)
    frames.push_back(renderer.render({placement_of(scene.rig.instruments[0], scene.q)}, scene.noise));
  return frames;
}

Score score_bundle(const std::vector<Scene>& all, const Layout& layout, Grey grey) {
  const Rig& rig = all[0].rig;
  const TagBundle bundle(rig.instruments[0].marker, layout.detector->tags, layout.around);
  const std::vector<cv::Mat> frames = rendered(all, bundle.print());
  Score score;
  for (std::size_t i = 0; i < all.size(); ++i) {
    std::vector<FoundTag> found = layout.detector->detect(grey(frames[i], rig.camera));
    std::erase_if(found, [&](const FoundTag& tag) { return tag.tag >= bundle.size(); });
    const Rigid3 truth = all[i].camera_from_marker();
    for (FoundTag& tag : found)
      for (std::size_t k = 0; k < 4; ++k) {
        tag.ideal_px[k] = rig.camera.ideal_from_raw(tag.ideal_px[k]).value_or(tag.ideal_px[k]);
        const Eigen::Vector3d at = truth * bundle.corners_m(tag.tag)[k];
        const Eigen::Vector2d ideal(rig.camera.fx_px * at.x() / at.z() + rig.camera.cx_px,
                                    rig.camera.fy_px * at.y() / at.z() + rig.camera.cy_px);
        score.beside_px += tag.ideal_px[k] - ideal, ++score.corners;
      }
    score.tags += static_cast<double>(found.size());
    score.add(bundle_pose(bundle, found, rig.camera), all[i]);
  }
  if (score.corners) score.beside_px /= score.corners;
  return score;
}

Score score_lapservo(const std::vector<Scene>& all, bool registered) {
  const std::vector<cv::Mat> frames = rendered(all, {});
  Score score;
  for (std::size_t i = 0; i < all.size(); ++i) {
    Rig rig = all[i].rig;
    if (!registered) rig.instruments[0].camera_from_rcm.reset();
    const Observation seen = Tracker(rig, {.single = true}).track(frames[i])[0];
    score.add(seen.status == Status::ok && seen.marker ? std::optional(seen.marker->camera_from_marker) : std::nullopt,
              all[i]);
  }
  return score;
}

// Frames that are missing count as much as large errors do.
double cost(const Score& score) {
  const double missing = 1 - static_cast<double>(score.error_rad.size()) / score.frames;
  double squares = 0;
  for (const double error : score.error_rad) squares += std::min(error * error, wrong_rad * wrong_rad);
  return squares / score.frames + missing * wrong_rad * wrong_rad;
}

Layout best(const std::vector<Detector>& detectors, const std::vector<int>& arounds, const std::vector<Scene>& tuning) {
  Layout best{};
  double least = 1e9;
  for (const Detector& detector : detectors)
    for (const int around : arounds) {
      const Layout layout{&detector, around};
      const Score score = score_bundle(tuning, layout, linear_grey);
      std::fprintf(stderr, "%s, %d round: %.0f %% found, rms %.2f mrad, %.1f tags, corners beside by %+.2f %+.2f px\n",
                   detector.name.c_str(), around, 100.0 * static_cast<double>(score.error_rad.size()) / score.frames,
                   1e3 * score.rms_rad(), score.tags / score.frames, score.beside_px.x(), score.beside_px.y());
      if (cost(score) < least) least = cost(score), best = layout;
    }
  return best;
}

std::vector<Detector> apriltags() {
  const std::vector<std::pair<std::string, Family>> families{{"36h11", {tag36h11_create(), tag36h11_destroy}},
                                                             {"25h9", {tag25h9_create(), tag25h9_destroy}},
                                                             {"16h5", {tag16h5_create(), tag16h5_destroy}}};
  std::vector<Detector> all;
  for (const auto& [name, family] : families) all.push_back(apriltag_detector(name, family));
  return all;
}

std::vector<Detector> arucos() {
  std::vector<Detector> all;
  for (const auto& [name, words] :
       {std::pair{"4x4", cv::aruco::DICT_4X4_50}, {"5x5", cv::aruco::DICT_5X5_50}, {"6x6", cv::aruco::DICT_6X6_50}})
    for (const auto& [method, way] : {std::pair{"subpix", cv::aruco::CORNER_REFINE_SUBPIX},
                                      {"contour", cv::aruco::CORNER_REFINE_CONTOUR},
                                      {"AprilTag's", cv::aruco::CORNER_REFINE_APRILTAG}})
      all.push_back(aruco_detector(name, words, way, method));
  return all;
}

void compare(int poses, const std::vector<std::uint64_t>& seeds, double steepest_rad, const Layout& april,
             const Layout& aruco) {
  std::printf("\nshaft leaning up to %.0f degrees, %zu frames\n\n", deg_from_rad(steepest_rad),
              static_cast<std::size_t>(poses) * seeds.size());
  std::printf(
      "| | found | mean [mrad] | rms below 0.1 rad | rms | largest | beyond 0.1 rad |\n| --- | --- | --- | --- | --- | "
      "--- | --- |\n");
  std::vector<Scene> all;
  for (const std::uint64_t seed : seeds)
    for (Scene& scene : scenes(poses, seed, steepest_rad)) all.push_back(std::move(scene));
  print_row("lapservo", score_lapservo(all, false));
  print_row("lapservo, camera_from_rcm known", score_lapservo(all, true));
  for (const auto& [name, layout] : {std::pair{"AprilTags", april}, {"ArUco tags", aruco}}) {
    print_row(name, score_bundle(all, layout, linear_grey));
    print_row(fmt::format("{}, encoding left", name), score_bundle(all, layout, encoded_grey));
  }
}

int run(int poses, const std::vector<std::uint64_t>& seeds) {
  cv::setNumThreads(1);
  const auto tuning = scenes(std::max(10, poses / 2), tuning_seed, 0.35);
  const std::vector<Detector> april = apriltags(), aruco = arucos();
  const std::vector<int> arounds{5, 6, 7, 8, 9, 10};
  const Layout best_april = best(april, arounds, tuning), best_aruco = best(aruco, arounds, tuning);
  for (const Layout& layout : {best_april, best_aruco})
    std::printf("%s, %d round\n", layout.detector->name.c_str(), layout.around);
  compare(poses, seeds, 0.35, best_april, best_aruco);
  compare(poses, seeds, std::atan(1.2), best_april, best_aruco);
  return 0;
}

}  // namespace
}  // namespace lapservo::bench

int main(int count, char** values) {
  const int poses = count > 1 ? std::atoi(values[1]) : 40;
  std::vector<std::uint64_t> seeds;
  for (int i = 2; i < count; ++i) seeds.push_back(std::strtoull(values[i], nullptr, 10));
  if (seeds.empty()) seeds = {1, 2, 3};
  if (poses < 1) {
    std::fprintf(stderr, "accuracy_bench [POSES [SEED...]]\n");
    return 2;
  }
  return lapservo::bench::run(poses, seeds);
}
