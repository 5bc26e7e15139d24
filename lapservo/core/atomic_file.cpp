#include "lapservo/core/atomic_file.h"

#include <cstring>
#include <string>

#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace fs = std::filesystem;

AtomicFile::AtomicFile(const fs::path& path)
    : target_(output_target(path)),
      opened_(target_.is_stream ? open_stream(target_) : FileDescriptor()),
      buffer_(target_.is_stream ? opened_.number() : temporary_.emplace(target_).descriptor()),
      stream_(&buffer_) {}

void AtomicFile::commit() {
  stream_.flush();
  if (!stream_)
    throw InputError(target_.name.string(), std::string("could not be written to its end") +
                                                (buffer_.error() ? std::string(": ") + std::strerror(buffer_.error())
                                                                 : " (is the disk full?)"));
  if (temporary_) temporary_->commit();
}

void write_file(const fs::path& path, std::string_view text) {
  AtomicFile file(path);
  file.stream() << text;
  file.commit();
}

}  // namespace lapservo::internal
