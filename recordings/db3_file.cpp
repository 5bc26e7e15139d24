#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lapservo/core/error.h"
#include "recordings/ros2_file.h"
#include "recordings/sqlite_file.h"

namespace lapservo::internal {
namespace {

class Db3Messages : public Ros2FileMessages {
 public:
  explicit Db3Messages(SqliteFile::Rows rows) : rows_(std::move(rows)) {}

  bool next() override { return rows_.next(); }
  std::span<const std::uint8_t> bytes() override { return rows_.blob(0); }
  std::uint64_t recorded_ns() const override { return static_cast<std::uint64_t>(rows_.integer(1)); }

 private:
  SqliteFile::Rows rows_;
};

class Db3File : public Ros2File {
 public:
  explicit Db3File(const std::string& path) : file_(path) {
    if (auto tables =
            file_.rows("SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('topics', 'messages')");
        !tables.next() || tables.integer(0) != 2)
      throw InputError(path, "is no ROS 2 bag (no tables `topics` and `messages`)");
    for (auto rows = file_.rows("SELECT id, name, type, serialization_format FROM topics"); rows.next();) {
      numbers_.push_back(rows.integer(0));
      topics_.push_back({rows.text(1), rows.text(2), rows.text(3)});
    }
    for (auto rows =
             file_.rows("SELECT topic_id, count(*), min(timestamp), max(timestamp) FROM messages GROUP BY topic_id");
         rows.next();)
      for (std::size_t i = 0; i < topics_.size(); ++i)
        if (numbers_[i] == rows.integer(0)) {
          topics_[i].messages = static_cast<std::uint64_t>(rows.integer(1));
          topics_[i].first_ns = static_cast<std::uint64_t>(std::max<std::int64_t>(rows.integer(2), 0));
          topics_[i].last_ns = static_cast<std::uint64_t>(std::max<std::int64_t>(rows.integer(3), 0));
        }
  }

  const std::vector<Ros2FileTopic>& topics() const override { return topics_; }
  std::unique_ptr<Ros2FileMessages> messages(const std::string& name, const std::string& type) const override {
    std::vector<std::int64_t> numbers;
    for (std::size_t i = 0; i < topics_.size(); ++i)
      if (topics_[i].name == name && topics_[i].type == type) numbers.push_back(numbers_[i]);
    return std::make_unique<Db3Messages>(file_.rows(fmt::format(
        "SELECT data, timestamp FROM messages WHERE topic_id IN ({}) ORDER BY id", fmt::join(numbers, ","))));
  }

 private:
  SqliteFile file_;
  std::vector<std::int64_t> numbers_;  // of the topics
  std::vector<Ros2FileTopic> topics_;
};

}  // namespace

std::unique_ptr<Ros2File> open_db3_file(const std::string& path) {
  std::error_code error;
  if (std::filesystem::file_size(path, error) == 0 && !error)
    throw InputError(path, "is empty, expected a ROS 2 bag's .db3");
  return std::make_unique<Db3File>(path);
}

}  // namespace lapservo::internal
