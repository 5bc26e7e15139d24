#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <limits>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <variant>

#include "lapservo/core/bounded_queue.h"
#include "lapservo/crtk/first_sender.h"
#include "lapservo/crtk/messages.h"
#include "lapservo/robot/steady_clock.h"
#include "recordings/ros2_bag_writer.h"

namespace lapservo::internal {

/// Counts of the messages of a recording.
struct RecordedCounts {
  long images = 0, joints = 0;
  long dropped = 0;  ///< images that came faster than they could be written
  long arrived = 0;  ///< images that came, be they written, dropped or waiting for the disk
  long unstamped = 0;
  /// Messages of a topic's second senders, which are left out: the topics that had one.
  std::map<std::string, long> of_second_senders;
};

/// Records messages into a ROS 2 bag, in a thread of its own: stamps, images as they are, and the joints' names and
/// positions. Velocities, efforts and frame_ids are dropped: nothing here reads them. A topic's messages count from its
/// first sender only, as in the loop (FirstSender), and images no more than about `most_fps` times a second by their
/// stamps. Messages may come from any thread.
class BagRecorder {
 public:
  /// See Ros2BagWriter.
  explicit BagRecorder(const std::filesystem::path& folder, double most_fps = std::numeric_limits<double>::infinity());
  ~BagRecorder();

  using Message = std::variant<JointMessage, ImageMessage, CompressedImageMessage>;
  void add(const std::string& topic, Message message);

  RecordedCounts counts() const;
  /// Throws what writing has thrown.
  void check() const;
  /// Writes what is left, and ends.
  void finish();

 private:
  struct Entry {
    std::string topic;
    double time_s = 0;
    Message message;
  };

  bool is_of_first_sender(const std::string& topic, std::uint64_t source);
  bool is_too_soon(double stamp_s);
  void write_all();
  void end();
  void write(const Entry& entry);

  double most_fps_, next_image_s_ = 0;
  Ros2BagWriter writer_;
  mutable std::mutex mutex_;
  BoundedQueue<Entry> waiting_;
  std::size_t waiting_bytes_ = 0;
  RecordedCounts counts_;
  SteadyClock clock_;
  std::map<std::string, FirstSender> senders_;  // by topic
  std::exception_ptr failure_;
  std::thread thread_;  // last: it uses the others
};

}  // namespace lapservo::internal
