#include "apps/lapservo/inputs/joint_input.h"

#include <memory>
#include <utility>
#include <vector>

#include "apps/lapservo/inputs/frame_input.h"
#include "lapservo/core/csv.h"
#include "lapservo/core/error.h"
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

}  // namespace

void add_joint_options(Command command, CalibrateOptions& options, const std::string& help) {
  command.add_option("--joints", options.joints, help);
  add_joint_topic_option(command, options.joint_topic);
}

void add_joint_topic_option(Command command, std::string& joint_topic) {
  command.add_option("--joint-topic", joint_topic,
                     "In a bag with several: the topic of the arm's measured joints; else .../INSTRUMENT/measured_js, "
                     "or the only measured_js");
}

JointInput read_joint_input(const CalibrateOptions& options, const Instrument& instrument, const FrameSource* frames) {
  const std::string path = bag_of(options.joints);
  if (path.empty()) return read_table(options, instrument);
  const auto bag = open_bag(path);
  if (path != options.input) say_remark(path, bag->remark());
  const BagTopic* topic = joint_topic_of(*bag, options.joint_topic, instrument.name);
  if (!topic)
    throw InputError(options.joints, std::string("has no messages of ") + joint_type + ", expected the joints'");
  return read_topic(options, instrument, frames, *bag, *topic);
}

std::optional<JointInput> find_joint_input(const CalibrateOptions& options, const Instrument& instrument,
                                           const FrameSource* frames) {
  if (!options.joints.empty()) return read_joint_input(options, instrument, frames);
  const std::string path = bag_of(options.input);
  if (path.empty()) {
    refuse_topic_outside_bags("--joint-topic", options.joint_topic, options.input);
    return std::nullopt;
  }
  const auto bag = open_bag(path);
  if (path != options.input) say_remark(path, bag->remark());
  const BagTopic* topic = joint_topic_of(*bag, options.joint_topic, instrument.name);
  if (!topic) return std::nullopt;
  return read_topic(options, instrument, frames, *bag, *topic);
}

}  // namespace lapservo::app
