#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

namespace lapservo {
namespace testing {

/// librosbag-storage's writer, without its headers. The bag is whole when it is gone.
class Ros1BagWriter {
 public:
  Ros1BagWriter(const std::string& path, const std::string& compression);
  ~Ros1BagWriter();

  void write(const std::string& topic, const std::string& type, double time_s, const std::uint8_t* data,
             std::size_t size);

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace testing
}  // namespace lapservo
