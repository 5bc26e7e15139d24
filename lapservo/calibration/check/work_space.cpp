#include "lapservo/calibration/check/work_space.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "lapservo/core/angles.h"
#include "lapservo/core/statistics.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/kinematics/visibility.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/renderer.h"
#include "lapservo/sim/tissue.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::internal {
namespace {

// The one instrument, each frame on its own.
class Judge {
 public:
  Judge(const Rig& rig, std::size_t instrument)
      : rig_(only(rig, instrument)),
        tracker_(rig_, {.single = true}),
        renderer_(rig_.camera, shafts_of(rig_), make_tissue(rig_.camera.width_px, rig_.camera.height_px, 1)) {}

  // Nullopt where it is not found.
  std::optional<double> sigma_rad(const Rigid3& camera_from_unrolled, double psi_rad) {
    const cv::Mat picture = renderer_.render({{camera_from_unrolled, psi_rad}}, ++seed_);
    const Observation& seen = tracker_.track(picture)[0];
    if (seen.status != Status::ok || !seen.marker) return std::nullopt;
    return seen.marker->sigma_roll_rad;
  }
  const Instrument& instrument() const { return rig_.instruments[0]; }
  const Camera& camera() const { return rig_.camera; }

 private:
  static Rig only(Rig rig, std::size_t instrument) {
    rig.instruments = {rig.instruments[instrument]};
    return rig;
  }

  Rig rig_;
  Tracker tracker_;
  Renderer renderer_;
  std::uint64_t seed_ = 0;
};

// A shaft whose marker's proximal end lies there.
std::optional<Rigid3> shaft_at(const Judge& judge, const Eigen::Vector3d& place, const MeasuredSigma& like) {
  const auto& camera_from_rcm = judge.instrument().camera_from_rcm;
  if (!camera_from_rcm) return Rigid3{like.camera_from_unrolled.rotation, place};
  const auto q = configuration_through(*camera_from_rcm, place);
  if (!q) return std::nullopt;
  return *camera_from_rcm * rcm_from_unrolled(*q);
}

double real_over_rendered(Judge& judge, const std::vector<MeasuredSigma>& measured) {
  constexpr std::size_t enough = 12;
  std::vector<double> ratios;
  const std::size_t step = std::max<std::size_t>(1, measured.size() / enough);
  for (std::size_t i = 0; i < measured.size(); i += step) {
    // Through the RCM, as the rig has it: a pose by the image alone misses it, and would be fitted otherwise.
    const Rigid3& marker = measured[i].camera_from_unrolled;
    const auto shaft = shaft_at(judge, marker.translation, measured[i]);
    if (!shaft) continue;
    const Eigen::Vector3d x = shaft->rotation.conjugate() * (marker.rotation * Eigen::Vector3d::UnitX());
    if (const auto rendered = judge.sigma_rad(*shaft, measured[i].psi_rad + std::atan2(x.y(), x.x())))
      ratios.push_back(measured[i].sigma_rad / *rendered);
  }
  return ratios.empty() ? 1 : median(ratios);
}

// A shaft whose marker's middle lies there, where the marker is wholly in view.
std::optional<Rigid3> shaft_in_view(const Judge& judge, const Eigen::Vector3d& middle, const MeasuredSigma& like) {
  const Marker& marker = judge.instrument().marker;
  auto shaft = shaft_at(judge, middle, like);
  if (!shaft) return std::nullopt;
  const Eigen::Vector3d axis = shaft->rotation * Eigen::Vector3d::UnitZ();
  shaft = shaft_at(judge, middle - marker.length_m() / 2 * axis, like);
  if (!shaft || !marker_in_view(judge.camera(), marker, *shaft, {.steepest_rad = 1.2, .border_px = 2}))
    return std::nullopt;
  return shaft;
}

// The median over rotations, of which those that are not found count as the worst; nullopt where most are not.
std::optional<double> sigma_at(Judge& judge, const Rigid3& shaft) {
  constexpr std::size_t turns = 3;
  constexpr double not_found = std::numeric_limits<double>::infinity();
  std::array<double, turns> sigmas_rad;
  for (std::size_t i = 0; i < turns; ++i)
    sigmas_rad[i] = judge.sigma_rad(shaft, two_pi * static_cast<double>(i) / turns).value_or(not_found);
  std::sort(sigmas_rad.begin(), sigmas_rad.end());
  return sigmas_rad[turns / 2] < not_found ? std::optional(sigmas_rad[turns / 2]) : std::nullopt;
}

// Near and far of where the marker's middle was, where it was measured.
std::vector<double> depths_of(const std::vector<TimedPose>& poses, double length_m) {
  auto depths_m =
      values_of(poses, [=](const TimedPose& pose) { return (pose.origin() + length_m / 2 * pose.axis()).z(); });
  std::sort(depths_m.begin(), depths_m.end());
  const std::size_t tenth = depths_m.size() / 10;
  return {depths_m[tenth], depths_m[depths_m.size() - 1 - tenth]};
}

// The poses at which the rig's own tracker measured, with its sigmas.
std::vector<MeasuredSigma> measured_sigmas(const RigEvidence& evidence, const Marker& marker) {
  std::vector<MeasuredSigma> measured;
  auto frame = evidence.frames().begin();
  for (const TimedPose& pose : evidence.poses()) {
    while (frame != evidence.frames().end() && frame->time_s < pose.time_s) ++frame;
    if (frame == evidence.frames().end() || frame->status != Status::ok) continue;
    // The marker's own frame is an unrolled one, too: x towards tau = 0, where psi + seam is 0.
    measured.push_back({pose.marker.camera_from_marker, -marker.seam_rad, frame->sigma_roll_rad});
  }
  return measured;
}

}  // namespace

std::vector<SigmaMap> sigma_maps(const Rig& rig, std::size_t instrument, const std::vector<double>& depths_m,
                                 const std::vector<MeasuredSigma>& measured) {
  Judge judge(rig, instrument);
  const double scale = real_over_rendered(judge, measured);
  std::vector<SigmaMap> maps;
  for (const double depth_m : depths_m) {
    SigmaMap map;
    map.depth_m = depth_m;
    for (int row = 0; row < SigmaMap::rows; ++row)
      for (int column = 0; column < SigmaMap::columns; ++column) {
        const Eigen::Vector2d raw_px((column + 0.5) / SigmaMap::columns * rig.camera.width_px,
                                     (row + 0.5) / SigmaMap::rows * rig.camera.height_px);
        const auto ideal_px = rig.camera.ideal_from_raw(raw_px);
        if (!ideal_px) continue;
        const auto shaft =
            shaft_in_view(judge, depth_m * rig.camera.ray_from_ideal(*ideal_px), measured[measured.size() / 2]);
        if (!shaft) continue;
        const auto cell = static_cast<std::size_t>(row * SigmaMap::columns + column);
        const auto sigma_rad = sigma_at(judge, *shaft);
        map.lost[cell] = !sigma_rad;
        if (sigma_rad) map.sigma_rad[cell] = scale * *sigma_rad;
      }
    maps.push_back(map);
  }
  return maps;
}

std::optional<WorkSpace> survey_work_space(const Rig& rig, std::size_t instrument, const RigEvidence& evidence) {
  const auto measured = measured_sigmas(evidence, rig.instruments[instrument].marker);
  if (measured.empty()) return std::nullopt;
  WorkSpace work_space;
  work_space.maps =
      sigma_maps(rig, instrument, depths_of(evidence.poses(), rig.instruments[instrument].marker.length_m()), measured);
  int good = 0;
  for (const SigmaMap& map : work_space.maps) {
    const auto lost = static_cast<int>(std::count(map.lost.begin(), map.lost.end(), true));
    work_space.places += lost, work_space.lost += lost;
    for (const auto& sigma_rad : map.sigma_rad) {
      if (!sigma_rad) continue;
      ++work_space.places, good += *sigma_rad <= rig_limits.sigma_rad;
      work_space.worst_rad = std::max(work_space.worst_rad, *sigma_rad);
    }
  }
  if (work_space.places > 0) work_space.good = static_cast<double>(good) / work_space.places;
  return work_space;
}

}  // namespace lapservo::internal
