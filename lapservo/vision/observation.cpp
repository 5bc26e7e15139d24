#include "lapservo/vision/observation.h"

namespace lapservo {

std::string_view status_word(Status status) {
  switch (status) {
    case Status::ok:
      return "ok";
    case Status::no_marker:
      return "no_marker";
    case Status::cut:
      return "cut";
    case Status::occluded:
      return "occluded";
    case Status::ambiguous:
      return "ambiguous";
    case Status::poor_fit:
      return "poor_fit";
    case Status::damaged:
      return "damaged";
    case Status::few_colors:
      return "few_colors";
    case Status::uncertain:
      return "uncertain";
    case Status::marker_mismatch:
      return "marker_mismatch";
    case Status::interlaced:
      return "interlaced";
  }
  return "no_marker";
}

}  // namespace lapservo
