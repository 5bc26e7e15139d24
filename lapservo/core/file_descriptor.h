#pragma once

#include <streambuf>
#include <string_view>
#include <utility>
#include <vector>

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

/// What std::ostream needs to write into a file descriptor. What is buffered is dropped with the object.
class DescriptorBuffer : public std::streambuf {
 public:
  explicit DescriptorBuffer(int descriptor);
  /// errno of the first write that failed; 0 while all is well.
  int error() const { return error_; }

 protected:
  int_type overflow(int_type c) override;
  int sync() override;

 private:
  int descriptor_, error_ = 0;
  std::vector<char> room_;
};

}  // namespace lapservo::internal
