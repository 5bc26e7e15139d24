#include "lapservo/loop_topics/frame_topics.h"

#include <algorithm>
#include <array>

#include <Eigen/Geometry>

#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/marker/drawing.h"

namespace lapservo::internal {
namespace {

Rigid3 camera_from_marker_at(const Instrument& instrument, const JointVector& q) {
  return camera_from_marker(instrument.marker, *instrument.camera_from_rcm, q);
}

PoseMessage message_of(const Rigid3& pose, const Eigen::Matrix<double, 6, 6>& covariance) {
  PoseMessage message;
  message.position_m = {pose.translation.x(), pose.translation.y(), pose.translation.z()};
  message.quaternion_xyzw = {pose.rotation.x(), pose.rotation.y(), pose.rotation.z(), pose.rotation.w()};
  std::copy(covariance.data(), covariance.data() + covariance.size(), message.covariance.begin());  // symmetric
  return message;
}

std::string with_name(std::string frame, const std::string& instrument) {
  const std::size_t at = frame.find("NAME");
  return at == std::string::npos ? frame : frame.replace(at, 4, instrument);
}

// A band's ends are where its boundaries are on average over the azimuths.
std::vector<CylindersMessage::Cylinder> cylinders_of(const Instrument& instrument, const Rigid3& camera_from_marker,
                                                     const std::optional<JointVector>& q) {
  constexpr std::array<float, 4> steel{0.6f, 0.6f, 0.6f, 1};
  const Marker& marker = instrument.marker;
  std::vector<CylindersMessage::Cylinder> cylinders;
  double end_m = 0;
  const auto add = [&](double from_m, double to_m, const std::array<float, 4>& rgba) {
    const Rigid3 centre{Eigen::Quaterniond::Identity(), {0, 0, (from_m + to_m) / 2}};
    cylinders.push_back({camera_from_marker * centre, marker.diameter_m, to_m - from_m, rgba});
  };
  for (std::size_t band = 0; band < 3; ++band) {
    const double begin_m = end_m;
    end_m += (marker.bands_upper_m[band] + marker.bands_lower_m[band]) / 2;
    const PrintColour colour = print_colour(marker.hues_deg[band]);
    add(begin_m, end_m, {static_cast<float>(colour.r), static_cast<float>(colour.g), static_cast<float>(colour.b), 1});
  }
  if (q && q->rho_m > 0) add(-q->rho_m, 0, steel);
  return cylinders;
}

}  // namespace

PoseMessage pose_message(const Instrument& instrument, const Observation::Rcm& seen) {
  const Rigid3 pose = camera_from_marker_at(instrument, seen.q);
  Eigen::Matrix<double, 6, 4> jacobian;
  constexpr double step = 1e-6;
  for (int i = 0; i < 4; ++i) {
    const Rigid3 moved =
        camera_from_marker_at(instrument, JointVector::from_vector(seen.q.vector() + step * Eigen::Vector4d::Unit(i)));
    const Eigen::AngleAxisd turn(moved.rotation * pose.rotation.conjugate());
    jacobian.col(i) << (moved.translation - pose.translation) / step, turn.axis() * (turn.angle() / step);
  }
  return message_of(pose, jacobian * seen.covariance * jacobian.transpose());
}

PoseMessage pose_message(const Observation::MarkerPose& seen) {
  return message_of(seen.camera_from_marker, seen.covariance);
}

FrameTopics::FrameTopics(Transport& transport, const Rig& rig, const FrameNames& names, bool rcm_moves)
    : transport_(transport),
      names_(names),
      rcm_moves_(rcm_moves),
      moving_(transport.publisher<TransformsMessage>("/tf")),
      resting_(transport.publisher<StaticTransformsMessage>("/tf_static")) {
  for (const Instrument& instrument : rig.instruments) {
    const std::string& name = instrument.name;
    const std::string topics = "/lapservo/" + name + "/";
    told_.push_back({instrument,
                     {names.camera, with_name(names.rcm, name), with_name(names.marker, name),
                      with_name(names.shaft, name), with_name(names.tip, name)},
                     transport.publisher<PoseMessage>(topics + "pose"),
                     instrument.tool ? transport.publisher<PoseMessage>(topics + "tip_cp") : nullptr,
                     transport.publisher<CylindersMessage>(topics + "markers")});
  }
  if (rcm_moves) return;
  StaticTransformsMessage message;  // one: subscribers that come later get the last one only
  message.stamp_s = transport_.stamp_now_s();
  for (const Told& one : told_)
    if (one.instrument.camera_from_rcm)
      message.transforms.push_back({one.names.camera, one.names.rcm, *one.instrument.camera_from_rcm});
  if (!message.transforms.empty()) resting_(message);
}

void FrameTopics::publish(std::size_t index, const Observation& seen, const std::optional<Rigid3>& camera_from_rcm,
                          double stamp_s) {
  Told& told = told_.at(index);
  TransformsMessage frames{stamp_s, {}};
  if (camera_from_rcm) told.instrument.camera_from_rcm = camera_from_rcm;
  if (camera_from_rcm && rcm_moves_) frames.transforms.push_back({told.names.camera, told.names.rcm, *camera_from_rcm});
  const bool has_q = seen.rcm && camera_from_rcm;
  if (seen.status != Status::ok || (!has_q && !seen.marker)) {
    if (!frames.transforms.empty()) moving_(frames);
    return;
  }
  PoseMessage pose = seen.marker ? pose_message(*seen.marker) : pose_message(told.instrument, *seen.rcm);
  pose.stamp_s = stamp_s;
  pose.frame = told.names.camera;
  told.pose(pose);
  const Rigid3 camera_from_marker =
      seen.marker ? seen.marker->camera_from_marker : camera_from_marker_at(told.instrument, seen.rcm->q);
  frames.transforms.push_back({told.names.camera, told.names.marker, camera_from_marker});
  std::optional<JointVector> q;
  if (has_q) {
    q = seen.rcm->q;
    Rigid3 rcm_from_shaft = rcm_from_unrolled(*q);
    rcm_from_shaft.rotation = rcm_from_shaft.rotation * Eigen::AngleAxisd(q->psi_rad, Eigen::Vector3d::UnitZ());
    rcm_from_shaft.translation.setZero();
    frames.transforms.push_back({told.names.camera, told.names.shaft, *camera_from_rcm * rcm_from_shaft});
  }
  if (seen.tip && told.tip) {
    PoseMessage tip = message_of(seen.tip->camera_from_tip, seen.tip->covariance);
    tip.stamp_s = stamp_s, tip.frame = told.names.camera;
    told.tip(tip);
    frames.transforms.push_back({told.names.camera, told.names.tip, seen.tip->camera_from_tip});
  }
  moving_(frames);
  told.markers(
      {stamp_s, told.names.camera, told.instrument.name, cylinders_of(told.instrument, camera_from_marker, q)});
}

}  // namespace lapservo::internal
