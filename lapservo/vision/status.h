#pragma once

#include <string_view>

namespace lapservo {

/// Why there is, or is not, an observation. Words for files: to_string().
enum class Status {
  ok,
  no_marker,        ///< nothing in the image has the marker's colours in its order
  cut,              ///< too little of the marker lies inside the image
  occluded,         ///< too few of its boundaries are visible
  ambiguous,        ///< two explanations fit about as well
  poor_fit,         ///< something was found that does not look like the marker on closer sight
  uncertain,        ///< found, but the rotation's standard deviation is too large to be of use
  marker_mismatch,  ///< the print is not as the rig says: calibrate the marker
  damaged,          ///< the decoder of the image or video complained: its pixels are not the camera's
  interlaced,       ///< the frame is made of two fields, of two moments: use --deinterlace
  blended,          ///< the frame is the sum of two moments: noise reduction over time, or a converted frame rate
};
std::string_view to_string(Status status);

}  // namespace lapservo
