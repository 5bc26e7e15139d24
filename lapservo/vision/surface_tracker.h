#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/rig/rig.h"
#include "lapservo/vision/colour/colour_classes.h"
#include "lapservo/vision/decision/instrument_memory.h"
#include "lapservo/vision/model/fine_fit.h"
#include "lapservo/vision/observation.h"
#include "lapservo/vision/search/marker_search.h"
#include "lapservo/vision/shaft/shaft_cover.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::internal {

/// Method::surface: coarse search for the markers' colours, then a fit over all visible generatrices.
///
/// A shaft is held at the RCM as well as the registration knows it. Where the image contradicts that, the shaft is
/// fitted without it: the image features are right then, and q is given only as far as the mismatch lets it be known.
/// Another one that passes through the RCM is looked for meanwhile, and counts instead.
class SurfaceTracker {
 public:
  /// The options `single`, `frame_budget` and `max_p_false` count.
  SurfaceTracker(const Rig& rig, const TrackerOptions& options);
  SurfaceTracker(const SurfaceTracker&) = delete;
  SurfaceTracker& operator=(const SurfaceTracker&) = delete;

  /// `image_bgr` is 8-bit BGR of the rig's size, `time_s` as Tracker::track has it. One observation per instrument.
  const std::vector<Observation>& track(const cv::Mat& image_bgr, std::optional<double> time_s = std::nullopt);
  /// Forgets where an instrument was in the frames before.
  void forget(std::size_t instrument);
  /// The last frame is no evidence about an instrument: forgets it, and the frames before as forget() does.
  void disregard_frame(std::size_t instrument);
  /// Forgets all of the frames before, what they showed of the prints as well.
  void forget();
  /// Tracker::set_registration().
  void set_registration(std::size_t i, const Instrument& moved) { tracked_[i].registration = registration_of(moved); }
  void search_frames_whole() { options_.frame_budget.reset(); }

 private:
  struct Tracked {
    const Instrument& instrument;
    const std::array<std::uint8_t, 3>& bands;  // their colour classes
    std::optional<RcmPrior> registration;
    std::optional<InstrumentMemory> memory{};
    PrintRecord print{}, print_before{};                    // with this frame's evidence, and without it
    std::array<std::optional<ShaftPose>, 2> seen_before{};  // found or refused in the two frames before
    MarkerSearch search{};
    std::vector<const ShaftCover*> beside{};  // others_ of its last fit or search
    Found found{};
    std::optional<ShaftCover> cover{};  // where it last was in the way of another one
  };
  void find(const ImageView& image, const LightImage& light, WorkBudget& budget);
  Found follow_known(const ImageView& image, const LightImage& light, Tracked& known, WorkBudget& budget);
  static bool is_lost(const Tracked& it);
  bool look_for_lost(const ImageView& image, const LightImage& light, const std::vector<Blob>& blobs,
                     WorkBudget& budget, bool again);
  ShaftPose likely_pose(const Tracked& it) const;
  const ShaftCover* cover_of(Tracked& other, bool is_found) const;
  bool cover_expected(const Tracked& known, bool only_before = false);
  void fit_behind(const ImageView& image, const LightImage& light, WorkBudget& budget);
  void cover_found(const Tracked& lost, const std::vector<Blob>& blobs);
  bool remember(const ImageView& image);
  static void learn_print(Tracked& it);
  Observation observed(const ImageView& image, const Tracked& it, bool is_blended) const;
  Scene scene_of(const ImageView& image, const Tracked& it) const;
  std::optional<PoseBefore> pose_before(const Tracked& it) const;
  double seen_s(const Tracked& it, const PoseUnknowns& pose) const;
  PoseUnknowns expected_pose(const Tracked& it) const;

  Rig rig_;
  TrackerOptions options_;
  ColourClasses classes_;
  LightTable light_;
  ChannelGeometry channels_;
  FrameClock clock_;
  double now_s_ = 0, before_s_ = 0;  // of this frame and the one before
  std::vector<Tracked> tracked_;
  std::optional<double> blended_s_;        // when a frame last showed two moments
  bool next_frame_ = false;                // one was followed twice or in vain
  std::vector<const ShaftCover*> others_;  // that may hide or touch the one that is looked for
  std::vector<Observation> observations_;
};

}  // namespace lapservo::internal
