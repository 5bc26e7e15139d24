#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/geometry/camera.h"
#include "lapservo/geometry/response.h"

/// Processing by cameras and recorders, in its order. For tests.
namespace lapservo::effects {

/// Strengths; those of the default do nothing.
struct CameraEffects {
  ChromaticAberration aberration{};
  double vignette = 0;    ///< fraction of light lost in the corners
  double crosstalk = 0;   ///< fraction of each channel's light that goes to each of the others
  bool mosaic = false;    ///< one channel a pixel, and demosaicing
  bool rec709 = false;    ///< instead of sRGB
  double contrast = 0;    ///< of an S-shaped curve over encoded values: what it takes from the slope at black and white
  double saturation = 1;  ///< by which colour differences (Rec. 601) are multiplied
  double sharpening = 0;  ///< unsharp mask of encoded values: so much of what the blur takes away is added
  double sharpening_px = 1.2;
  bool subsampled = false;  ///< chroma at half the resolution (4:2:0), averaged and interpolated
  bool left_sited =
      false;             ///< chroma's samples lie on the left pixels' columns, as H.264 has it, else amid four pixels
  int jpeg_quality = 0;  ///< 1 to 100; 0: not compressed
};

/// An sRGB image, 8-bit BGR, as that camera gives it.
cv::Mat seen_through(const CameraEffects& effects, const cv::Mat& srgb, const Camera& camera);

/// The camera as calibration would have it: its response to grey, its chromatic aberration.
Camera calibrated(const CameraEffects& effects, const Camera& camera);

/// The names in docs/notes/accuracy.md: none, ca, vignette, crosstalk, bayer, rec709, tone, sharpen, chroma420, jpeg,
/// camera (many at once).
const std::vector<std::string>& conditions();

/// One of these, of a strength drawn by the seed; or strong_tone (contrast 0.3 to 0.5, saturation 1.3 to 1.7), or
/// processed (this, demosaicing, sharpening, 4:2:0 and JPEG at once). Throws std::out_of_range for another name.
CameraEffects draw(const std::string& condition, std::uint64_t seed);

}  // namespace lapservo::effects
