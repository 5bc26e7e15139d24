#include "recordings/bag_topics.h"

#include <functional>
#include <vector>

#include <fmt/format.h>

#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace {

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

[[noreturn]] void refuse_several(const Bag& bag, const char* what, const char* option) {
  throw InputError(bag.path(), fmt::format("has several topics of {}, expected one to be named with {}: it holds {}",
                                           what, option, listed(bag)));
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
  if (images.size() > 1) refuse_several(bag, "images", option);
  return *images.front();
}

const BagTopic* joint_topic_of(const Bag& bag, const std::string& name, const std::string& arm) {
  constexpr auto option = "--joint-topic";
  if (!name.empty()) return &named(bag, name, option, is_joint_state, "JointState");
  const auto joints_ending_in = [&](const std::string& end) {
    return those(bag, [&](const BagTopic& topic) { return is_joint_state(topic) && topic.name.ends_with(end); });
  };
  for (const std::string& end : {"/" + arm + "/measured_js", std::string("/measured_js"), std::string()})
    if (const Topics found = joints_ending_in(end); found.size() == 1) return found.front();
  if (!joints_ending_in("").empty()) refuse_several(bag, "joints", option);
  return nullptr;
}

}  // namespace lapservo::internal
