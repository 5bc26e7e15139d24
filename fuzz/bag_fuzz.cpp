#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>

#include <opencv2/core/utils/logger.hpp>

#include "fuzz/require.h"
#include "lapservo/testing/temporary_folder.h"
#include "recordings/bag_frames.h"
#include "recordings/bag_joints.h"
#include "recordings/bag_topics.h"
#include "recordings/open_bag.h"

// Any bytes are a bag that is read to its end, or an InputError. All values read are finite.
namespace lapservo::internal::bag_fuzz {
using fuzz::read_or_refuse;
using fuzz::require;

void read_messages(const Bag& bag) {
  for (const BagTopic& topic : bag.topics()) {
    require(std::isfinite(topic.duration_s), "a topic's duration is finite");
    read_or_refuse([&] {
      for (const auto messages = bag.messages(topic); messages->next();)
        require(std::isfinite(messages->recorded_s()), "a time is finite");
    });
  }
}

void read_frames(const std::shared_ptr<const Bag>& bag) {
  BagFrames frames(bag, "");
  require(frames.frame_count().value_or(0) >= 0, "frames are counted");
  require(std::isfinite(frames.frames_per_second()), "a rate is finite");
  for (double last_s = -1; const auto frame = frames.next(); last_s = frame->time_s) {
    require(frame->time_s > last_s && std::isfinite(frame->time_s), "times grow");
    require(frame->flaw || (frame->bgr.type() == CV_8UC3 && !frame->bgr.empty()), "an image is 8-bit BGR");
  }
}

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const lapservo::testing::TemporaryFolder folder;
  const auto path = folder / "fuzz";
  lapservo::testing::write_file(path, {reinterpret_cast<const char*>(data), size});
  read_or_refuse([&] {
    const auto bag = open_bag(path.string());
    read_messages(*bag);
    read_or_refuse([&] { read_frames(bag); });
    read_or_refuse([&] {
      if (const BagTopic* topic = joint_topic_of(*bag, "", "PSM1")) joint_names_in_bag(*bag, *topic);
    });
  });
  return 0;
}

}  // namespace lapservo::internal::bag_fuzz
