#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "lapservo/core/random.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/rig.h"
#include "lapservo/sim/renderer.h"
#include "lapservo/vision/image/light_image.h"
#include "lapservo/vision/model/fine_fit.h"
#include "lapservo/vision/shaft/scene.h"
#include "lapservo/vision/shaft/shaft_pose.h"

/// Rendered frames of the simulator with known truth, and what vision takes apart of them. For tests.
namespace lapservo::scenes {
using namespace internal;

/// 960x540, up to three instruments through ports left, right and above; their markers share colours in other orders.
Rig usual_rig(std::size_t instruments = 1);

Rig without_rcm(Rig rig);

/// The same print on a shaft of another diameter, in proportion.
Marker scaled_to(Marker marker, double diameter_m);

/// The marker wholly in view (a lens's distortion neglected), at most so far from facing the camera.
JointVector random_configuration(const Rig& rig, std::size_t instrument, Random& random, double steepest_rad = 0.35);

/// One of each instrument.
std::vector<JointVector> random_configurations(const Rig& rig, Random& random);

ShaftPose pose_of(const Rig& rig, std::size_t instrument, const JointVector& q);

/// Three independent standard normal numbers.
Eigen::Vector3d normal_vector(Random& random);

/// Puts the registration off, by these standard deviations along and about each axis, which it states.
void misregister(Instrument& instrument, double sigma_m, double sigma_rad, Random& random);

/// Two instruments whose markers touch or cross in the image, one before the other: their middles less than 110 px
/// apart there, their axes a diameter and more apart in space.
struct CrossingPair {
  std::vector<JointVector> q;
  std::array<double, 2> hidden{};        ///< of each marker's visible side, the fraction that the other's shaft hides
  std::array<double, 2> hidden_inner{};  ///< the same of its inner boundaries, of the one that is hidden more
  /// Whether both inner boundaries are visible: with only one, a misprinted marker looks like a rotated one.
  bool tells_psi(std::size_t instrument) const { return hidden_inner[instrument] < 0.6; }
};
CrossingPair crossing_pair(const Rig& rig, Random& random, double steepest_rad = 0.35);

/// All instruments of the rig in front of tissue; `configurations` in the rig's order. The seed is that of the noise.
cv::Mat render(const Rig& rig, const std::vector<JointVector>& configurations, std::uint64_t seed,
               const RenderOptions& options = {});

/// The first instrument in front of tissue, with a shaft as it is.
Renderer renderer_of(const Rig& rig, const ShaftModel& shaft);

/// Blood over about a fraction of the first instrument's print, while it moves by pixels from frame to frame.
struct BloodyMotion {
  std::vector<JointVector> q;
  std::vector<cv::Mat> frames;

  BloodyMotion(const Rig& rig, double fraction, std::uint64_t seed, int count);
};

/// Tissue alone.
cv::Mat render_nothing(const Rig& rig, std::uint64_t seed);

/// A frame and all that looking at it borrows.
class Sight {
 public:
  Sight(const Rig& rig, const cv::Mat& bgr);
  Sight(const Sight&) = delete;
  Sight& operator=(const Sight&) = delete;

  Scene scene(std::size_t instrument = 0) const;
  const LightImage& light() const { return light_; }
  const ImageView& view() const { return view_; }
  const ColourClasses& classes() const { return classes_; }

 private:
  Rig rig_;
  cv::Mat bgr_;
  ImageView view_;
  ColourClasses classes_;
  std::vector<std::optional<RcmPrior>> registrations_;
  LightTable table_;
  LightImage light_;
};

/// One instrument somewhere before the usual rig's camera.
struct Shot {
  std::uint64_t seed;
  Rig rig;
  JointVector q;
  cv::Mat bgr;
  Sight sight;

  explicit Shot(std::uint64_t seed, const RenderOptions& options = {}, const Rig& of_rig = usual_rig());
  PoseUnknowns truth(bool through_rcm) const;
  CentreLine line() const;  ///< the true one
  double psi_error_rad(double psi_rad) const;
  double psi_error_rad(const PoseUnknowns& unknowns) const;  ///< of psi by the registration
};

/// The shot of a seed, rendered once for all who ask.
const Shot& usual_shot(std::uint64_t seed);

/// q by a fit's pose and the first instrument's registration.
JointVector q_of(const Rig& rig, const PoseUnknowns& unknowns);

/// The fine fit to a shot, of a frame on its own: without the registration from a start that is not through the RCM.
FineFit fit_from(const Shot& shot, const PoseUnknowns& start);

}  // namespace lapservo::scenes
