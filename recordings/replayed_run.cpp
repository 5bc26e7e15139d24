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

ReplayedRun::ReplayedRun(std::unique_ptr<FrameSource> frames, const Bag& bag, const BagTopic* images,
                         const std::string& joint_topic, const Instrument& instrument,
                         std::optional<JointRecording> wrist)
    : frames_(std::move(frames)), wrist_(std::move(wrist)), wrist_joints_(wrist_names(instrument.tool).size()) {
  const double begin_s = frames_->first_stamp_s().value();
  const Joints& joints = instrument.joints.value();
  const BagTopic* of_arm = joint_topic_of(bag, joint_topic, instrument.name);
  if (!of_arm)
    throw InputError(bag.path(), std::string("has no messages of ") + joint_type + ", expected the arm's joints");
  joints_ = joints_in_bag(bag, *of_arm, joints, begin_s);
  lead_s_ = clock_lead_s(bag, *of_arm, images);
  for (std::size_t i = 0; i < joints_.time_s.size(); ++i) {
    joints_.time_s[i] -= lead_s_;
    const Eigen::Vector4d positions(joints_.joints[i].data());
    all_readings_.push_back({joints_.time_s[i], JointVector::from_vector(q_from_joints(joints, positions))});
  }
  now_s_ = std::max(0.0, joints_.time_s.front());
  readings();
  next_frame_ = frames_->next();
  duration_s_ = joints_.time_s.back() - now_s_;
  if (!(duration_s_ > 0))
    throw InputError(bag.path(),
                     fmt::format("its joints end {:.3f} s before its first image, expected both at one time",
                                 -joints_.time_s.back()));
}

std::vector<JointReading> ReplayedRun::readings() {
  std::vector<JointReading> since;
  for (; next_reading_ < all_readings_.size() && all_readings_[next_reading_].time_s <= now_s_; ++next_reading_)
    since.push_back(all_readings_[next_reading_]);
  return since;
}

JointState ReplayedRun::state() {
  const JointReading& latest = all_readings_[std::max<std::size_t>(next_reading_, 1) - 1];
  const bool known = now_s_ - latest.time_s <= InterlockConfig().max_age_s;
  JointState state{latest.time_s, latest.q, known ? OperatingState::enabled : OperatingState::disabled, false};
  if (const auto read = wrist_ ? wrist_->at(latest.time_s + lead_s_) : std::nullopt)
    state.wrist_rad.assign(read->begin(), read->begin() + static_cast<std::ptrdiff_t>(wrist_joints_));
  return state;
}

std::optional<StampedImage> ReplayedRun::newest() {
  std::optional<StampedImage> newest;
  for (; next_frame_ && next_frame_->time_s <= now_s_; next_frame_ = frames_->next(), ++images_given_)
    if (!next_frame_->flaw) newest = StampedImage{next_frame_->time_s, next_frame_->bgr};
  return newest;
}

}  // namespace lapservo::internal
