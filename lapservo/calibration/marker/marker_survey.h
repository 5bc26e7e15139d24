#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/calibration/marker/seam_edges.h"
#include "lapservo/rig/rig.h"
#include "lapservo/vision/camera/camera_departure.h"
#include "lapservo/vision/colour/blob_search.h"
#include "lapservo/vision/colour/colour_classes.h"
#include "lapservo/vision/model/fine_fit.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// Where a marker was found, in a free pose: no registration bends it.
struct Sighting {
  PoseUnknowns unknowns;
  EdgeBlur blur;
  double film_m = film_mean_m;
  double tau_rad = 0;         ///< on the generatrix that faces the camera
  bool settled = false;       ///< the fine fit agrees with itself; else the pose is good to a few pixels
  CameraDeparture departure;  ///< from the rig's camera, as far as the fine fit shows it
};

/// Finds a marker whose print is not quite as the rig says (boundaries off by half a millimetre, wrapped askew, a gap
/// at the seam): like SurfaceTracker, but whether the print is the rig's does not count.
class MarkerSurvey {
 public:
  MarkerSurvey(const Rig& rig, std::size_t instrument)
      : rig_(rig), instrument_(instrument), classes_(rig.instruments), light_(rig.camera.response.table()) {}

  /// 8-bit BGR of the rig's size. Starts from where the marker was in the frame before.
  std::optional<Sighting> find(const cv::Mat& bgr);

 private:
  std::optional<Sighting> follow(const Scene& scene, const LightImage& light) const;
  std::optional<Sighting> detect(const Scene& scene, const LightImage& light) const;

  Rig rig_;
  std::size_t instrument_;
  ColourClasses classes_;
  LightTable light_;
  std::optional<Sighting> last_;
};

/// A part of a frame about the marker, with a camera of its own: the same rays, fewer pixels.
struct MarkerView {
  cv::Mat bgr;
  Camera camera;
};

/// With room for a pose that is off by some millimetres. Nullopt when nothing of the marker lies inside the image.
std::optional<MarkerView> cropped_view(const cv::Mat& bgr, const Camera& camera, const Marker& marker,
                                       const Rigid3& camera_from_unrolled);

/// All that such a view shows near a pose.
struct ViewMeasurements {
  EdgeMeasurements edges;
  std::optional<SeamEdges> seam;
  double blur_px = 1.2, film_m = film_mean_m;  ///< that they were measured with
  double turned_rad = 0;                       ///< about the axis since the frame before; the caller's to say
  double time_s = 0;                           ///< of the frame; the caller's to say
  ProcessingEvidence processing;               ///< unknown when not wanted
  std::array<double, 4> bias_px{};             ///< taken off the boundaries; sides are measured in grey values then
};

/// Takes off each view's boundaries and sides what the camera's processing moved them by (picture_processing.h). Views
/// that can't show it get the median of those that can, as it is one camera.
void take_processing_off(std::vector<ViewMeasurements>& views);

/// Whether colour differences blurred widely, as libx264 leaves them, explain what these views look like as well as any
/// processing does: `any` and `only_video` measured them with and without Reach::only_video. One camera, so all views
/// together.
bool shows_only_video(const std::vector<ViewMeasurements>& any, const std::vector<ViewMeasurements>& only_video);

/// Measures many views of one marker.
class ViewMeasurer {
 public:
  ViewMeasurer(const Rig& rig, std::size_t instrument)
      : classes_(rig.instruments), bands_(classes_.of_bands(instrument)), light_(rig.camera.response.table()) {}

  /// How far edges are looked for: beyond the blur, and the seam's around the shaft; whether there may be a gap;
  /// whether to find out what the camera did to the image.
  struct Reach {
    double extra_px = 3, seam_m = 0.5e-3;
    bool free_gap = true;
    bool ask_processing = false;
    bool only_video = false;  ///< what was done is nothing but compression: see shows_only_video
  };
  ViewMeasurements measure(const MarkerView& view, const Marker& marker, const Sighting& sighting,
                           const Reach& reach) const;
  /// The fine fit from a sighting, of a print that is known better by now. Nullopt when it does not settle.
  std::optional<Sighting> settled(const MarkerView& view, const Marker& marker, const Sighting& sighting) const;

 private:
  ColourClasses classes_;
  std::array<std::uint8_t, 3> bands_;
  LightTable light_;
};

}  // namespace lapservo::internal
