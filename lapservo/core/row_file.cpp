#include "lapservo/core/row_file.h"

#include <cerrno>
#include <fcntl.h>
#include <unistd.h>
#include <utility>

#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;

bool begins_with(const FileDescriptor& file, const std::string& header) {
  std::string text(header.size(), '\0');
  const ssize_t got = ::pread(file.number(), text.data(), text.size(), 0);
  return got == static_cast<ssize_t>(text.size()) && text == header;
}

// Not once its writer has given it its final name, between our opening and locking it.
bool still_named(const struct stat& opened, const fs::path& path) {
  struct stat named {};
  return ::lstat(path.c_str(), &named) == 0 && opened.st_dev == named.st_dev && opened.st_ino == named.st_ino;
}

}  // namespace

RowFile::RowFile(const fs::path& path, std::string_view header) : target_(path), header_(std::string(header) + '\n') {
  if (target_.is_stream()) {
    file_ = open_stream(target_);
    begin();
  } else {
    open_part();
  }
}

RowFile::~RowFile() {
  if (!part_.empty() && ours_) ::unlink(part_.c_str());
}

void RowFile::open_part() {
  const fs::path part = target_.file.string() + ".part";
  file_ = FileDescriptor(::open(part.c_str(), O_CREAT | O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0666));
  if (!file_.is_open() && errno != ELOOP && errno != EISDIR) target_.fail(errno);
  struct stat status {};
  if (!file_.is_open() || ::fstat(file_.number(), &status) != 0 || !S_ISREG(status.st_mode) ||
      (status.st_size > 0 && !begins_with(file_, header_)))
    throw InputError(target_.name.string(),
                     "can't be written: " + part.string() + " is in the way, and is no unfinished file of this kind");
  if (!lock(file_) || !still_named(status, part))
    throw InputError(target_.name.string(), "is being written by another run");
  ours_ = status.st_size == 0;
  part_ = part;
}

// Over what a killed run has left, not before there is something to take its place.
void RowFile::begin() {
  ours_ = begun_ = true;
  if (!part_.empty() && ::ftruncate(file_.number(), 0) != 0) target_.fail(errno);
  write(header_);
}

void RowFile::write(const std::string& text) {
  const off_t whole = ::lseek(file_.number(), 0, SEEK_CUR);
  const int error = write_all(file_.number(), text);
  if (error == 0) return;
  std::string kept;
  const bool has_rows = !part_.empty() && whole > static_cast<off_t>(header_.size());
  if (has_rows && ::ftruncate(file_.number(), whole) == 0) {  // no half row
    kept = "; the rows before are in " + part_.string();
    part_.clear();
  }
  target_.fail_writing(error, kept);
}

void RowFile::add(std::string_view row) {
  if (!begun_) begin();
  write(std::string(row) + '\n');
}

void RowFile::commit() {
  if (!begun_) begin();
  if (part_.empty()) return;
  put_in_place(target_, file_.number(), part_);
}

fs::path RowFile::leave() {
  return part_.empty() ? target_.name : std::exchange(part_, {});
}

}  // namespace lapservo::internal
