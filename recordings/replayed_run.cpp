#include "recordings/replayed_run.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include <fmt/format.h>

#include "lapservo/core/error.h"
#include "lapservo/crtk/interlock.h"
#include "lapservo/rig/joint_conversion.h"
#include "lapservo/tool/wrist.h"
#include "recordings/bag_joints.h"
#include "recordings/bag_topics.h"

namespace lapservo::internal {

ReplayedRun::RecordedArm::RecordedArm(const ShiftedJoints& joints, const Instrument& instrument,
                                      std::optional<JointRecording> of_wrist, const Clock& of_run)
    : clock(of_run),
      wrist(std::move(of_wrist)),
      wrist_joints(wrist_names(instrument.tool).size()),
      lead_s(joints.lead_s) {
  const JointRecording& recording = joints.recording;
  for (std::size_t i = 0; i < recording.time_s.size(); ++i) {
    const Eigen::Vector4d positions(recording.joints[i].data());
    all.push_back({recording.time_s[i], JointVector::from_vector(q_from_joints(*instrument.joints, positions))});
  }
  readings();
}

std::vector<JointReading> ReplayedRun::RecordedArm::readings() {
  std::vector<JointReading> since;
  for (; next < all.size() && all[next].time_s <= clock.now_s(); ++next) since.push_back(all[next]);
  return since;
}

JointState ReplayedRun::RecordedArm::state() {
  const JointReading& latest = all[std::max<std::size_t>(next, 1) - 1];
  const bool known = clock.now_s() - latest.time_s <= InterlockConfig().max_age_s;
  JointState state{latest.time_s, latest.q, known ? OperatingState::enabled : OperatingState::disabled, false};
  if (const auto read = wrist ? wrist->at(latest.time_s + lead_s) : std::nullopt)
    state.wrist_rad.assign(read->begin(), read->begin() + static_cast<std::ptrdiff_t>(wrist_joints));
  return state;
}

std::optional<StampedImage> ReplayedRun::RecordedImages::newest() {
  std::optional<StampedImage> newest;
  for (; next && next->time_s <= clock.now_s(); next = frames.next(), ++count)
    if (!next->flaw) newest = StampedImage{next->time_s, next->bgr};
  return newest;
}

ReplayedRun::ShiftedJoints ReplayedRun::joints_of_bag(const Bag& bag, const BagTopic* images, double begin_s,
                                                      const std::string& topic, const std::string& arm,
                                                      const Joints& joints) {
  const BagTopic* of_arm = joint_topic_of(bag, topic, arm);
  if (!of_arm)
    throw InputError(bag.path(), std::string("has no messages of ") + joint_type + ", expected the arm's joints");
  ShiftedJoints shifted{joints_in_bag(bag, *of_arm, joints, begin_s), clock_lead_s(bag, *of_arm, images)};
  for (double& time_s : shifted.recording.time_s) time_s -= shifted.lead_s;
  return shifted;
}

ReplayedRun::ReplayedRun(std::unique_ptr<FrameSource> frames, const Bag& bag, const BagTopic* images,
                         const std::string& joint_topic, const Instrument& instrument,
                         std::optional<JointRecording> wrist)
    : frames_(std::move(frames)),
      joints_(joints_of_bag(bag, images, frames_->first_stamp_s().value(), joint_topic, instrument.name,
                            instrument.joints.value())),
      clock_(std::max(0.0, joints_.recording.time_s.front())),
      arm_(joints_, instrument, std::move(wrist), clock_),
      images_(*frames_, clock_) {
  duration_s_ = joints_.recording.time_s.back() - clock_.now;
  if (!(duration_s_ > 0))
    throw InputError(bag.path(),
                     fmt::format("its joints end {:.3f} s before its first image, expected both at one time",
                                 -joints_.recording.time_s.back()));
}

}  // namespace lapservo::internal
