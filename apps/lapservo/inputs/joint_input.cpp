#include "apps/lapservo/inputs/joint_input.h"

#include <algorithm>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "apps/lapservo/inputs/frame_input.h"
#include "lapservo/core/csv.h"
#include "lapservo/core/error.h"
#include "lapservo/crtk/joint_map.h"
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

// Reports on stderr what is passed over.
JointInput reported(JointInput input) {
  say_remark(input.source, input.recording.remark());
  return input;
}

JointInput read_table(const CalibrateOptions& options, const Instrument& instrument) {
  refuse_topic_outside_bags("--joint-topic", options.joint_topic, options.joints);
  const Joints joints =
      joints_of(instrument, instrument.joints ? std::vector<std::string>() : columns_of(options.joints), options.joints,
                options.rig);
  return reported({joints, read_joint_recording(options.joints, joints), options.joints});
}

JointInput read_topic(const CalibrateOptions& options, const Instrument& instrument, const FrameSource* frames,
                      const Bag& bag, const BagTopic& topic) {
  const auto begin_s = frames ? frames->first_stamp_s() : std::nullopt;
  const Joints joints =
      joints_of(instrument, joint_names_in_bag(bag, topic), bag.path() + ": " + topic.name, options.rig);
  return reported({joints, joints_in_bag(bag, topic, joints, begin_s), bag.path()});
}

// A wrist's joints by the names that they are recorded with, repeated up to four.
std::optional<Joints> wrist_joints(const Tool& tool, const std::vector<std::string>& recorded) {
  const std::vector<std::string> names = wrist_names(tool);
  Joints joints;
  for (std::size_t i = 0; i < joints.names.size(); ++i) {
    const auto found = std::find_if(recorded.begin(), recorded.end(), [&](const std::string& name) {
      return is_same_joint(name, names[i % names.size()]);
    });
    if (found == recorded.end()) return std::nullopt;
    joints.names[i] = *found;
  }
  return joints;
}

std::optional<JointInput> read_wrist_topic(const std::string& path, const std::string& joint_topic,
                                           const Instrument& instrument, const FrameSource* frames) {
  const auto bag = open_bag(path);
  const BagTopic* topic = joint_topic_of(*bag, joint_topic, instrument.name);
  const auto joints = topic ? wrist_joints(*instrument.tool, joint_names_in_bag(*bag, *topic)) : std::nullopt;
  if (!joints) return std::nullopt;
  return JointInput{*joints, joints_in_bag(*bag, *topic, *joints, frames ? frames->first_stamp_s() : std::nullopt),
                    path};
}

}  // namespace

std::optional<JointInput> find_wrist_input(const std::string& input, const std::string& joints,
                                           const std::string& joint_topic, const Instrument& instrument,
                                           const FrameSource* frames) {
  if (!instrument.tool || instrument.tool->wrist.empty()) return std::nullopt;
  const std::string& source = joints.empty() ? input : joints;
  if (const std::string bag = bag_of(source); !bag.empty())
    return read_wrist_topic(bag, joint_topic, instrument, frames);
  const auto named = joints.empty() ? std::nullopt : wrist_joints(*instrument.tool, columns_of(joints));
  if (!named) return std::nullopt;
  return JointInput{*named, read_joint_recording(joints, *named), joints};
}

std::vector<double> wrist_at(const std::optional<JointInput>& wrist, const Instrument& instrument, double frame_s) {
  const auto joints = wrist ? wrist->recording.at(frame_s - instrument.image_delay_s.value_or(0)) : std::nullopt;
  if (!joints) return {};
  return {joints->begin(), joints->begin() + static_cast<std::ptrdiff_t>(instrument.tool->wrist.size())};
}

std::string no_tip_text(const Instrument& instrument, bool wrist_is_read) {
  if (!instrument.tool) return "";
  if (!instrument.tool->place)
    return "the rig does not say where the tool sits behind the marker: lapservo calibrate tip measures it";
  if (instrument.tool->wrist.empty() || wrist_is_read) return "";
  return fmt::format("no readings of the wrist's joints {}: --joints names a recording or topic that has them",
                     fmt::join(wrist_names(instrument.tool), ", "));
}

void add_joint_options(Command command, CalibrateOptions& options, const std::string& help) {
  command.add_option("--joints", options.joints, help);
  add_joint_topic_option(command, options.joint_topic);
}

void add_joint_topic_option(Command command, std::string& joint_topic) {
  command.add_option("--joint-topic", joint_topic,
                     "In a bag with several: the topic of the arm's measured joints; else .../INSTRUMENT/measured_js, "
                     "or the only measured_js");
}

std::optional<JointInput> find_joint_input(const CalibrateOptions& options, const Instrument& instrument,
                                           const FrameSource* frames) {
  const bool are_named = !options.joints.empty();
  const std::string path = bag_of(are_named ? options.joints : options.input);
  if (path.empty() && are_named) return read_table(options, instrument);
  if (path.empty()) {
    refuse_topic_outside_bags("--joint-topic", options.joint_topic, options.input);
    return std::nullopt;
  }
  const auto bag = open_bag(path);
  if (path != options.input) say_remark(path, bag->remark());
  const BagTopic* topic = joint_topic_of(*bag, options.joint_topic, instrument.name);
  if (!topic && are_named)
    throw InputError(options.joints, std::string("has no messages of ") + joint_type + ", expected the joints'");
  if (!topic) return std::nullopt;
  return read_topic(options, instrument, frames, *bag, *topic);
}

}  // namespace lapservo::app
