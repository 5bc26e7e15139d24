#include "apps/lapservo/inputs/joint_input.h"

#include <algorithm>
#include <memory>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lapservo/core/csv.h"
#include "lapservo/core/error.h"
#include "lapservo/crtk/joint_map.h"
#include "lapservo/crtk/wrist_history.h"
#include "lapservo/tool/dvrk_tool_file.h"
#include "lapservo/tool/wrist.h"
#include "recordings/bag_joints.h"
#include "recordings/bag_topics.h"
#include "recordings/open_bag.h"

namespace lapservo::app {
using namespace internal;
namespace {

std::vector<std::string> columns_of(const std::string& path) {
  std::vector<std::string> names = CsvTable::read(path).columns();
  std::erase(names, "time_s");
  return names;
}

// Joints as they were recorded: in a bag, else in a table.
struct RecordedJoints {
  std::string source{};  // empty: nowhere
  std::shared_ptr<const Bag> bag{};
  const BagTopic* topic = nullptr;

  RecordedJoints(const RecordingOptions& options, const std::string& arm, const std::vector<std::string>& others = {})
      : source(options.joints) {
    const std::string path = bag_of(options.joints.empty() ? options.input : options.joints);
    if (path.empty()) return;
    bag = open_bag(path);
    if (path != options.input) say_remark(path, bag->remark());
    topic = joint_topic_of(*bag, options.joint_topic, arm, others);
    if (topic) source = path + ": " + topic->name;
  }
  std::vector<std::string> names() const {
    if (topic) return joint_names_in_bag(*bag, *topic);
    return bag || source.empty() ? std::vector<std::string>() : columns_of(source);
  }
  // Reports on stderr what is passed over.
  JointInput read(const Joints& joints, const FrameSource* frames, JointsOf whose) const {
    const auto begin_s = frames ? frames->first_stamp_s() : std::nullopt;
    JointInput input{
        joints,
        topic ? joints_in_bag(*bag, *topic, joints, begin_s, whose) : read_joint_recording(source, joints, whose),
        source};
    say_remark(source, input.recording.remark());
    return input;
  }
};

// A wrist's joints by the names that they are recorded with, repeated up to four.
std::optional<Joints> wrist_joints(const Tool& tool, const std::vector<std::string>& recorded) {
  const std::vector<std::string> names = wrist_names(tool);
  Joints joints;
  for (std::size_t i = 0; i < joints.names.size(); ++i) {
    const auto found = std::ranges::find_if(
        recorded, [&](const std::string& name) { return is_same_joint(name, names[i % names.size()]); });
    if (found == recorded.end()) return std::nullopt;
    joints.names[i] = *found;
  }
  return joints;
}

// Why the rig's image_delay_s is none of the images and joints of this bag; empty where it may be. `images`: null where
// frames have the times of the recorder's clock.
std::string foreign_delay_text(const Instrument& instrument, const Bag& bag, const BagTopic& joints,
                               const BagTopic* images) {
  const double delay_s = instrument.image_delay_s.value_or(0), late_s = delay_s + clock_lead_s(bag, joints, images);
  if (late_s >= WristHistory::earliest_delay_s && late_s <= WristHistory::longest_delay_s) return "";
  return fmt::format(
      "the rig's image_delay_s of {:.3f} s is none of {}: by when joints and images were recorded, images would be "
      "{:.3f} s late, expected 0 to {:.2f} s: lapservo align measures it",
      delay_s, bag.path(), late_s, WristHistory::longest_delay_s);
}

bool share_a_joint(const std::optional<Tool>& a, const std::optional<Tool>& b) {
  const std::vector<std::string> of_a = wrist_names(a), of_b = wrist_names(b);
  return std::any_of(of_a.begin(), of_a.end(), [&](const std::string& name) {
    return std::any_of(of_b.begin(), of_b.end(), [&](const std::string& other) { return is_same_joint(name, other); });
  });
}

bool is_of_other_arm(const std::string& topic, const std::string& arm) {
  return topic.ends_with("/measured_js") && !topic.ends_with("/" + arm + "/measured_js");
}

}  // namespace

WristInput find_wrist_input(const RecordingOptions& options, const Rig& rig, std::size_t index,
                            const FrameSource& frames, bool counts) {
  const Instrument& instrument = rig.instruments[index];
  if (!instrument.tool || instrument.tool->wrist.empty()) return {};
  const RecordedJoints recorded(options, instrument.name);
  const auto found = wrist_joints(*instrument.tool, recorded.names());
  if (!found)
    return {std::nullopt, fmt::format("no readings of the wrist's joints {}: --joints names a recording or topic that "
                                      "has them",
                                      fmt::join(wrist_names(instrument.tool), ", "))};
  const auto& [source, bag, topic] = recorded;
  if (const std::string why = other_wrist_text(source, rig, index); !why.empty()) return {std::nullopt, why};
  WristInput wrist{recorded.read(*found, &frames, JointsOf::wrist), ""};
  if (counts && topic && bag->path() == bag_of(options.input))
    wrist.none = foreign_delay_text(
        instrument, *bag, *topic, bag->path() == options.input ? &image_topic_of(*bag, options.image_topic) : nullptr);
  else if (counts && instrument.image_delay_s)
    say_remark(source, fmt::format("{}'s tip counts the rig's image_delay_s of {:.3f} s, expected that of these two "
                                   "recordings: lapservo align measures it",
                                   instrument.name, *instrument.image_delay_s));
  return wrist;
}

std::vector<double> wrist_at(const WristInput& wrist, const Instrument& instrument, double frame_s) {
  const auto joints = wrist.readings && wrist.none.empty()
                          ? wrist.readings->recording.at(frame_s - instrument.image_delay_s.value_or(0))
                          : std::nullopt;
  if (!joints) return {};
  return {joints->begin(), joints->begin() + static_cast<std::ptrdiff_t>(instrument.tool->wrist.size())};
}

std::string other_wrist_text(const std::string& source, const Rig& rig, std::size_t index) {
  const Instrument& instrument = rig.instruments[index];
  const auto is_of = [&](const Instrument& arm) {
    const std::string topic = arm.name + "/measured_js";
    return source.ends_with("/" + topic) || source.ends_with(":" + topic);
  };
  if (is_of(instrument) || wrist_names(instrument.tool).empty()) return "";
  for (const Instrument& other : rig.instruments)
    if (&other != &instrument && (is_of(other) || share_a_joint(other.tool, instrument.tool)))
      return fmt::format(
          "{} may have the joints of {}, expected a topic .../{}/measured_js, or wrists whose joints have different "
          "names",
          source, other.name, instrument.name);
  return "";
}

std::string no_tip_text(const Instrument& instrument, const WristInput& wrist) {
  if (!instrument.tool) return "";
  if (!instrument.tool->place)
    return "the rig does not say where the tool sits behind the marker: lapservo calibrate tip measures it";
  return wrist.none;
}

void say_axis_tip(const Instrument& instrument) {
  if (instrument.tool) say_remark(instrument.name, axis_tip_text(*instrument.tool));
}

void WristInput::add(const Observation& observation, double time_s) {
  if (!observation.marker) return;
  if (!first_s) first_s = time_s;
  last_s = time_s, has_tip |= observation.tip.has_value();
}

std::string no_reading_text(const Instrument& instrument, const WristInput& wrist) {
  if (!wrist.readings || !no_tip_text(instrument, wrist).empty() || !wrist.first_s || wrist.has_tip) return "";
  const std::vector<double>& times_s = wrist.readings->recording.time_s;
  const double delay_s = instrument.image_delay_s.value_or(0);
  return fmt::format(
      "{} has no readings around the frames with the marker: they run from {:.2f} to {:.2f} s by its clock, it from "
      "{:.2f} to {:.2f} s: subtract what time_s has more, or correct the rig's image_delay_s",
      wrist.readings->source, *wrist.first_s - delay_s, wrist.last_s - delay_s, times_s.front(), times_s.back());
}

void add_joint_options(Command command, RecordingOptions& options, const std::string& help) {
  command.add_option("--joints", options.joints, help);
  add_joint_topic_option(command, options.joint_topic);
}

void add_joint_topic_option(Command command, std::string& joint_topic) {
  command.add_option("--joint-topic", joint_topic,
                     "In a bag with several: the topic of the arm's measured joints; else .../INSTRUMENT/measured_js, "
                     "or the only measured_js");
}

void refuse_idle_joint_topic(const RecordingOptions& options) {
  const std::string& source = options.joints.empty() ? options.input : options.joints;
  if (bag_of(source).empty()) refuse_topic_outside_bags("--joint-topic", options.joint_topic, source);
}

std::optional<JointInput> find_joint_input(const RecordingOptions& options, const Rig& rig, std::size_t index,
                                           const FrameSource* frames) {
  refuse_idle_joint_topic(options);
  const Instrument& instrument = rig.instruments[index];
  std::vector<std::string> others;
  for (const Instrument& other : rig.instruments)
    if (&other != &instrument) others.push_back(other.name);
  const RecordedJoints recorded(options, instrument.name, others);
  if (recorded.source.empty()) return std::nullopt;
  if (recorded.bag && !recorded.topic)
    throw InputError(options.joints, std::string("has no messages of ") + joint_type + ", expected the joints'");
  if (recorded.topic && options.joint_topic.empty() && is_of_other_arm(recorded.topic->name, instrument.name))
    say_remark(recorded.source, "its joints count as those of " + instrument.name + ": --joint-topic names others");
  const bool are_known = !recorded.topic && instrument.joints;  // a pipe is read once
  const Joints joints =
      joints_of(instrument, are_known ? std::vector<std::string>() : recorded.names(), recorded.source, options.rig);
  return recorded.read(joints, frames, JointsOf::arm);
}

}  // namespace lapservo::app
