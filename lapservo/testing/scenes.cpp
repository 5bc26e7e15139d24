#include "lapservo/testing/scenes.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/marker/azimuths.h"
#include "lapservo/sim/blood.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/tissue.h"

namespace lapservo::scenes {
using namespace internal;
namespace {

struct Port {
  std::array<double, 3> hues_deg;
  Eigen::Vector3d rcm_m, marker_m;  // in the camera
};
const std::array<Port, 3> ports{{{{90, 180, 270}, {-0.078, 0.067, 0.059}, {-0.02, 0.01, 0.1}},
                                 {{180, 270, 90}, {0.103, 0.019, 0.063}, {0.04, 0.0, 0.1}},
                                 {{270, 90, 180}, {-0.02, -0.1, 0.06}, {0.006, -0.03, 0.1}}}};

constexpr double border_px = 30;

// Less than marker_in_view() requires: the apparent contour's ends alone count, by a lens without distortion.
bool wholly_in_view(const Rig& rig, const Marker& marker, const Rigid3& pose, double steepest_rad) {
  const auto view = view_cylinder(pose, marker.radius_m());
  if (!view) return false;
  const double beyond_m = pose.inverse().translation.z() - marker.length_m() / 2;
  if (std::abs(std::atan2(beyond_m, view->camera_to_axis_m)) > steepest_rad) return false;
  for (const double side : {-1.0, 1.0})
    for (const double along_m : {0.0, marker.length_m()}) {
      const Eigen::Vector3d point =
          pose * surface_point(marker.radius_m(), view->facing_azimuth_rad + side * view->half_visible_rad, along_m);
      if (point.z() < 0.04 || !rig.camera.contains(rig.camera.ideal_from_point(point), border_px)) return false;
    }
  return true;
}

}  // namespace

Rig usual_rig(std::size_t instruments) {
  Rig rig{{960, 540, 825, 825, 474.3, 272.8, {}, {}}, {}};
  for (std::size_t i = 0; i < instruments; ++i) {
    const Port& port = ports.at(i);
    const Marker marker{0.0084, port.hues_deg, {0.0035, 0.0035, 0.017}, {0.0095, 0.0095, 0.005}, 0.4};
    // The RCM frame's x axis points to the work space: phi is near pi/2 there.
    const Rigid3 camera_from_rcm{rotation_between(Eigen::Vector3d::UnitX(), port.marker_m - port.rcm_m), port.rcm_m};
    rig.instruments.push_back({"PSM" + std::to_string(i + 1), marker, camera_from_rcm});
  }
  return rig;
}

Rig without_rcm(Rig rig) {
  for (Instrument& instrument : rig.instruments) instrument.camera_from_rcm.reset();
  return rig;
}

Marker scaled_to(Marker marker, double diameter_m) {
  for (auto* bands_m : {&marker.bands_upper_m, &marker.bands_lower_m})
    for (double& band_m : *bands_m) band_m *= diameter_m / marker.diameter_m;
  marker.diameter_m = diameter_m;
  return marker;
}

JointVector random_configuration(const Rig& rig, std::size_t i, Random& random, double steepest_rad) {
  const Instrument& instrument = rig.instruments[i];
  for (int attempt = 0; attempt < 50000; ++attempt) {
    const double v_px = random.uniform(0, rig.camera.height_px);  // a statement each: arguments have no order
    const Eigen::Vector2d pixel(random.uniform(0, rig.camera.width_px), v_px);
    auto q = configuration_through(*instrument.camera_from_rcm,
                                   rig.camera.ray_from_ideal(pixel) * random.uniform(0.075, 0.115));
    if (!q) continue;
    const Rigid3 pose = *instrument.camera_from_rcm * rcm_from_unrolled(*q);
    if (!wholly_in_view(rig, instrument.marker, pose, steepest_rad)) continue;
    q->psi_rad = random.uniform(-pi, pi);
    return *q;
  }
  throw std::logic_error("no configuration of this instrument is wholly in view");
}

std::vector<JointVector> random_configurations(const Rig& rig, Random& random) {
  std::vector<JointVector> all;
  for (std::size_t i = 0; i < rig.instruments.size(); ++i) all.push_back(random_configuration(rig, i, random));
  return all;
}

ShaftPose pose_of(const Rig& rig, std::size_t i, const JointVector& q) {
  return {*rig.instruments[i].camera_from_rcm * rcm_from_unrolled(q), q.psi_rad};
}

Eigen::Vector3d normal_vector(Random& random) {
  return {random.normal(), random.normal(), random.normal()};  // braces: in this order
}

void misregister(Instrument& instrument, double sigma_m, double sigma_rad, Random& random) {
  Rigid3& pose = *instrument.camera_from_rcm;
  pose.translation += sigma_m * normal_vector(random);
  pose.rotation = rotation_by(sigma_rad * normal_vector(random)) * pose.rotation;
  instrument.registration_covariance.emplace().setZero();
  instrument.registration_covariance->diagonal() << Eigen::Vector3d::Constant(sigma_m * sigma_m),
      Eigen::Vector3d::Constant(sigma_rad * sigma_rad);
}

namespace {

// Distance of the first shaft's axis from the second one's, as lines.
double apart_m(const Rigid3& a, const Rigid3& b) {
  const Eigen::Vector3d along_a = a.rotation * Eigen::Vector3d::UnitZ(),
                        along_b = b.rotation * Eigen::Vector3d::UnitZ();
  return std::abs(along_a.cross(along_b).normalized().dot(a.translation - b.translation));
}

// Whether a shaft lies between the camera and a point.
bool hides(const Rigid3& shaft, double radius_m, const Eigen::Vector3d& point) {
  const Rigid3 shaft_from_camera = shaft.inverse();
  const Eigen::Vector2d from = shaft_from_camera.translation.head<2>(), to = (shaft_from_camera * point).head<2>();
  const Eigen::Vector2d way = to - from;
  const double nearest = std::clamp(-from.dot(way) / way.squaredNorm(), 0.0, 1.0);
  return (from + nearest * way).norm() < radius_m;
}

// The fractions of a marker's visible part that the other shaft hides: of the surface, and of e1 or e2, whichever is
// more.
std::array<double, 2> hidden_fractions(const ShaftPose& pose, const Rigid3& other, const Marker& marker) {
  constexpr int lines = 16, places = 24;
  const Rigid3& shaft = pose.camera_from_unrolled;
  const auto view = view_cylinder(shaft, marker.radius_m()).value();
  int hidden = 0;
  std::array<int, 2> hidden_inner{};
  for (int i = 0; i < lines; ++i) {
    const double azimuth_rad = view.facing_azimuth_rad + view.half_visible_rad * (2.0 * (i + 0.5) / lines - 1);
    const auto hides_at = [&](double along_m) {
      return hides(other, marker.radius_m(), shaft * surface_point(marker.radius_m(), azimuth_rad, along_m));
    };
    for (int k = 0; k < places; ++k) hidden += hides_at(marker.length_m() * (k + 0.5) / places);
    const auto ends_m = boundaries_m(marker, marker_azimuth_rad(marker, azimuth_rad, pose.psi_rad));
    for (std::size_t k = 0; k < 2; ++k) hidden_inner[k] += hides_at(ends_m[k + 1]);
  }
  return {static_cast<double>(hidden) / (lines * places),
          static_cast<double>(std::max(hidden_inner[0], hidden_inner[1])) / lines};
}

}  // namespace

CrossingPair crossing_pair(const Rig& rig, Random& random, double steepest_rad) {
  constexpr double near_px = 110;
  const Marker& marker = rig.instruments[0].marker;
  for (;;) {
    CrossingPair pair;
    std::array<Rigid3, 2> shafts;
    std::array<Eigen::Vector2d, 2> middles_px;
    for (std::size_t i = 0; i < 2; ++i) {
      pair.q.push_back(random_configuration(rig, i, random, steepest_rad));
      shafts[i] = pose_of(rig, i, pair.q[i]).camera_from_unrolled;
      middles_px[i] = rig.camera.ideal_from_point(shafts[i] * Eigen::Vector3d(0, 0, marker.length_m() / 2));
    }
    if ((middles_px[0] - middles_px[1]).norm() > near_px || apart_m(shafts[0], shafts[1]) < marker.diameter_m) continue;
    for (std::size_t i = 0; i < 2; ++i) {
      const auto fractions = hidden_fractions(pose_of(rig, i, pair.q[i]), shafts[1 - i], marker);
      pair.hidden[i] = fractions[0], pair.hidden_inner[i] = fractions[1];
    }
    return pair;
  }
}

namespace {

// Made once for each size of images.
cv::Mat usual_tissue(const Camera& camera) {
  static std::mutex mutex;
  static std::map<std::pair<int, int>, cv::Mat> tissues;
  const std::lock_guard lock(mutex);
  cv::Mat& tissue = tissues[{camera.width_px, camera.height_px}];
  if (tissue.empty()) tissue = make_tissue(camera.width_px, camera.height_px, 5);
  return tissue;
}

}  // namespace

cv::Mat render(const Rig& rig, const std::vector<JointVector>& configurations, std::uint64_t seed,
               const RenderOptions& options) {
  std::vector<ShaftModel> shafts;
  std::vector<ShaftPlacement> placements;
  for (std::size_t i = 0; i < configurations.size(); ++i) {
    shafts.push_back(shaft_of(rig.instruments[i]));
    placements.push_back(placement_of(rig.instruments[i], configurations[i]));
  }
  return Renderer(rig.camera, shafts, usual_tissue(rig.camera), options).render(placements, seed);
}

Renderer renderer_of(const Rig& rig, const ShaftModel& shaft) {
  return Renderer(rig.camera, {shaft}, usual_tissue(rig.camera));
}

BloodyMotion::BloodyMotion(const Rig& rig, double fraction, std::uint64_t seed, int count) {
  Random random(seed);
  const JointVector start = random_configuration(rig, 0, random);
  ShaftModel shaft = shaft_of(rig.instruments[0]);
  shaft.blotches = blood_over(shaft.marker, fraction, random);
  Renderer renderer = renderer_of(rig, shaft);
  for (int i = 0; i < count; ++i) {
    q.push_back(start);
    q.back().theta_rad += 1e-3 * i, q.back().psi_rad += 2e-3 * i;
    frames.push_back(renderer.render({placement_of(rig.instruments[0], q.back())}, seed));
  }
}

cv::Mat render_nothing(const Rig& rig, std::uint64_t seed) {
  return Renderer(rig.camera, {}, make_tissue(rig.camera.width_px, rig.camera.height_px, seed)).render({}, seed);
}

Sight::Sight(const Rig& rig, const cv::Mat& bgr)
    : rig_(rig),
      bgr_(bgr),
      view_(bgr_),
      classes_(rig_.instruments),
      table_(rig_.camera.response.table()),
      light_(view_, table_, ChannelGeometry(rig.camera)) {
  for (const Instrument& instrument : rig_.instruments) registrations_.push_back(registration_of(instrument));
}

Scene Sight::scene(std::size_t i) const {
  Scene scene{view_, rig_.camera, classes_, rig_.instruments[i].marker, classes_.of_bands(i)};
  scene.registration = registrations_[i] ? &*registrations_[i] : nullptr;
  return scene;
}

namespace {

JointVector configuration_of_seed(const Rig& rig, std::uint64_t seed) {
  Random random(seed);
  return random_configuration(rig, 0, random);
}

}  // namespace

Shot::Shot(std::uint64_t of_seed, const RenderOptions& options, const Rig& of_rig)
    : seed(of_seed),
      rig(of_rig),
      q(configuration_of_seed(rig, seed)),
      bgr(render(rig, {q}, seed, options)),
      sight(rig, bgr) {}

PoseUnknowns Shot::truth(bool through_rcm) const {
  return {pose_of(rig, 0, q), through_rcm};
}

CentreLine Shot::line() const {
  const ShaftPose pose = pose_of(rig, 0, q);
  return centre_line(rig.camera, rig.instruments[0].marker, pose.camera_from_unrolled, pose.psi_rad).value();
}

double Shot::psi_error_rad(double psi_rad) const {
  return wrap_pi(psi_rad - q.psi_rad);
}

double Shot::psi_error_rad(const PoseUnknowns& unknowns) const {
  return psi_error_rad(q_of(rig, unknowns).psi_rad);
}

const Shot& usual_shot(std::uint64_t seed) {
  static std::map<std::uint64_t, Shot> shots;
  return shots.try_emplace(seed, seed).first->second;
}

JointVector q_of(const Rig& rig, const PoseUnknowns& unknowns) {
  return internal::configuration_of(unknowns.pose(), *rig.instruments[0].camera_from_rcm).value();
}

FineFit fit_from(const Shot& shot, const PoseUnknowns& start) {
  Scene scene = shot.sight.scene();
  if (!start.through_rcm()) scene.registration = nullptr;
  return fit_finely(scene, shot.sight.light(), start, {});
}

}  // namespace lapservo::scenes
