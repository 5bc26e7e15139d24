#pragma once

#include <array>
#include <cstdint>

#include <opencv2/core.hpp>

#include "lapservo/geometry/camera.h"
#include "lapservo/geometry/response.h"
#include "lapservo/marker/marker.h"
#include "lapservo/vision/image/light_image.h"
#include "lapservo/vision/observation.h"

namespace lapservo::internal {

/// Whether two fields are woven in the box that saw something in two places, some pixels apart. Looks at some thousand
/// pixels, and at all only where those look like fields. Allocates nothing.
bool is_combed(const ImageView& image, const cv::Rect& box);

/// Whether it is so about what was found, or refused, as the marker; false where nothing was.
bool is_combed(const ImageView& image, const Camera& camera, const Marker& marker, const Observation& observation);

/// The field of a frame's even rows, the others interpolated between them: the geometry stays that of the frame.
class EvenField {
 public:
  /// Light is interpolated, as the lens blurs it; means of encoded values would shift edges towards the brighter side.
  explicit EvenField(const Response& response);

  /// `frame_bgr`: 8-bit, 3 channels. Its result lives until the next call; allocates when the size changes.
  const cv::Mat& of(const cv::Mat& frame_bgr);

 private:
  LightTable light_of_value_;
  std::array<std::uint8_t, 16384> value_of_light_{};
  cv::Mat field_bgr_;
};

}  // namespace lapservo::internal
