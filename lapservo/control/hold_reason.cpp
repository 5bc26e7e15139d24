#include "lapservo/control/hold_reason.h"

namespace lapservo {

std::string_view to_string(HoldReason reason) {
  switch (reason) {
    case HoldReason::none:
      return "none";
    case HoldReason::no_image_yet:
      return "no_image_yet";
    case HoldReason::marker_lost:
      return "marker_lost";
    case HoldReason::stale_image:
      return "stale_image";
    case HoldReason::outlier:
      return "outlier";
    case HoldReason::no_history:
      return "no_history";
    case HoldReason::not_modelled:
      return "not_modelled";
    case HoldReason::singular:
      return "singular";
    case HoldReason::not_following:
      return "not_following";
    case HoldReason::not_learnt:
      return "not_learnt";
    case HoldReason::bad_time:
      return "bad_time";
    case HoldReason::non_finite:
      return "non_finite";
    case HoldReason::arm_not_enabled:
      return "arm_not_enabled";
  }
  return "";
}

}  // namespace lapservo
