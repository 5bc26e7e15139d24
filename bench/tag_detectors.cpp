#include "bench/tag_detectors.h"

#include <apriltag/apriltag.h>
#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h11.h>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <utility>

#include <fmt/format.h>
#include <opencv2/aruco.hpp>
#include <opencv2/imgproc.hpp>

namespace lapservo::bench {
namespace {

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

// A tag's straight lines miss the corners of one that is bent round a shaft; the corners themselves don't.
void refine(std::vector<SeenTag>& seen, const cv::Mat& grey, int half_window_px) {
  if (seen.empty()) return;
  std::vector<cv::Point2f> corners;
  for (const SeenTag& tag : seen)
    for (const Eigen::Vector2d& corner : tag.raw_px)
      corners.emplace_back(static_cast<float>(corner.x()), static_cast<float>(corner.y()));
  cv::cornerSubPix(grey, corners, {half_window_px, half_window_px}, {-1, -1},
                   {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 50, 1e-3});
  for (std::size_t i = 0; i < corners.size(); ++i) seen[i / 4].raw_px[i % 4] = {corners[i].x, corners[i].y};
}

using Detector = std::shared_ptr<apriltag_detector_t>;

std::vector<SeenTag> seen_by(const Detector& detector, const cv::Mat& grey) {
  image_u8_t image{grey.cols, grey.rows, static_cast<int>(grey.step[0]), grey.data};
  zarray_t* const detections = apriltag_detector_detect(detector.get(), &image);
  std::vector<SeenTag> seen;
  for (int i = 0; i < zarray_size(detections); ++i) {
    apriltag_detection_t* one = nullptr;
    zarray_get(detections, i, &one);
    SeenTag tag{static_cast<std::size_t>(one->id), {}};
    // Theirs begins below left; a pixel's centre is at a half.
    constexpr std::array order{3, 2, 1, 0};
    for (std::size_t k = 0; k < 4; ++k) tag.raw_px[k] = {one->p[order[k]][0] - 0.5, one->p[order[k]][1] - 0.5};
    seen.push_back(tag);
  }
  apriltag_detections_destroy(detections);
  return seen;
}

const char* bend(CornersBy corners) {
  return corners == CornersBy::straight_sides ? ", bent sides undone" : "";
}

TagDetector april_detector(const Family& family, float quad_sigma_px, int half_window_px, CornersBy corners) {
  const Detector detector(apriltag_detector_create(), apriltag_detector_destroy);
  apriltag_detector_add_family_bits(detector.get(), family.get(), 1);
  detector->quad_decimate = 1, detector->quad_sigma = quad_sigma_px, detector->refine_edges = true;
  detector->nthreads = 1;
  return {fmt::format("quad_decimate 1, quad_sigma {}, refine_edges{}{}", quad_sigma_px,
                      half_window_px ? fmt::format(", cornerSubPix {}", half_window_px) : "", bend(corners)),
          corners, [family, detector, half_window_px](const cv::Mat& grey) {
            std::vector<SeenTag> seen = seen_by(detector, grey);
            if (half_window_px) refine(seen, grey, half_window_px);
            return seen;
          }};
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

TagDetector aruco_detector(const cv::Ptr<cv::aruco::Dictionary>& dictionary, int refinement, int half_window_px,
                           CornersBy corners) {
  const auto parameters = cv::aruco::DetectorParameters::create();
  parameters->cornerRefinementMethod = refinement;
  if (half_window_px) parameters->cornerRefinementWinSize = half_window_px;
  parameters->cornerRefinementMaxIterations = 50, parameters->cornerRefinementMinAccuracy = 1e-3;
  parameters->minMarkerPerimeterRate = 0.01;
  parameters->adaptiveThreshWinSizeMax = 53;
  const auto detect = [dictionary, parameters](const cv::Mat& grey) {
    std::vector<std::vector<cv::Point2f>> found;
    std::vector<int> ids;
    cv::aruco::detectMarkers(grey, dictionary, found, ids, parameters);
    std::vector<SeenTag> seen;
    for (std::size_t i = 0; i < ids.size(); ++i) {
      SeenTag tag{static_cast<std::size_t>(ids[i]), {}};
      for (std::size_t k = 0; k < 4; ++k) tag.raw_px[k] = {found[i][k].x, found[i][k].y};
      seen.push_back(tag);
    }
    return seen;
  };
  const std::string way = refinement == cv::aruco::CORNER_REFINE_APRILTAG
                              ? "CORNER_REFINE_APRILTAG"
                              : fmt::format("CORNER_REFINE_SUBPIX {}", half_window_px);
  return {way + bend(corners), corners, detect};
}

}  // namespace

std::vector<TagDictionary> april_tags() {
  const std::vector<std::pair<std::string, Family>> families{{"36h11", {tag36h11_create(), tag36h11_destroy}},
                                                             {"25h9", {tag25h9_create(), tag25h9_destroy}},
                                                             {"16h5", {tag16h5_create(), tag16h5_destroy}}};
  std::vector<TagDictionary> all;
  for (const auto& [name, family] : families) {
    TagDictionary dictionary{"AprilTag " + name, cells_of(family), {}};
    for (const int half_window_px : {0, 2, 3})
      dictionary.detectors.push_back(april_detector(family, 0, half_window_px, CornersBy::themselves));
    for (const float quad_sigma_px : {0.0F, 0.8F})
      dictionary.detectors.push_back(april_detector(family, quad_sigma_px, 0, CornersBy::straight_sides));
    all.push_back(std::move(dictionary));
  }
  return all;
}

std::vector<TagDictionary> aruco_tags() {
  std::vector<TagDictionary> all;
  for (const auto& [name, words] : {std::pair{"4x4", cv::aruco::DICT_4X4_100},
                                    {"5x5", cv::aruco::DICT_5X5_100},
                                    {"6x6", cv::aruco::DICT_6X6_100}}) {
    const auto tags = cv::aruco::getPredefinedDictionary(words);
    TagDictionary dictionary{fmt::format("ArUco {}", name), cells_of(tags), {}};
    for (const int half_window_px : {2, 3, 4})
      dictionary.detectors.push_back(
          aruco_detector(tags, cv::aruco::CORNER_REFINE_SUBPIX, half_window_px, CornersBy::themselves));
    for (const CornersBy corners : {CornersBy::themselves, CornersBy::straight_sides})
      dictionary.detectors.push_back(aruco_detector(tags, cv::aruco::CORNER_REFINE_APRILTAG, 0, corners));
    all.push_back(std::move(dictionary));
  }
  return all;
}

}  // namespace lapservo::bench
