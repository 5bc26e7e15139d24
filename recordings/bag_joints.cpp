#include "recordings/bag_joints.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <variant>

#include <fmt/format.h>

#include "lapservo/control/wild_joints.h"
#include "lapservo/core/error.h"
#include "lapservo/crtk/joint_map.h"
#include "recordings/stamped_messages.h"

namespace lapservo::internal {
namespace {

// Nullopt where the message lacks one of them: several arms may share a topic.
std::optional<std::array<double, 4>> chosen(const JointMessage& message, const Joints& joints,
                                            const std::string& source) {
  if (const std::string twice = repeated_joint(joints, message.names); !twice.empty())
    throw InputError(source, fmt::format("names the joint {} twice in a message, expected each name once", twice));
  const auto places = find_joints(joints, message.names);
  if (!places) return std::nullopt;
  std::array<double, 4> values{};
  for (std::size_t i = 0; i < values.size(); ++i) {
    if ((*places)[i] >= message.positions.size()) return std::nullopt;
    values[i] = message.positions[(*places)[i]];
  }
  return values;
}

// Drivers that stamp by the time since the computer's start give small numbers.
void check_clock(const JointRecording& recording, double begin_s, const std::string& source) {
  constexpr double least_since_1970_s = 1e9;
  const double joints_s = recording.time_s.front() + begin_s;
  const bool images_by_start = begin_s < least_since_1970_s;
  if (images_by_start == (joints_s < least_since_1970_s)) return;
  throw InputError(source,
                   fmt::format("is stamped from {:.0f} s on, but the images from {:.0f} s: the {} are stamped by "
                               "the time since a computer's start, expected both since 1970 (let the driver stamp "
                               "by ROS's clock, and record again)",
                               joints_s, begin_s, images_by_start ? "images" : "joints"));
}

// Two arms on one topic are each where the other can't have come from.
void expect_one_arm(const JointRecording& recording, JointsOf whose, const std::string& source) {
  constexpr std::size_t least = 10, one_of = 20;  // some wild readings are those of a bad encoder
  WildJoints joints({2, 2, whose == JointsOf::arm ? 0.3 : 6, 6});
  std::size_t apart = 0;
  for (std::size_t i = 0; i < recording.time_s.size(); ++i)
    apart += joints.validate(recording.time_s[i], Eigen::Vector4d(recording.joints[i].data())) !=
             WildJoints::Verdict::plausible;
  if (apart < least || one_of * apart < recording.time_s.size()) return;
  throw InputError(source,
                   fmt::format("goes back and forth, in {} of {} readings farther than an arm moves: two arms publish "
                               "there, expected one (record each of them on a topic of its own)",
                               apart, recording.time_s.size()));
}

// The lead of a topic's stamps over the recorder's clock.
double lead_s(const Bag& bag, const BagTopic& topic) {
  constexpr int enough = 60;
  StampedMessages messages(bag.messages(topic));
  std::optional<double> lead_s;
  for (int i = 0; i < enough; ++i) {
    const auto message = messages.next();
    if (!message) break;
    const double of_message_s = message->time_s - message->recorded_s;
    lead_s = std::max(lead_s.value_or(of_message_s), of_message_s);
  }
  return lead_s.value_or(0);
}

}  // namespace

double clock_lead_s(const Bag& bag, const BagTopic& joints, const BagTopic* images) {
  return lead_s(bag, joints) - (images ? lead_s(bag, *images) : 0);
}

std::vector<std::string> joint_names_in_bag(const Bag& bag, const BagTopic& topic) {
  const auto messages = bag.messages(topic);
  while (const auto message = messages->next()) {
    const auto* reading = std::get_if<JointMessage>(&*message);
    if (!reading || !reading->names.empty()) return reading ? reading->names : std::vector<std::string>();
  }
  return {};
}

JointRecording joints_in_bag(const Bag& bag, const BagTopic& topic, const Joints& joints, std::optional<double> begin_s,
                             JointsOf whose) {
  const std::string source = bag.path() + ": " + topic.name;
  JointRecording recording;
  std::vector<std::string> other_names;  // of the latest message of another arm
  StampedMessages messages(bag.messages(topic), [&](const BagMessage& message) {
    const auto* reading = std::get_if<JointMessage>(&message);
    if (!reading || chosen(*reading, joints, source)) return true;
    if (reading->names.empty()) return ++recording.no_numbers, false;  // dVRK 2.4 before the arm is homed
    ++recording.of_other_arms;
    other_names = reading->names;
    return false;
  });
  double first_s = 0;
  while (const auto message = messages.next()) {
    const auto values = *chosen(std::get<JointMessage>(message->message), joints, source);
    if (std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); })) {
      if (recording.time_s.empty()) first_s = begin_s.value_or(message->time_s);
      recording.time_s.push_back(message->time_s - first_s);
      recording.joints.push_back(values);
    } else {
      ++recording.no_numbers;
    }
  }
  recording.repeated = messages.repeated();
  recording.left_out = messages.left_out() - messages.repeated();
  recording.steps = messages.steps(), recording.steps_by_gap = messages.steps_by_gap();
  if (recording.time_s.empty() && recording.of_other_arms > 0)
    throw InputError(source, "has no positions of the rig's joints: it " + unfit_joints(joints, other_names));
  if (recording.time_s.size() < 2)
    throw InputError(source, fmt::format("has {} readings that are numbers with a stamp, expected two or more",
                                         recording.time_s.size()));
  if (begin_s) check_clock(recording, *begin_s, source);
  check_units(recording, joints, source, whose);
  expect_one_arm(recording, whose, source);
  return recording;
}

}  // namespace lapservo::internal
