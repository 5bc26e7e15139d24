#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/geometry/camera.h"
#include "lapservo/marker/marker.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// How pixel values encode light, by a marker's inner boundaries: only in light does a blurred edge lie at one place in
/// all channels, whichever of them rise there and whichever fall. Another response moves it to the brighter or to the
/// darker side.
class MarkerResponse {
 public:
  /// Compares the camera's own response and the usual ones.
  explicit MarkerResponse(const Camera& camera);

  /// 8-bit BGR of the camera's size, with the marker at a pose that is good to a pixel.
  void add(const cv::Mat& bgr, const Marker& marker, const ShaftPose& pose);

  struct Result {
    std::optional<Response> better;  ///< than the camera's own; empty when its own explains the edges as well
    std::string name;                ///< of the best, which may be the camera's own
    /// Between the edges of channels that rise and of those that fall at one place: medians, with the camera's own
    /// response and with the best.
    double before_px = 0, after_px = 0;
    /// Median with its sign of that distance with the best, and its standard deviation: beyond it, none of them
    /// explains the edges.
    double left_px = 0, sigma_left_px = 0;
    std::size_t edges = 0;
  };
  /// Nullopt with too few edges.
  std::optional<Result> result() const;

 private:
  struct Candidate {
    std::string name;
    Response response;
    LightTable light;
    std::vector<double> apart_px;  ///< of each edge
  };

  Camera camera_;
  std::vector<Candidate> candidates_;  // the first: the camera's own
};

/// How a marker is lit in a frame, by encoded values.
struct MarkerLight {
  double clipped = 0;                ///< fraction of the pixels that have a saturated channel
  double value = 0;                  ///< median of the brightest channel, of 255
  double chroma = 0;                 ///< median of the brightest channel less the darkest one
  std::array<double, 3> hues_deg{};  ///< of the bands: medians of what has a hue, near the marker's own
};

/// By what faces the camera, clear of boundaries and apparent contours; nullopt where there is no such pixel. `bgr` is
/// 8-bit, of the camera's size.
std::optional<MarkerLight> light_of_marker(const cv::Mat& bgr, const Camera& camera, const Marker& marker,
                                           const ShaftPose& pose);

/// A whole frame by encoded values: what can be said of its light where no marker is found.
struct PictureLight {
  double value = 0;    ///< 90th percentile of the brightest channel, of 255
  double clipped = 0;  ///< fraction of the pixels with a saturated channel

  bool dark() const { return value < 40; }
  bool overexposed() const { return clipped > 0.25; }
};

/// Where all frames are dark: cause and remedy.
inline constexpr auto dark_pictures =
    "the frames are dark: take the cap off the lens, raise the light or the exposure; 16-bit images that hold 8 to 12 "
    "bits are to be scaled to the whole range";

/// The light of an 8-bit BGR image; zeros where it is smaller than 9 x 9.
PictureLight light_of_picture(const cv::Mat& bgr);

}  // namespace lapservo::internal
