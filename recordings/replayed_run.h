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

/// An arm that another program moves and its camera, as a bag has them, for run(). Times: seconds since the stamp of
/// the first image.
class ReplayedRun {
 public:
  /// `images`: the topic of the frames; nullptr where they have the times of the recorder's clock. `joint_topic`: see
  /// bag_topics.h. `instrument`: with joints. `wrist`: those of its tool, by the clock of the arm, where they are
  /// known. Throws InputError for bags without joints, and where the joints end before the first image.
  ReplayedRun(std::unique_ptr<FrameSource> frames, const Bag& bag, const BagTopic* images,
              const std::string& joint_topic, const Instrument& instrument, std::optional<JointRecording> wrist);

  /// Begins where joints and images do, and passes while somebody sleeps.
  Clock& clock() { return clock_; }
  /// Enabled while the bag has joint states, deaf to setpoints.
  Robot& arm() { return arm_; }
  /// Each image at the time of its stamp.
  ImageStream& images() { return images_; }

  double duration_s() const { return duration_s_; }
  std::optional<int> image_count() const { return frames_->frame_count(); }
  int images_given() const { return images_.count; }
  bool ended() const { return !images_.next; }
  /// By how much the arm's clock is ahead of the camera's; its joints are shifted by that.
  double arm_clock_lead_s() const { return joints_.lead_s; }
  std::string complaint() const { return frames_->complaint(); }
  std::string joint_remark() const { return joints_.recording.remark(); }

 private:
  struct RecordedClock : Clock {
    explicit RecordedClock(double begin_s) : now(begin_s) {}
    double now_s() const override { return now; }
    void sleep_until(double time_s) override { now = std::max(now, time_s); }
    double now;
  };
  struct ShiftedJoints {
    JointRecording recording;
    double lead_s = 0;
  };
  struct RecordedArm : Robot {
    RecordedArm(const ShiftedJoints& joints, const Instrument& instrument, std::optional<JointRecording> of_wrist,
                const Clock& of_run);
    std::vector<JointReading> readings() override;
    JointState state() override;
    void send(const JointPath&) override {}
    bool is_simulated() const override { return true; }  // nothing moves
    const Clock& clock;
    std::vector<JointReading> all;
    std::size_t next = 0;
    std::optional<JointRecording> wrist;  // by the arm's clock, which is ahead
    std::size_t wrist_joints;
    double lead_s;
  };
  struct RecordedImages : ImageStream {
    RecordedImages(FrameSource& of_bag, const Clock& of_run) : frames(of_bag), clock(of_run), next(of_bag.next()) {}
    std::optional<StampedImage> newest() override;
    FrameSource& frames;
    const Clock& clock;
    std::optional<Frame> next;
    int count = 0;
  };
  static ShiftedJoints joints_of_bag(const Bag& bag, const BagTopic* images, double begin_s, const std::string& topic,
                                     const std::string& arm, const Joints& joints);

  std::unique_ptr<FrameSource> frames_;
  ShiftedJoints joints_;
  double duration_s_ = 0;
  RecordedClock clock_;
  RecordedArm arm_;
  RecordedImages images_;
};

}  // namespace lapservo::internal
