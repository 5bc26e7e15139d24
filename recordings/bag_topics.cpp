#include "recordings/bag_topics.h"

#include <algorithm>
#include <functional>
#include <iterator>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace {

const std::string measured = "/measured_js";

using Topics = std::vector<const BagTopic*>;

bool is_image(const BagTopic& topic) {
  return topic.type == image_type || topic.type == compressed_image_type;
}

bool is_joint_state(const BagTopic& topic) {
  return topic.type == joint_type;
}

Topics those(const Bag& bag, const std::function<bool(const BagTopic&)>& wanted) {
  Topics found;
  for (const BagTopic& topic : bag.topics())
    if (topic.messages > 0 && wanted(topic)) found.push_back(&topic);
  return found;
}

std::string listed(const Bag& bag) {
  std::string text;
  for (const BagTopic& topic : bag.topics())
    text += fmt::format("{}{} ({}, {})", text.empty() ? "" : ", ", topic.name, topic.type, topic.messages);
  return text.empty() ? "nothing" : text;
}

const BagTopic& named(const Bag& bag, const std::string& name, const char* option, bool (*wanted)(const BagTopic&),
                      const char* types) {
  const Topics found = those(bag, [&](const BagTopic& topic) { return topic.name == name && wanted(topic); });
  if (found.empty())
    throw InputError(option, fmt::format("is {}, expected a topic of {} with messages in {}, which holds {}", name,
                                         types, bag.path(), listed(bag)));
  return *found.front();
}

[[noreturn]] void refuse(const Bag& bag, const std::string& found, const char* option) {
  throw InputError(bag.path(),
                   fmt::format("has {}, expected one to be named with {}: it holds {}", found, option, listed(bag)));
}

// Such as PSM1/jaw/measured_js beside PSM1/measured_js.
bool is_of_part(const Bag& bag, const BagTopic& topic) {
  if (!topic.name.ends_with(measured)) return false;
  const std::string part = topic.name.substr(0, topic.name.size() - measured.size());
  const std::string whole = part.substr(0, part.rfind('/')) + measured;
  return std::ranges::any_of(bag.topics(), [&](const BagTopic& other) { return other.name == whole; });
}

}  // namespace

const BagTopic& image_topic_of(const Bag& bag, const std::string& name) {
  constexpr auto option = "--image-topic";
  if (!name.empty()) return named(bag, name, option, is_image, "Image or CompressedImage");
  const Topics images = those(bag, is_image);
  if (images.empty())
    throw InputError(bag.path(), fmt::format("has no images, expected a topic of {} or {}: it holds {}", image_type,
                                             compressed_image_type, listed(bag)));
  if (images.size() == 2)
    for (const std::size_t raw : {0u, 1u})
      if (images[raw]->name + "/compressed" == images[1 - raw]->name) return *images[raw];
  if (images.size() > 1) refuse(bag, "several topics of images", option);
  return *images.front();
}

const BagTopic* joint_topic_of(const Bag& bag, const std::string& name, const std::string& arm,
                               const std::vector<std::string>& others) {
  constexpr auto option = "--joint-topic";
  if (!name.empty()) return &named(bag, name, option, is_joint_state, "JointState");
  const Topics all = those(bag, is_joint_state);
  const auto is_of_other = [&](const BagTopic* topic) {
    return is_of_part(bag, *topic) || std::ranges::any_of(others, [&](const std::string& other) {
             return topic->name.find("/" + other + "/") != std::string::npos;
           });
  };
  Topics found;
  for (const std::string& end : {"/" + arm + measured, measured, std::string()}) {
    found.clear();
    std::ranges::copy_if(all, std::back_inserter(found),
                         [&](const BagTopic* topic) { return topic->name.ends_with(end) && !is_of_other(topic); });
    if (found.size() == 1) return found.front();
  }
  if (!all.empty()) refuse(bag, found.empty() ? "no topic of joints of " + arm : "several topics of joints", option);
  return nullptr;
}

}  // namespace lapservo::internal
