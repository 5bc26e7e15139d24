#include "lapservo/calibration/check/usual_cause.h"

namespace lapservo::internal {

const char* usual_cause(Status status) {
  switch (status) {
    case Status::ok:
      return "";
    case Status::no_marker:
      return "the rig's hues_deg are not seen in their order: the marker is out of view, or its hues are others; "
             "lapservo calibrate colour measures them";
    case Status::cut:
      return "the marker is cut by the image's border; move the endoscope or the instrument";
    case Status::occluded:
      return "blood, smoke, reflections or another instrument hide boundaries; clean the marker, move what covers it";
    case Status::ambiguous:
      return "two explanations fit: large parts are hidden or blurred, or two markers are alike; clean the marker, "
             "focus, "
             "use other orders of hues";
    case Status::poor_fit:
      return "what has the marker's hues is not as the rig says; compare diameter_m and bands with the print, and the "
             "focal length with the camera's";
    case Status::uncertain:
      return "the marker is too small, too dark, blurred or compressed for psi; come nearer, more light, a shorter "
             "exposure, less compression, and where the rig's sigma_camera_matrix or sigma_response is large, lapservo "
             "calibrate camera";
    case Status::marker_mismatch:
      return "the print is not as the rig says; lapservo calibrate marker measures it from a slow turn";
    case Status::damaged:
      return "the decoder reports damaged frames; repair what carries them, or record them again";
    case Status::interlaced:
      return "the frames are interlaced; --deinterlace tracks one field of each";
    case Status::blended:
      return "frames are the sum of two moments; switch off the recorder's noise reduction over time (3D NR, temporal "
             "denoise) and every conversion of the frame rate";
  }
  return "";
}

}  // namespace lapservo::internal
