#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <sqlite3.h>
#include <string>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lapservo/core/error.h"
#include "recordings/ros2_file.h"

namespace lapservo::internal {
namespace {

[[noreturn]] void refuse(const std::string& path, sqlite3* database) {
  throw InputError(path, std::string("can't be read as a ROS 2 bag (") + sqlite3_errmsg(database) +
                             "), expected a whole .db3: copy it again, or try `sqlite3 FILE .recover`");
}

// Without a log beside it nobody writes the file, and nothing needs to be written beside it.
std::string address_of(const std::string& path) {
  std::string address = "file:";
  for (const char c : path)
    if (c == '%' || c == '?' || c == '#') {
      static constexpr char hex[] = "0123456789abcdef";
      address += '%', address += hex[c >> 4], address += hex[c & 15];
    } else {
      address += c;
    }
  std::error_code error;
  const bool logged = std::filesystem::file_size(path + "-wal", error) > 0 && !error;
  return address + (logged ? "?mode=ro" : "?mode=ro&immutable=1");
}

// A database of others, opened to be read only; its own triggers, views and functions are not trusted.
class SqliteFile {
 public:
  explicit SqliteFile(const std::string& path) : path_(path) {
    constexpr int longest_message = 512 << 20;
    sqlite3* opened = nullptr;
    const int result =
        sqlite3_open_v2(address_of(path).c_str(), &opened, SQLITE_OPEN_READONLY | SQLITE_OPEN_URI, nullptr);
    database_.reset(opened, sqlite3_close_v2);
    if (result != SQLITE_OK) refuse(path, opened);
    sqlite3_db_config(opened, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
    sqlite3_db_config(opened, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
    sqlite3_db_config(opened, SQLITE_DBCONFIG_ENABLE_VIEW, 0, nullptr);
    sqlite3_limit(opened, SQLITE_LIMIT_LENGTH, longest_message);
  }

  // A query's rows, one after the other.
  struct Rows {
    std::string path;
    std::shared_ptr<sqlite3> database;
    std::shared_ptr<sqlite3_stmt> statement;

    // False behind the last one. Throws InputError where the file is damaged.
    bool next() {
      const int result = sqlite3_step(statement.get());
      if (result != SQLITE_ROW && result != SQLITE_DONE) refuse(path, database.get());
      return result == SQLITE_ROW;
    }
    std::int64_t integer(int column) const { return sqlite3_column_int64(statement.get(), column); }
    std::string text(int column) const {
      const auto* const bytes = blob(column).data();
      return {reinterpret_cast<const char*>(bytes), blob(column).size()};
    }
    // Until next().
    std::span<const std::uint8_t> blob(int column) const {
      const void* const bytes = sqlite3_column_blob(statement.get(), column);
      return {static_cast<const std::uint8_t*>(bytes),
              static_cast<std::size_t>(sqlite3_column_bytes(statement.get(), column))};
    }
  };
  Rows rows(const std::string& query) const {
    sqlite3_stmt* prepared = nullptr;
    if (sqlite3_prepare_v2(database_.get(), query.c_str(), -1, &prepared, nullptr) != SQLITE_OK)
      refuse(path_, database_.get());
    return {path_, database_, {prepared, sqlite3_finalize}};
  }

 private:
  std::string path_;
  std::shared_ptr<sqlite3> database_;
};

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
