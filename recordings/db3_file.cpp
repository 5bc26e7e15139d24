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

// That of a recorder which writes the file or was killed.
bool has_log(const std::string& path) {
  std::error_code error;
  return std::filesystem::file_size(path + "-wal", error) > 0 && !error;
}

[[noreturn]] void refuse(const std::string& path, sqlite3* database) {
  const int code = sqlite3_errcode(database);
  if (has_log(path) && (code == SQLITE_CANTOPEN || code == SQLITE_READONLY))
    throw InputError(path, std::string("can't be read with the log beside it (-wal: ") + sqlite3_errmsg(database) +
                               "), expected a folder that can be written: copy the folder to where it can be");
  throw InputError(path, std::string("can't be read as a ROS 2 bag (") + sqlite3_errmsg(database) +
                             "), expected a whole .db3: copy it again, or try `sqlite3 FILE .recover`");
}

// Without a log beside it nobody writes the file, and nothing needs to be written beside it.
std::string address_of(const std::string& path) {
  std::string address = "file:";
  for (const char c : path) address += c == '%' || c == '?' || c == '#' ? fmt::format("%{:02x}", c) : std::string(1, c);
  return address + (has_log(path) ? "?mode=ro" : "?mode=ro&immutable=1");
}

// A query's rows, one after the other.
class Rows {
 public:
  Rows(const std::string& path, std::shared_ptr<sqlite3> database, const std::string& query)
      : path_(path), database_(std::move(database)) {
    sqlite3_stmt* prepared = nullptr;
    if (sqlite3_prepare_v2(database_.get(), query.c_str(), -1, &prepared, nullptr) != SQLITE_OK)
      refuse(path_, database_.get());
    statement_.reset(prepared, sqlite3_finalize);
  }

  // False behind the last one. Throws InputError where the file is damaged.
  bool next() {
    const int result = sqlite3_step(statement_.get());
    if (result != SQLITE_ROW && result != SQLITE_DONE) refuse(path_, database_.get());
    return result == SQLITE_ROW;
  }
  std::int64_t integer(int column) const { return sqlite3_column_int64(statement_.get(), column); }
  std::string text(int column) const {
    const auto bytes = blob(column);
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }
  // Until next().
  std::span<const std::uint8_t> blob(int column) const {
    const void* const bytes = sqlite3_column_blob(statement_.get(), column);
    return {static_cast<const std::uint8_t*>(bytes),
            static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column))};
  }

 private:
  std::string path_;
  std::shared_ptr<sqlite3> database_;
  std::shared_ptr<sqlite3_stmt> statement_;
};

// A database of others, opened to be read only; its own triggers, views and functions are not trusted.
class Db3File : public Ros2File {
 public:
  explicit Db3File(const std::string& path) : path_(path) {
    open();
    if (Rows tables =
            rows("SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('topics', 'messages')");
        !tables.next() || tables.integer(0) != 2)
      throw InputError(path, "is no ROS 2 bag (no tables `topics` and `messages`)");
    for (Rows topics = rows("SELECT id, name, type, serialization_format FROM topics"); topics.next();) {
      numbers_.push_back(topics.integer(0));
      topics_.push_back({topics.text(1), topics.text(2), topics.text(3)});
    }
    for (Rows counts =
             rows("SELECT topic_id, count(*), min(timestamp), max(timestamp) FROM messages GROUP BY topic_id");
         counts.next();)
      for (std::size_t i = 0; i < topics_.size(); ++i)
        if (numbers_[i] == counts.integer(0)) {
          topics_[i].messages = static_cast<std::uint64_t>(counts.integer(1));
          topics_[i].first_ns = static_cast<std::uint64_t>(std::max<std::int64_t>(counts.integer(2), 0));
          topics_[i].last_ns = static_cast<std::uint64_t>(std::max<std::int64_t>(counts.integer(3), 0));
        }
  }

  Ros2FileMessages messages(const std::string& name, const std::string& type) const override {
    std::vector<std::int64_t> numbers;
    for (std::size_t i = 0; i < topics_.size(); ++i)
      if (topics_[i].name == name && topics_[i].type == type) numbers.push_back(numbers_[i]);
    const std::string query =
        fmt::format("SELECT data, timestamp FROM messages WHERE topic_id IN ({}) ORDER BY id", fmt::join(numbers, ","));
    return [all = rows(query)]() mutable -> std::optional<Ros2RawMessage> {
      if (!all.next()) return std::nullopt;
      return Ros2RawMessage{static_cast<std::uint64_t>(all.integer(1)), all.blob(0)};
    };
  }

 private:
  void open() {
    constexpr int longest_message = 512 << 20;
    sqlite3* opened = nullptr;
    const int result =
        sqlite3_open_v2(address_of(path_).c_str(), &opened, SQLITE_OPEN_READONLY | SQLITE_OPEN_URI, nullptr);
    database_.reset(opened, sqlite3_close_v2);
    if (result != SQLITE_OK) refuse(path_, opened);
    sqlite3_db_config(opened, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
    sqlite3_db_config(opened, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
    sqlite3_db_config(opened, SQLITE_DBCONFIG_ENABLE_VIEW, 0, nullptr);
    sqlite3_limit(opened, SQLITE_LIMIT_LENGTH, longest_message);
  }
  Rows rows(const std::string& query) const { return {path_, database_, query}; }

  std::string path_;
  std::shared_ptr<sqlite3> database_;
  std::vector<std::int64_t> numbers_;  // of the topics
};

}  // namespace

std::unique_ptr<Ros2File> open_db3_file(const std::string& path) {
  std::error_code error;
  if (std::filesystem::file_size(path, error) == 0 && !error)
    throw InputError(path, "is empty, expected a ROS 2 bag's .db3");
  return std::make_unique<Db3File>(path);
}

}  // namespace lapservo::internal
