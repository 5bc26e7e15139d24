#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "bench/tag_bundle.h"

namespace lapservo::bench {

/// A tag where a detector sees it: its corners in raw pixels, in the order of TagBundle::corners_m().
struct SeenTag {
  std::size_t tag;
  std::array<Eigen::Vector2d, 4> raw_px;
};

/// One library's way to one dictionary's tags, with one choice of its settings.
struct TagDetector {
  std::string settings;
  CornersBy corners;
  std::function<std::vector<SeenTag>(const cv::Mat& grey)> detect;
};

/// The prints, and the detectors of each.
struct TagDictionary {
  std::string name;
  std::vector<TagCells> tags;
  std::vector<TagDetector> detectors;
};

std::vector<TagDictionary> april_tags();  ///< libapriltag; also with OpenCV's cornerSubPix after it
std::vector<TagDictionary> aruco_tags();  ///< OpenCV's aruco

}  // namespace lapservo::bench
