#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include <Eigen/Geometry>

#include "lapservo/crtk/messages.h"

namespace lapservo::internal {

// The fields of messages in the types that are generated from ROS's .msg files, whose members are called alike in ROS 1
// and 2. `each(in_wire, in_message)` puts a field into such a type or takes it from there, and so do header(),
// seconds() (of a time or duration), pose(), list() (element by element) and written() (which is not taken). Fields
// that are not named here stay empty.

inline const std::string no_text;

void set(auto& to, const Eigen::Vector3d& v) {
  to.x = v.x(), to.y = v.y(), to.z = v.z();
}
void set(auto& to, const Eigen::Quaterniond& q) {
  to.x = q.x(), to.y = q.y(), to.z = q.z(), to.w = q.w();
}
void set(auto& to, const Rigid3& pose) {
  set(to.position, pose.translation);
  set(to.orientation, pose.rotation);
}

void fields(auto& each, auto& wire, Is<JointMessage> auto& message) {
  each.header(wire.header, message.stamp_s);
  each(wire.name, message.names);
  each(wire.position, message.positions);
  each.written(wire.velocity, message.velocities);
}

void fields(auto& each, auto& wire, Is<TrajectoryMessage> auto& message) {
  each.header(wire.header, message.stamp_s, message.frame);
  each(wire.joint_names, message.names);
  each.list(wire.points, message.points, [&](auto& to, auto& point) {
    each(to.positions, point.positions);
    each.seconds(to.time_from_start, point.time_s);
  });
}

void fields(auto& each, auto& wire, Is<OperatingStateMessage> auto& message) {
  each.header(wire.header, message.stamp_s);
  each(wire.state, message.state);
  each(wire.is_homed, message.is_homed);
  each(wire.is_busy, message.is_busy);
}

void fields(auto& each, auto& wire, Is<StringMessage> auto& message) {
  each.header(wire.header, message.stamp_s);
  each(wire.string, message.text);
}

void fields(auto& each, auto& wire, Is<TextMessage> auto& message) {
  each(wire.data, message.text);
}

void fields(auto& each, auto& wire, Is<JoyMessage> auto& message) {
  each.header(wire.header, message.stamp_s);
  each(wire.buttons, message.buttons);
}

void fields(auto& each, auto& wire, Is<BoolMessage> auto& message) {
  each(wire.data, message.value);
}

void fields(auto& each, auto& wire, Is<ImageMessage> auto& message) {
  each.header(wire.header, message.stamp_s, message.frame);
  each(wire.height, message.height);
  each(wire.width, message.width);
  each(wire.encoding, message.encoding);
  each(wire.is_bigendian, message.is_bigendian);
  each(wire.step, message.step);
  each(wire.data, message.data);
}

void fields(auto& each, auto& wire, Is<CompressedImageMessage> auto& message) {
  each.header(wire.header, message.stamp_s, message.frame);
  each(wire.format, message.format);
  each(wire.data, message.data);
}

void fields(auto& each, auto& wire, Is<CameraInfoMessage> auto& message) {
  static const std::string model = "plumb_bob";
  each.header(wire.header, message.stamp_s, message.frame);
  each(wire.height, message.height);
  each(wire.width, message.width);
  each(wire.distortion_model, model);
  const auto matrices = [&](auto& d, auto& k, auto& r, auto& p) {
    each(d, message.d);
    each(k, message.k);
    for (const std::size_t i : {0u, 4u, 8u}) r[i] = 1;
    for (std::size_t i = 0; i < 9; ++i) p[i + i / 3] = message.k[i];
  };
  if constexpr (requires { wire.D; }) {  // in ROS 1
    matrices(wire.D, wire.K, wire.R, wire.P);
  } else {
    matrices(wire.d, wire.k, wire.r, wire.p);
  }
}

void fields(auto& each, auto& wire, Is<PoseMessage> auto& message) {
  each.header(wire.header, message.stamp_s, message.frame);
  set(wire.pose.pose.position, Eigen::Vector3d(message.position_m.data()));
  set(wire.pose.pose.orientation, Eigen::Quaterniond(message.quaternion_xyzw.data()));
  each(wire.pose.covariance, message.covariance);
}

void fields(auto& each, auto& wire, Is<PlaceMessage> auto& message) {
  each.header(wire.header, message.stamp_s, message.frame);
  each.pose(wire.pose, message.pose);
}

void fields(auto& each, auto& wire, Is<TransformsMessage> auto& message) {
  each.list(wire.transforms, message.transforms, [&](auto& to, auto& one) {
    each.header(to.header, message.stamp_s, one.frame);
    each(to.child_frame_id, one.child);
    set(to.transform.translation, one.frame_from_child.translation);
    set(to.transform.rotation, one.frame_from_child.rotation);
  });
}

void fields(auto& each, auto& wire, Is<CylindersMessage> auto& message) {
  constexpr std::int32_t cylinder = 3;
  each.list(wire.markers, message.cylinders, [&, id = std::int32_t{0}](auto& to, auto& one) mutable {
    each.header(to.header, message.stamp_s, message.frame);
    each(to.ns, message.name);
    to.id = id++;
    to.type = cylinder;
    each.pose(to.pose, one.frame_from_centre);
    set(to.scale, Eigen::Vector3d(one.diameter_m, one.diameter_m, one.length_m));
    to.color.r = one.rgba[0], to.color.g = one.rgba[1], to.color.b = one.rgba[2], to.color.a = one.rgba[3];
    each.seconds(to.lifetime, CylindersMessage::lifetime_s);
    each(to.text, no_text);
    each(to.mesh_resource, no_text);
    if constexpr (requires { to.mesh_file; }) {  // in ROS 2
      each.header(to.texture.header, 0);
      for (auto* text : {&to.texture.format, &to.texture_resource, &to.mesh_file.filename}) each(*text, no_text);
    }
  });
}

void fields(auto& each, auto& wire, Is<DiagnosticMessage> auto& message) {
  each.header(wire.header, message.stamp_s);
  each.list(wire.status, std::span(&message, 1), [&](auto& to, auto& status) {
    each(to.level, status.level);
    each(to.name, status.name);
    each(to.message, status.message);
    each(to.hardware_id, no_text);
    each.list(to.values, status.values, [&](auto& pair, auto& value) {
      each(pair.key, value.first);
      each(pair.value, value.second);
    });
  });
}

void fields(auto& each, auto& wire, Is<ObservationMessage> auto& message) {
  each.header(wire.header, message.stamp_s, message.frame);
  each(wire.instrument, message.instrument);
  each(wire.status, message.status);
  each(wire.action, message.action);
  each(wire.reason, message.reason);
  each(wire.q, message.q);
  each(wire.q_covariance, message.q_covariance);
  each(wire.features, message.features);
  each(wire.feature_covariance, message.feature_covariance);
  each(wire.edges_px, message.edges_px);
  each(wire.error, message.error);
}

}  // namespace lapservo::internal
