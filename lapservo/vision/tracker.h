#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/rig/rig.h"
#include "lapservo/vision/observation.h"

namespace lapservo {

enum class Method {
  surface,     ///< every visible generatrix, robust fit in linear light
  centerline,  ///< the paper's Algorithm 1
};
/// "surface", "centerline".
std::string_view to_string(Method method);
std::optional<Method> method_from_string(std::string_view word);

struct TrackerOptions {
  Method method = Method::surface;
  bool single = false;       ///< treat every frame on its own instead of starting from the frame before
  bool deinterlace = false;  ///< track the field of the even rows; also when the rig's camera says so
  /// Method::surface: the budget of a frame, in units of work; nullopt: as much as it takes. A unit is about half a
  /// microsecond of a core of 2.3 GHz, but counted, not measured by a clock: the same frames give the same results
  /// whatever else the machine does. An instrument that is followed takes 500 to 700, 3000 where the camera's
  /// processing shows, more where it misses the RCM: another one is looked for. A search for one that is hidden takes a
  /// hundred times that and goes on in the frames to come where it stopped. Until it comes to its end the status is
  /// what is known so far. Images that don't follow one another need nullopt. Frames of `single` are always searched
  /// whole. Work that can't wait for the next frame goes beyond the budget: who is followed, a second print's place, a
  /// registration that is contradicted, a shaft that the border cuts.
  std::optional<double> frame_budget = 8000;
  /// Method::surface: an instrument is `uncertain` where Observation::p_false is larger, beyond 1.5 times what the
  /// rig's own tolerance of the print adds. Above 0, at most 1.
  double max_p_false = Observation::usual_max_p_false;
};

/// Finds all instruments of a rig in the frames of one camera. Holds what it learnt from the frames before: where they
/// were, what the camera does to its images, and whether each print is the rig's; the latter until no frame has shown
/// the print for 2 s, in which the instrument may have been exchanged.
class Tracker {
 public:
  /// Throws InputError for a rig that nothing can be seen with, and for options out of their ranges.
  explicit Tracker(const Rig& rig, TrackerOptions options = {});
  ~Tracker();
  Tracker(Tracker&&) noexcept;
  Tracker& operator=(Tracker&&) noexcept;

  /// `image_bgr`: 8-bit, 3 channels, of the rig's size, else InputError. One observation per instrument of the rig, in
  /// its order. `time_s`: when the frame was taken, by any clock. Frames without it, and those whose times do not go
  /// on, count as taken 1/32 s after the one before.
  const std::vector<Observation>& track(const cv::Mat& image_bgr, std::optional<double> time_s = std::nullopt) &;
  /// For a tracker that is gone after the expression, as in `Tracker(rig).track(image)`: by value. There is no frame to
  /// come, so this one is searched whole.
  std::vector<Observation> track(const cv::Mat& image_bgr) &&;

  /// The registration of an instrument from the next frame on, as if the rig had it: of a camera that moves, for
  /// example. The frames before still count. Throws std::out_of_range for an instrument that the rig has not,
  /// InputError for numbers that are not finite.
  void set_registration(std::size_t instrument, const Rigid3& camera_from_rcm,
                        const Eigen::Matrix<double, 6, 6>& covariance);

  /// Readings of the joints of an instrument's wrist, in the order of its Tool::wrist [rad], in the frames to come,
  /// until others are set; none: they are not known, and there is no tip. Throws InputError for another number of them
  /// and for one that is not finite, std::out_of_range for an instrument that the rig has not.
  void set_wrist(std::size_t instrument, std::span<const double> wrist_rad);

  /// For a frame whose pixels are not the camera's, as a damaged one's: one observation per instrument, of this status.
  /// Forgets the frame before.
  const std::vector<Observation>& refuse(Status why) &;

  /// Forgets all frames before: the next one is searched anew.
  void reset();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lapservo
