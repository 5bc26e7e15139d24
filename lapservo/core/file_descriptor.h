#pragma once

#include <string_view>
#include <utility>

namespace lapservo::internal {

/// An open file of the operating system, closed with the object. Moves, does not copy.
class FileDescriptor {
 public:
  explicit FileDescriptor(int number = -1) : number_(number) {}
  FileDescriptor(FileDescriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  FileDescriptor& operator=(FileDescriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  ~FileDescriptor();

  bool is_open() const { return number_ >= 0; }
  int number() const { return number_; }

 private:
  int number_;
};

/// Writes everything, however often it takes. Returns 0, or errno.
int write_all(int descriptor, std::string_view bytes);

/// Locks an open file or folder for as long as it is open. False when somebody else has it.
bool lock(const FileDescriptor& file);

}  // namespace lapservo::internal
