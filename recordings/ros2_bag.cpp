#include <algorithm>
#include <filesystem>
#include <map>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lapservo/core/error.h"
#include "recordings/bag_endings.h"
#include "recordings/open_bag.h"
#include "recordings/ros2_file.h"
#include "transports/ros2/cdr.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;

struct Part {
  std::string path;
  std::unique_ptr<Ros2File> file;
};

// sensor_msgs/msg/Image is ROS 1's sensor_msgs/Image.
std::string type_as_in_ros1(std::string type) {
  if (const std::size_t at = type.find("/msg/"); at != std::string::npos) type.erase(at, 4);
  return type;
}

// The messages of a topic named as in ROS 1, file after file.
class Ros2Messages : public BagMessages {
 public:
  Ros2Messages(const std::vector<Part>& parts, bool by_time, const BagTopic& topic) : topic_(topic) {
    for (const Part& part : parts)
      for (const Ros2FileTopic& one : part.file->topics())
        if (one.name == topic.name && type_as_in_ros1(one.type) == topic.type && one.messages > 0) {
          if (one.format != "cdr")
            throw InputError(part.path, "serialization_format of " + one.name, one.format,
                             "cdr: convert it with `ros2 bag convert`");
          if (from_.empty() || from_.back().file != part.file.get() || from_.back().type != one.type)
            from_.push_back({part.file.get(), one.type, one.first_ns});
        }
    if (by_time) std::ranges::stable_sort(from_, {}, &From::first_ns);
  }

  std::optional<BagMessage> next() override {
    std::optional<Ros2RawMessage> raw;
    while (!messages_ || !(raw = messages_())) {
      messages_ = nullptr;
      if (next_ == from_.size()) return std::nullopt;
      messages_ = from_[next_].file->messages(topic_.name, from_[next_].type);
      ++next_;
    }
    recorded_ns_ = raw->recorded_ns;
    return decode_bag_message(
        topic_.type, []<typename Message>(const auto& bytes) { return decode_cdr<Message>(bytes); }, raw->bytes);
  }
  double recorded_s() const override { return 1e-9 * static_cast<double>(recorded_ns_); }

 private:
  struct From {
    const Ros2File* file = nullptr;
    std::string type;  // as it is named there
    std::uint64_t first_ns = 0;
  };

  BagTopic topic_;
  std::vector<From> from_;
  std::size_t next_ = 0;
  Ros2FileMessages messages_;
  std::uint64_t recorded_ns_ = 0;
};

class Ros2Bag : public Bag {
 public:
  explicit Ros2Bag(const std::string& path) : Bag(path) {
    std::error_code error;
    const Ros2BagFiles files = fs::is_directory(path, error) ? files_of_ros2_bag(path) : Ros2BagFiles{{path}, {}, {}};
    std::vector<std::string> remarks{files.remark};
    for (const fs::path& file : files.files) {
      parts_.push_back({file, is_mcap(file) ? open_mcap_file(file) : open_db3_file(file)});
      remarks.push_back(parts_.back().file->remark());
    }
    std::erase(remarks, "");
    by_time_ = files.is_unordered;
    remark_ = fmt::format("{}", fmt::join(remarks, "; "));
    list_topics();
  }

  std::unique_ptr<BagMessages> messages(const BagTopic& topic) const override {
    return std::make_unique<Ros2Messages>(parts_, by_time_, topic);
  }

 private:
  void list_topics() {
    std::map<std::pair<std::string, std::string>, Ros2FileTopic> counts;
    for (const Part& part : parts_)
      for (const Ros2FileTopic& topic : part.file->topics())
        counts[{topic.name, type_as_in_ros1(topic.type)}].count(topic.messages, topic.first_ns, topic.last_ns);
    for (const auto& [names, counted] : counts)
      topics_.push_back({names.first, names.second, counted.messages,
                         counted.messages > 0
                             ? 1e-9 * (static_cast<double>(counted.last_ns) - static_cast<double>(counted.first_ns))
                             : 0});
  }

  bool by_time_ = false;
  std::vector<Part> parts_;
};

}  // namespace

std::unique_ptr<Bag> open_ros2_bag(const std::string& path) {
  return std::make_unique<Ros2Bag>(path);
}

}  // namespace lapservo::internal
