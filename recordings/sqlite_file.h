#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

struct sqlite3;
struct sqlite3_stmt;

namespace lapservo::internal {

/// A database of others, opened to be read only; its own triggers, views and functions are not trusted.
class SqliteFile {
 public:
  explicit SqliteFile(const std::string& path);

  /// A query's rows, one after the other.
  class Rows {
   public:
    /// False behind the last one. Throws InputError where the file is damaged.
    bool next();
    std::int64_t integer(int column) const;
    std::string text(int column) const;
    /// Until next().
    std::span<const std::uint8_t> blob(int column) const;

   private:
    friend class SqliteFile;
    std::string path_;
    std::shared_ptr<sqlite3> database_;
    std::shared_ptr<sqlite3_stmt> statement_;
  };
  Rows rows(const std::string& query) const;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  std::shared_ptr<sqlite3> database_;
};

}  // namespace lapservo::internal
