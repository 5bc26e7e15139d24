#include "recordings/sqlite_file.h"

#include <filesystem>
#include <sqlite3.h>
#include <system_error>

#include "lapservo/core/error.h"

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

}  // namespace

SqliteFile::SqliteFile(const std::string& path) : path_(path) {
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

SqliteFile::Rows SqliteFile::rows(const std::string& query) const {
  sqlite3_stmt* prepared = nullptr;
  if (sqlite3_prepare_v2(database_.get(), query.c_str(), -1, &prepared, nullptr) != SQLITE_OK)
    refuse(path_, database_.get());
  Rows rows;
  rows.path_ = path_;
  rows.database_ = database_;
  rows.statement_.reset(prepared, sqlite3_finalize);
  return rows;
}

bool SqliteFile::Rows::next() {
  const int result = sqlite3_step(statement_.get());
  if (result != SQLITE_ROW && result != SQLITE_DONE) refuse(path_, database_.get());
  return result == SQLITE_ROW;
}

std::int64_t SqliteFile::Rows::integer(int column) const {
  return sqlite3_column_int64(statement_.get(), column);
}

std::string SqliteFile::Rows::text(int column) const {
  const auto* const bytes = blob(column).data();
  return {reinterpret_cast<const char*>(bytes), blob(column).size()};
}

std::span<const std::uint8_t> SqliteFile::Rows::blob(int column) const {
  const void* const bytes = sqlite3_column_blob(statement_.get(), column);
  return {static_cast<const std::uint8_t*>(bytes),
          static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column))};
}

}  // namespace lapservo::internal
