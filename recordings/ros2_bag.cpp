#include "recordings/ros2_bag.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <map>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lapservo/core/error.h"
#include "recordings/ros2_metadata.h"
#include "recordings/sqlite_file.h"
#include "transports/ros2/cdr_decoder.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;

// One file of a bag, and which of its numbers a topic (name, type) has.
struct Part {
  SqliteFile file;
  std::map<std::pair<std::string, std::string>, std::int64_t> numbers;
};

class Ros2Messages : public BagMessages {
 public:
  Ros2Messages(const std::vector<Part>& parts, const BagTopic& topic) : parts_(parts), topic_(topic) {}

  std::optional<BagMessage> next() override {
    while (!rows_ || !rows_->next()) {
      rows_.reset();  // a query that runs past its end restarts
      if (next_ == parts_.size()) return std::nullopt;
      const Part& part = parts_[next_++];
      const auto number = part.numbers.find({topic_.name, topic_.type});
      if (number == part.numbers.end()) continue;
      rows_ = part.file.rows(
          fmt::format("SELECT data, timestamp FROM messages WHERE topic_id = {} ORDER BY id", number->second));
    }
    return decode_bag_message(
        topic_.type, []<typename Message>(const auto& bytes) { return decode_cdr<Message>(bytes); }, rows_->blob(0));
  }
  double recorded_s() const override { return 1e-9 * static_cast<double>(rows_->integer(1)); }

 private:
  const std::vector<Part>& parts_;
  BagTopic topic_;
  std::size_t next_ = 0;
  std::optional<SqliteFile::Rows> rows_;
};

// sensor_msgs/msg/Image is ROS 1's sensor_msgs/Image.
std::string type_as_in_ros1(std::string type) {
  if (const std::size_t at = type.find("/msg/"); at != std::string::npos) type.erase(at, 4);
  return type;
}

std::string remark_on(const std::vector<fs::path>& unlisted) {
  if (unlisted.empty()) return {};
  std::vector<std::string> names;
  for (const fs::path& file : unlisted) names.push_back(file.filename().string());
  return fmt::format("metadata.yaml does not list {}: not read; `ros2 bag reindex` lists all files",
                     fmt::join(names, ", "));
}

class Ros2Bag : public Bag {
 public:
  explicit Ros2Bag(const std::string& path) : path_(path) {
    std::error_code error;
    if (fs::is_directory(path, error)) {
      const auto [listed, unlisted] = files_of_ros2_bag(path);
      for (const fs::path& file : listed) add(file.string());
      remark_ = remark_on(unlisted);
    } else {
      add(path);
    }
    for (const auto& [names, counted] : counts_)
      topics_.push_back({names.first, names.second, counted.messages,
                         counted.messages > 0
                             ? 1e-9 * (static_cast<double>(counted.last_ns) - static_cast<double>(counted.first_ns))
                             : 0});
  }

  const std::string& path() const override { return path_; }
  const std::vector<BagTopic>& topics() const override { return topics_; }
  std::string remark() const override { return remark_; }
  std::unique_ptr<BagMessages> messages(const BagTopic& topic) const override {
    return std::make_unique<Ros2Messages>(parts_, topic);
  }

 private:
  struct Counted {
    std::uint64_t messages = 0;
    std::int64_t first_ns = std::numeric_limits<std::int64_t>::max(), last_ns = 0;
  };

  void add(const std::string& file) {
    std::error_code error;
    if (fs::file_size(file, error) == 0 && !error) throw InputError(file, "is empty, expected a ROS 2 bag's .db3");
    Part part{SqliteFile(file), {}};
    if (auto tables = part.file.rows(
            "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('topics', 'messages')");
        !tables.next() || tables.integer(0) != 2)
      throw InputError(file, "is no ROS 2 bag (no tables `topics` and `messages`)");
    for (auto rows = part.file.rows("SELECT id, name, type, serialization_format FROM topics"); rows.next();) {
      const std::pair names(rows.text(1), type_as_in_ros1(rows.text(2)));
      if (const std::string format = rows.text(3); format != "cdr")
        throw InputError(file, "serialization_format of " + names.first, format,
                         "cdr: convert it with `ros2 bag convert`");
      part.numbers[names] = rows.integer(0);
      counts_[names];
    }
    count(part);
    parts_.push_back(std::move(part));
  }
  void count(const Part& part) {
    for (auto rows = part.file.rows(
             "SELECT topic_id, count(*), min(timestamp), max(timestamp) FROM messages GROUP BY topic_id");
         rows.next();)
      for (const auto& [names, number] : part.numbers)
        if (number == rows.integer(0)) {
          Counted& counted = counts_[names];
          counted.messages += static_cast<std::uint64_t>(rows.integer(1));
          counted.first_ns = std::min(counted.first_ns, rows.integer(2));
          counted.last_ns = std::max(counted.last_ns, rows.integer(3));
        }
  }

  std::string path_, remark_;
  std::vector<Part> parts_;
  std::map<std::pair<std::string, std::string>, Counted> counts_;
  std::vector<BagTopic> topics_;
};

}  // namespace

std::unique_ptr<Bag> open_ros2_bag(const std::string& path) {
  return std::make_unique<Ros2Bag>(path);
}

}  // namespace lapservo::internal
