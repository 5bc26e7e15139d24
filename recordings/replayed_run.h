#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/calibration/recording/joint_recording.h"
#include "lapservo/io/frame_source.h"
#include "lapservo/rig/rig.h"
#include "lapservo/robot/clock.h"
#include "lapservo/robot/robot.h"
#include "lapservo/stream/image_stream.h"
#include "recordings/bag.h"

namespace lapservo::internal {

/// An arm that another program moves and its camera, as a bag has them, for run(), which gets it as its clock, its arm
/// and its camera. Times: seconds since the stamp of the first image.
class ReplayedRun : public Clock, public Robot, public ImageStream {
 public:
  /// `images`: the topic of the frames; nullptr where they have the times of the recorder's clock. `joint_topic`: see
  /// bag_topics.h. `instrument`: with joints. `wrist`: those of its tool, by the clock of the arm, where they are
  /// known. Throws InputError for bags without joints, and where the joints end before the first image.
  ReplayedRun(std::unique_ptr<FrameSource> frames, const Bag& bag, const BagTopic* images,
              const std::string& joint_topic, const Instrument& instrument, std::optional<JointRecording> wrist);

  /// Begins where joints and images do, and passes while somebody sleeps.
  double now_s() const override { return now_s_; }
  void sleep_until(double time_s) override { now_s_ = std::max(now_s_, time_s); }
  /// Enabled while the bag has joint states, deaf to setpoints.
  JointState state() override;
  std::vector<JointReading> readings() override;
  void send(const JointPath&) override {}
  bool is_simulated() const override { return true; }  // nothing moves
  /// Each image at the time of its stamp.
  std::optional<StampedImage> newest() override;

  double duration_s() const { return duration_s_; }
  std::optional<int> image_count() const { return frames_->frame_count(); }
  int images_given() const { return images_given_; }
  bool ended() const { return !next_frame_; }
  /// By how much the arm's clock is ahead of the camera's; its joints are shifted by that.
  double arm_clock_lead_s() const { return lead_s_; }
  std::string complaint() const { return frames_->complaint(); }
  std::string joint_remark() const { return joints_.remark(); }

 private:
  std::unique_ptr<FrameSource> frames_;
  std::optional<Frame> next_frame_;
  int images_given_ = 0;
  JointRecording joints_;
  std::vector<JointReading> all_readings_;
  std::size_t next_reading_ = 0;
  std::optional<JointRecording> wrist_;  // by the arm's clock, which is ahead
  std::size_t wrist_joints_;
  double now_s_ = 0, duration_s_ = 0, lead_s_ = 0;
};

}  // namespace lapservo::internal
