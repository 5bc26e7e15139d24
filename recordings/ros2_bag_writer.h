#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "lapservo/crtk/messages.h"

namespace lapservo::internal {

/// Writes a ROS 2 bag as rosbag2 does: a folder of metadata.yaml and an .mcap, without chunks (rosbag2's preset
/// `fastwrite`). Written messages survive the program.
class Ros2BagWriter {
 public:
  /// Throws InputError when `folder` holds something already or can't be written.
  explicit Ros2BagWriter(const std::filesystem::path& folder);
  ~Ros2BagWriter();
  Ros2BagWriter(const Ros2BagWriter&) = delete;
  Ros2BagWriter& operator=(const Ros2BagWriter&) = delete;

  /// `time_s`: of its recording, since 1970. Messages of a topic are of one type. One thread at a time. Throws
  /// InputError where it can't be written, for example because the disk is full.
  void write(const std::string& topic, double time_s, const JointMessage& message);
  void write(const std::string& topic, double time_s, const ImageMessage& message);
  void write(const std::string& topic, double time_s, const CompressedImageMessage& message);

  /// Writes metadata.yaml, which completes the bag. Without messages no bag is made.
  void finish();

 private:
  struct File;
  std::unique_ptr<File> file_;
};

}  // namespace lapservo::internal
