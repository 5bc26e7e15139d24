#include "lapservo/calibration/marker/marker_measurement.h"

#include <cmath>
#include <optional>
#include <string>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/atomic_file.h"
#include "lapservo/core/random.h"
#include "lapservo/testing/has.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/rigs.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal::seam_registration_test {
using lapservo::testing::has;

Instrument instrument_with_joints() {
  Instrument instrument = lapservo::testing::paper_test_rig().instruments[0];
  instrument.joints = Joints{{"yaw", "pitch", "insertion", "roll"}, {1, 1, 1, -1}, {0, 0, 0, 0.7}};
  instrument.image_delay_s = 0.2;
  return instrument;
}

// A rotation in 20 s, one way or there and back, the instrument behind a gap of roll; frames carry poses as a
// calibration leaves them, with the marker's seam assumed at seam_rad.
struct Turn {
  Instrument instrument = instrument_with_joints();
  MarkerCalibration calibration;
  JointRecording recording;

  Turn(double seam_error_rad, double noise_rad, double gap_rad = 0, bool there_and_back = false) {
    Random random(3);
    const auto psi_at = [=](double time_s) {
      return there_and_back ? two_pi * (1 - std::abs(time_s / 10 - 1)) : two_pi * time_s / 20;
    };
    const auto lag_at = [=](double time_s) { return (there_and_back && time_s > 10 ? -0.5 : 0.5) * gap_rad; };
    for (int i = 0; i < 200; ++i) {
      const double time_s = 0.1 * i;
      recording.time_s.push_back(time_s), recording.joints.push_back({0, 0, 0, (psi_at(time_s) - 0.7) / -1});
    }
    calibration.marker = instrument.marker;
    for (int i = 0; i < 60; ++i) {
      const double time_s = 0.5 + 0.3 * i;
      const JointVector q{0.3 * std::sin(time_s), 1.3, 0.1, psi_at(time_s)};
      // A free pose's own azimuths may lie anywhere: turned by some angle, psi is less by it.
      const double turned_rad = random.uniform(-3, 3);
      ShaftPose pose{instrument.camera_from_rcm.value() * rcm_from_unrolled(q), 0};
      pose.camera_from_unrolled.rotation =
          pose.camera_from_unrolled.rotation * Eigen::AngleAxisd(turned_rad, Eigen::Vector3d::UnitZ());
      pose.psi_rad = q.psi_rad - lag_at(time_s) - turned_rad + seam_error_rad + noise_rad * random.normal();
      KeyFrame frame;
      frame.sighting.unknowns = {pose, false};
      frame.time_s = time_s + 0.2;
      calibration.key_frames.push_back(frame);
    }
  }
};

auto seam_of(const Turn& turn) {
  return register_seam(turn.instrument, turn.calibration, turn.recording);
}

TEST(RegisterSeam, IsWhereTheJointsSayWhateverThePosesAzimuths) {
  for (const double gap_rad : {0.0, 0.04}) {
    const Turn turn(0.4, 1e-3, gap_rad, true);
    const auto seam = seam_of(turn);
    ASSERT_EQ(seam.refusal, "");
    EXPECT_NEAR(seam.seam_rad, wrap_pi(turn.calibration.marker.seam_rad + 0.4), 5e-4) << gap_rad;
    EXPECT_NEAR(seam.sigma_rad, 1e-3 / std::sqrt(60), 7e-5) << gap_rad;
    EXPECT_EQ(seam.frames, 60U);
  }
}

TEST(RegisterSeam, ItsSigmaHoldsTheGapThatATurnOneWayDoesNotShow) {
  const Turn turn(0.4, 1e-3, 0.04);
  const auto seam = seam_of(turn);
  ASSERT_EQ(seam.refusal, "");
  EXPECT_NEAR(seam.seam_rad, wrap_pi(turn.calibration.marker.seam_rad + 0.4), 2 * seam.sigma_rad);
  EXPECT_NEAR(seam.sigma_rad, 0.02 / std::sqrt(3.0), 1e-3);
}

// Frames are stamped 0.2 s late.
TEST(RegisterSeam, NeedsTheDelayOfATurnOneWayAlone) {
  for (const auto delay_s : {std::optional<double>(), std::optional(0.05)}) {
    Turn both_ways(0.4, 1e-3, 0, true);
    both_ways.instrument.image_delay_s = delay_s;
    const auto seam = seam_of(both_ways);
    ASSERT_EQ(seam.refusal, "");
    EXPECT_NEAR(seam.seam_rad, wrap_pi(both_ways.calibration.marker.seam_rad + 0.4), 5e-4);
    EXPECT_LT(seam.sigma_rad, 3e-4);
  }
  Turn one_way(0.4, 1e-3);
  one_way.instrument.sigma_image_delay_s = 0.02;
  EXPECT_NEAR(seam_of(one_way).sigma_rad, std::hypot(0.02 / std::sqrt(3.0), 0.02 * two_pi / 20), 1e-3);
  one_way.instrument.image_delay_s.reset(), one_way.instrument.sigma_image_delay_s.reset();
  EXPECT_TRUE(has(seam_of(one_way).refusal, "the rig has no image_delay_s"));
}

TEST(RegisterSeam, RefusesRecordingsOfOtherTimesAndOtherTurns) {
  Turn elsewhere(0, 1e-3);
  for (double& time_s : elsewhere.recording.time_s) time_s += 100;
  EXPECT_TRUE(has(seam_of(elsewhere).refusal, "lie within"));
  Turn backwards(0, 1e-3);
  backwards.instrument.joints->sign[3] = 1;
  EXPECT_TRUE(has(seam_of(backwards).refusal, "joints.sign"));
}

JointRecording read(const std::string& rows, JointsOf whose = JointsOf::arm) {
  const lapservo::testing::TemporaryFolder folder;
  write_file(folder / "joints.csv", rows);
  return read_joint_recording(folder / "joints.csv", instrument_with_joints().joints.value(), whose);
}

void expect_wrong(const std::string& rows, const std::string& part, JointsOf whose = JointsOf::arm) {
  EXPECT_TRUE(has(lapservo::testing::input_error([&] { read(rows, whose); }), part));
}

const std::string header = "time_s,yaw,pitch,insertion,roll\n";

TEST(JointRecordingFile, NamesWhatIsWrong) {
  expect_wrong("time_s,yaw,pitch,insertion\n0,0,0,0\n", "roll");
  expect_wrong(header + "0,0,0,0,nan\n", "roll");
  expect_wrong(header + "1,0,0,0,0\n0.5,0,0,0,0\n", "clock jumps");
  expect_wrong(header + "1,0,0,0,0\n", "two rows");
  expect_wrong(header + "0,0,0,0,0\n1,20,0,0,0\n", "looks like degrees");
  expect_wrong(header + "0,0,0,0,0\n1,0,0,90,0\n", "looks like millimetres");
  expect_wrong(header + "0,0,0,0,0\n1,0,0,0,7\n", "looks like degrees", JointsOf::wrist);
  const JointRecording recording = read("time_s,roll,yaw,pitch,insertion\n0,4,1,2,0.3\n1,8,5,6,0.7\n");
  EXPECT_EQ(recording.joints[1], (std::array<double, 4>{5, 6, 0.7, 8}));
}

TEST(JointRecordingFile, PassesOverARowThatRepeatsTheOneBefore) {
  const std::string begin = header + "0,1,2,0.3,4\n0,1,2,0.3,4\n";
  EXPECT_EQ(read(begin + "1,5,6,0.7,8\n1,5,6,0.7,8\n").time_s, (std::vector<double>{0, 1}));
  expect_wrong(begin + "0,1,2,0.3,5\n1,5,6,0.7,8\n", "clock jumps");
}

}  // namespace lapservo::internal::seam_registration_test
