#include "lapservo/core/atomic_file.h"

#include <cerrno>

namespace lapservo::internal {
namespace {

void write_whole(const OutputTarget& target, std::string_view text) {
  if (target.is_stream()) {
    if (const int error = write_all(open_stream(target).number(), text)) target.fail_writing(error);
    return;
  }
  TemporaryFile file(target);
  file.write(text);
  file.commit();
}

}  // namespace

void AtomicFile::commit() {
  if (!text_) target_.fail_writing(ENOMEM);
  write_whole(target_, text_.view());
}

void write_file(const std::filesystem::path& path, std::string_view text) {
  write_whole(OutputTarget(path), text);
}

}  // namespace lapservo::internal
