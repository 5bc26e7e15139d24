#pragma once

#include <array>
#include <optional>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/rig/rig.h"
#include "lapservo/vision/colour/colour_classes.h"
#include "lapservo/vision/decision/frame_clock.h"
#include "lapservo/vision/decision/instrument_memory.h"
#include "lapservo/vision/decision/print_record.h"
#include "lapservo/vision/model/fine_fit.h"
#include "lapservo/vision/observation.h"
#include "lapservo/vision/search/marker_search.h"
#include "lapservo/vision/shaft/shaft_cover.h"

namespace lapservo::internal {

/// Method::surface: coarse search for the markers' colours, then a fit over all visible generatrices.
///
/// A shaft is held at the RCM as well as the registration knows it. Where the image contradicts that, the shaft is
/// fitted without it: the image features are right then, and q is given only as far as the mismatch lets it be known.
class SurfaceTracker {
 public:
  /// `single`: every frame on its own. `frame_budget`, `max_p_false`: as TrackerOptions has them.
  SurfaceTracker(const Rig& rig, bool single, std::optional<double> frame_budget = std::nullopt,
                 double max_p_false = Observation::usual_max_p_false);

  /// `image_bgr` is 8-bit BGR of the rig's size, `time_s` as Tracker::track has it. One observation per instrument.
  const std::vector<Observation>& track(const cv::Mat& image_bgr, std::optional<double> time_s = std::nullopt);
  /// Forgets where an instrument was in the frames before.
  void forget(std::size_t instrument);
  /// The last frame is no evidence about an instrument: forgets it, and the frames before as forget() does.
  void disregard_frame(std::size_t instrument);
  /// Forgets all of the frames before, what they showed of the prints as well.
  void forget();
  /// Tracker::set_registration().
  void set_registration(std::size_t i, const Instrument& moved) { registrations_[i] = registration_of(moved); }
  void set_frame_budget(std::optional<double> units) { frame_budget_ = units; }

 private:
  void find(const ImageView& image, const LightImage& light, WorkBudget& budget);
  Found follow_known(const ImageView& image, const LightImage& light, std::size_t instrument, WorkBudget& budget);
  bool look_for_lost(const ImageView& image, const LightImage& light, const std::vector<Blob>& blobs,
                     WorkBudget& budget, bool again);
  bool cover_expected(std::size_t instrument, WorkBudget& budget);
  void cover_found(std::size_t instrument, const std::vector<Blob>& blobs, WorkBudget& budget);
  void cover(std::size_t instrument, const ShaftPose& pose, WorkBudget& budget);
  bool remember(const ImageView& image);
  void learn_print(std::size_t instrument);
  Scene scene_of(const ImageView& image, std::size_t instrument) const;

  Rig rig_;
  bool single_;
  std::optional<double> frame_budget_;
  double max_p_false_;
  ColourClasses classes_;
  LightTable light_;
  ChannelGeometry channels_;
  FrameClock clock_;
  double now_s_ = 0;  // of this frame
  std::vector<std::optional<RcmPrior>> registrations_;
  std::vector<std::optional<InstrumentMemory>> memory_;
  std::vector<PrintRecord> prints_, prints_before_;                   // this frame's evidence, too, and without it
  std::vector<std::array<std::optional<ShaftPose>, 2>> seen_before_;  // found or refused in the two frames before
  std::optional<double> blended_s_;                                   // when a frame last showed two moments
  std::vector<MarkerSearch> searches_;
  bool followed_twice_ = false, followed_in_vain_ = false;  // in this frame, one of them
  std::vector<std::size_t> searched_beside_;                // so many others the search is among, by instrument
  std::vector<Found> found_;
  std::vector<ShaftCover> covers_;         // where somebody wanted it in this frame
  std::vector<const ShaftCover*> others_;  // that may hide or touch the one that is looked for
  std::vector<Observation> observations_;
};

}  // namespace lapservo::internal
