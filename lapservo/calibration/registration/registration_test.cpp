#include "lapservo/calibration/registration/registration.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <tuple>
#include <utility>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "lapservo/calibration/recording/joint_recording.h"
#include "lapservo/calibration/registration/joint_faults.h"
#include "lapservo/calibration/registration/registration_measurement.h"
#include "lapservo/calibration/registration/test_motion.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/atomic_file.h"
#include "lapservo/core/random.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/joint_conversion.h"
#include "lapservo/rig/rig_writer.h"
#include "lapservo/testing/has.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/rigs.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal::registration_test {
using lapservo::testing::has;
using lapservo::testing::input_error;

// Where an arm as the instrument has it puts the marker.
Rigid3 marker_at(const Instrument& instrument, const std::array<double, 4>& readings) {
  const auto q = JointVector::from_vector(q_from_joints(*instrument.joints, Eigen::Vector4d(readings.data())));
  return camera_from_marker(instrument.marker, *instrument.camera_from_rcm, q);
}

Registration registered_by(const Recorded& data, const Instrument& believed) {
  return register_arm(believed, data.poses, data.recording, "joints.csv");
}

Registration registered_from_names(const Recorded& data) {
  return registered_by(data, with_names_only(data.truth));
}

constexpr std::array slack{0.01, 0.01, 1e-3, 0.03};  // of the joints

struct Errors {
  double position_m, rotation_rad, phi_rad, rho_m, psi_rad, delay_s;
};

Errors errors_of(const Registration& found, const Instrument& truth) {
  const Rigid3& expected = *truth.camera_from_rcm;
  const auto& arm = found.arm.value();
  return {(found.camera_from_rcm.translation - expected.translation).norm(),
          found.camera_from_rcm.rotation.angularDistance(expected.rotation),
          arm.joints.offset[1] - truth.joints->offset[1],
          arm.joints.offset[2] - truth.joints->offset[2],
          wrap_pi(arm.joints.offset[3] - truth.joints->offset[3]),
          arm.image_delay_s - truth.image_delay_s.value()};
}

TEST(RegisterArm, FindsAllOfItFromNamesAlone) {
  for (const double delay_s : {-2.7, 0.08, 0.25, 3.0})
    for (const double phi_sign : {1.0, -1.0}) {
      const Recorded data = recorded({.delay_s = delay_s, .sign = {1, phi_sign, -phi_sign, -1}});
      const auto found = registered_from_names(data);
      ASSERT_EQ(found.refusal, "");
      EXPECT_EQ(found.arm->joints.sign, data.truth.joints->sign);
      const Errors e = errors_of(found, data.truth);
      EXPECT_LT(e.position_m, 2e-4);
      EXPECT_LT(e.rotation_rad, 1e-3);
      EXPECT_NEAR(e.phi_rad, 0, 1e-3);
      EXPECT_NEAR(e.rho_m, 0, 2e-4);
      EXPECT_NEAR(e.psi_rad, 0, 1e-3);
      EXPECT_NEAR(e.delay_s, 0, 1e-3);
      EXPECT_DOUBLE_EQ(found.arm->joints.offset[0], data.truth.joints->offset[0]);
    }
}

TEST(RegisterArm, OfTwoDescriptionsTakesTheRigs) {
  const Recorded data = recorded({.sign = {-1, 1, 1, 1}});
  Instrument known = data.truth;
  known.camera_from_rcm->rotation =
      known.camera_from_rcm->rotation * Eigen::AngleAxisd(0.15, Eigen::Vector3d(1, 2, 3).normalized());
  known.camera_from_rcm->translation += Eigen::Vector3d(5e-3, -5e-3, 8e-3);
  known.joints->sign[0] = 1;  // wrong: the rig's rotation shows it
  const auto found = registered_by(data, known);
  ASSERT_EQ(found.refusal, "");
  EXPECT_EQ(found.arm->joints.sign, data.truth.joints->sign);
  EXPECT_LT(errors_of(found, data.truth).rotation_rad, 1e-3);
}

TEST(RegisterArm, ErrorsAreAsTheirSigmasSayBacklashOrNot) {
  double squares = 0, count = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const Motion motion{.seconds = 10, .backlash = seed % 2 ? slack : Motion{}.backlash, .seed = seed};
    const Recorded data = recorded(motion);
    const auto found = registered_from_names(data);
    ASSERT_EQ(found.refusal, "");
    const Errors e = errors_of(found, data.truth);
    EXPECT_LT(e.position_m, 5e-4);
    EXPECT_LT(e.rotation_rad, 2.6e-3);
    EXPECT_NEAR(e.delay_s, 0, 5e-3);
    EXPECT_NEAR(found.arm->backlash[3], motion.backlash[3], 3e-3);
    const auto& arm = *found.arm;
    const auto add = [&](double error, double sigma) { squares += error * error / (sigma * sigma), ++count; };
    add(e.phi_rad, arm.sigma_offset[1]), add(e.rho_m, arm.sigma_offset[2]), add(e.psi_rad, arm.sigma_offset[3]);
    add(e.delay_s, arm.sigma_image_delay_s), add(e.rotation_rad, found.sigma_rotation_rad);
    add(e.position_m, found.sigma_translation_m.norm());
  }
  const double z = std::sqrt(squares / count);
  EXPECT_GT(z, 0.5);
  EXPECT_LT(z, 1.5);
}

// Within the swing, and 30 degrees and 20 mm beside it.
TEST(RegisterArm, PlacesMarkersAsTheirSigmasSayBesideTheSwing) {
  constexpr int seeds = 36;
  std::array<Eigen::Array3d, 2> squares{Eigen::Array3d::Zero(), Eigen::Array3d::Zero()};
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const Recorded data = recorded({.seconds = 10,
                                    .common_turn_rad = 0.5e-3 * Random(100 + seed).normal(),  // half of a frame's sigma
                                    .backlash = seed % 2 ? slack : Motion{}.backlash,
                                    .seed = seed});
    const auto found = registered_from_names(data);
    ASSERT_EQ(found.refusal, "");
    Instrument registered = data.truth;
    registered.camera_from_rcm = found.camera_from_rcm, registered.joints = found.arm->joints;
    const JointRanges& ranges = found.arm->ranges;
    for (const std::size_t beside : {0U, 1U})
      for (const double theta : {0.0, 1.0})
        for (const double phi : {0.0, 1.0}) {
          std::array<double, 4> at = ranges.low;
          for (std::size_t k = 0; k < 3; ++k) {
            const double part = k == 0 ? theta : k == 1 ? phi : 1, side = beside == 0 ? 0 : 2 * part - 1;
            at[k] += part * ranges.travel(k) + side * (k == 2 ? 0.02 : 0.5236);
          }
          const Rigid3 is = marker_at(data.truth, at), placed = marker_at(registered, at);
          const Eigen::Vector3d turn = rotation_vector_of(is.rotation.conjugate() * placed.rotation);
          const auto sigma = placement_sigma(data.truth.marker, found, at);
          squares[beside] += Eigen::Array3d((placed.translation - is.translation).norm() / sigma.place_m,
                                            turn.head<2>().norm() / sigma.axis_rad, turn.z() / sigma.roll_rad)
                                 .square();
        }
  }
  for (const std::size_t beside : {0U, 1U}) {
    const Eigen::Array3d z = (squares[beside] / (4 * seeds)).sqrt();
    EXPECT_TRUE((z > 0.5).all() && (z < 1.5).all()) << beside << ": " << z.transpose();
  }
}

TEST(RegisterArm, NamesAMarkerThatIsMountedTheWrongWayRound) {
  Recorded data = recorded({});
  for (TimedPose& pose : data.poses) {
    Rigid3& camera_from_marker = pose.marker.camera_from_marker;
    camera_from_marker.rotation = camera_from_marker.rotation * Eigen::AngleAxisd(pi, Eigen::Vector3d::UnitX());
  }
  EXPECT_TRUE(has(registered_from_names(data).refusal, "the marker points away from the tip"));
  EXPECT_TRUE(has(register_rcm(data.truth, data.poses).refusal, "the marker points away from the tip"));
}

// Whatever signs the rig has, and without offsets.
TEST(RegisterArm, RefusesWhereJointsStoodStillAndNamesThem) {
  for (unsigned still = 1; still < 15; ++still) {
    Motion motion;
    for (std::size_t j = 0; j < 4; ++j)
      if (still >> j & 1U) motion.swing[j] = 1e-3;
    const Recorded data = recorded(motion);
    Instrument rig = data.truth;
    rig.joints->offset = {}, rig.joints->sign[still % 4] *= -1;
    const auto found = registered_by(data, rig);
    for (std::size_t j = 0; j < 4; ++j)
      EXPECT_EQ(found.refusal.find(data.truth.joints->names[j] + " moved by 0.0") != std::string::npos,
                (still >> j & 1U) != 0)
          << still << ": " << found.refusal;
  }
}

// theta and phi in step: seen from a turned frame, that is either sign of phi.
TEST(RegisterArm, RefusesASignThatDoesNotShow) {
  Motion motion;
  motion.swing = {0.2, 0.28, 1, 1};
  for (const bool in_step : {true, false}) {
    Recorded swung = recorded(motion);
    const Instrument& truth = swung.truth;
    if (in_step) {  // the same arm with phi's joint led by theta's
      JointRecording led = swung.recording;
      const auto first = led.joints.front();
      for (auto& at : led.joints) at[1] = first[1] + at[0] - first[0];
      for (TimedPose& pose : swung.poses) {
        const double time_s = std::clamp(pose.time_s - motion.delay_s, 0.0, 19.9);
        const Rigid3 noise = marker_at(truth, *swung.recording.at(time_s)).inverse() * pose.marker.camera_from_marker;
        pose.marker.camera_from_marker = marker_at(truth, *led.at(time_s)) * noise;
      }
      swung.recording = led;
    }
    const std::string refusal = registered_from_names(swung).refusal;
    EXPECT_EQ(refusal.find("both signs of pitch explain the motion") != std::string::npos, in_step) << refusal;
  }
}

// Too far for the signs to show; insertion's does not pass for a backlash of less than nothing, which has the
// instrument move by twice the readings, where these begin in their middle.
TEST(RegisterArm, NamesTheJointWhoseScaleIsFarOff) {
  for (const auto& [joint, by, roll_swing, seed] :
       {std::tuple{0U, 0.5, 2.5, 1U}, {3U, 1 / two_pi, 2.5, 1U}, {2U, 0.5, 1.0, 7U}}) {
    Recorded data = recorded({.seconds = 10, .swing = {1, 1, 1, roll_swing}, .seed = seed});
    for (auto& at : data.recording.joints) at[joint] *= by;
    EXPECT_TRUE(has(registered_from_names(data).refusal, data.truth.joints->names[joint] + " moves by")) << by;
  }
}

// As in compressed images: psi is off with the shaft's direction, by a part of the frames' own sigma.
TEST(RegisterArm, NamesNoCauseThatTheFramesOwnErrorsExplain) {
  constexpr double by_yaw = 0.04;  // rad/rad
  for (const auto& [sigma_rad, is_named] : {std::pair{1e-3, true}, std::pair{15e-3, false}}) {
    Recorded data = recorded({});
    for (TimedPose& pose : data.poses) {
      const auto q = data.truth.camera_from_rcm->inverse() * pose.marker.camera_from_marker;
      const Eigen::AngleAxisd off(by_yaw * std::atan2(q.translation.y(), q.translation.x()), Eigen::Vector3d::UnitZ());
      pose.marker.camera_from_marker.rotation = pose.marker.camera_from_marker.rotation * off;
      pose.marker.sigma_roll_rad = sigma_rad;
    }
    const auto found = registered_from_names(data);
    const std::string words = found.faults.empty() ? found.refusal : found.faults.front();
    EXPECT_EQ(has(words, "roll moves with the readings of yaw"), is_named) << words;
    EXPECT_TRUE(is_named || words.empty()) << words;
  }
  // Far off, but no farther than their sigmas: too poor, and not another arm's recording.
  Recorded poor = recorded({});
  Random random(5);
  for (TimedPose& pose : poor.poses) {
    const Eigen::AngleAxisd off(0.04 * random.normal(), Eigen::Vector3d::UnitZ());
    pose.marker.camera_from_marker.rotation = pose.marker.camera_from_marker.rotation * off;
    pose.marker.sigma_roll_rad = 0.04;
  }
  EXPECT_TRUE(has(registered_from_names(poor).refusal, "as the frames' own sigmas allow"));
}

TEST(RegisterArm, NamesAnIncisionThatGivesAndAFilterOfTheReadings) {
  const Motion motion{.wave = irregular(2)};
  Recorded given = recorded(motion), filtered = given;
  const Rigid3 truth = *given.truth.camera_from_rcm;
  for (TimedPose& pose : given.poses)
    pose.marker.camera_from_marker.translation += (motion_at(pose.time_s - motion.delay_s, motion).phi_rad - 1.45) *
                                                  (truth.rotation * Eigen::Vector3d(1.1e-3, 2.2e-3, 2.7e-3));
  auto& joints = filtered.recording.joints;
  for (std::size_t i = 1; i < joints.size(); ++i)  // by 50 ms
    for (std::size_t j = 0; j < 4; ++j) joints[i][j] = joints[i - 1][j] + (joints[i][j] - joints[i - 1][j]) / 6;
  for (const auto& [data, words] : {std::pair(given, "the RCM moves with pitch"), std::pair(filtered, "a filter of")}) {
    const auto found = registered_from_names(data);
    EXPECT_TRUE(!found.faults.empty() && has(found.faults.front(), words)) << words << found.refusal;
    const Eigen::Vector3d off_m = found.camera_from_rcm.translation - truth.translation;
    EXPECT_LT(off_m.cwiseQuotient(found.sigma_translation_m).norm(), 4) << words;
  }
}

TEST(RegisterArm, RefusesWhatCanNotTell) {
  EXPECT_TRUE(has(registered_from_names(recorded({.swing = {0.01, 0.01, 0.01, 0.01}})).refusal, "swing"));
  const Recorded data = recorded({});
  Recorded swapped = data, elsewhere = data, in_ms = data, few = data;
  for (auto& joints : swapped.recording.joints) std::swap(joints[0], joints[2]);
  EXPECT_NE(registered_from_names(swapped).refusal, "");
  for (double& time_s : elsewhere.recording.time_s) time_s += 100;
  EXPECT_TRUE(has(input_error([&] { registered_from_names(elsewhere); }), "has no time in common"));
  for (double& time_s : in_ms.recording.time_s) time_s *= 1000;
  EXPECT_TRUE(has(registered_from_names(in_ms).refusal, "time_s looks like milliseconds"));
  few.poses.clear();
  EXPECT_TRUE(has(registered_from_names(few).refusal, "found in 0 frames"));
  few.poses.assign(data.poses.begin(), data.poses.begin() + 10);
  EXPECT_TRUE(has(registered_from_names(few).refusal, "found in 10 frames"));
}

TEST(JointFaults, LostFramesAreMendedAtTheirTimeByTheJointsClock) {
  const Recorded data = recorded({.delay_s = 0});
  for (const double delay_s : {-20.0, 0.1, 25.0}) {
    std::vector<TimedPose> poses = data.poses;
    for (TimedPose& pose : poses) pose.time_s += delay_s;
    int part = 0;
    for (const JointFault& fault : sized_joint_faults(*data.truth.joints, poses, delay_s)) {
      if (!has(fault.text(-0.5), "frames are missing")) continue;
      JointRecording mended = data.recording;
      fault.mend(mended, -0.5);
      const auto first = std::ranges::mismatch(mended.time_s, data.recording.time_s).in2;
      ASSERT_NE(first, data.recording.time_s.end());
      EXPECT_NEAR(*first, 20.0 * ++part / 8, 0.02) << delay_s;
    }
    EXPECT_EQ(part, 7);
  }
}

// As far from the configuration as readings are taken.
TEST(RegisterArm, FindsNoOffsetThatARigMayNotHave) {
  const Recorded data = recorded({.offset = {0.2, 7.2, 1.05, 0.7}});
  Rig rig = testing::paper_test_rig();
  rig.instruments[0] = registered(data.truth, registered_from_names(data));
  EXPECT_NO_THROW(check_units(data.recording, *data.truth.joints, "joints.csv", JointsOf::arm));
  EXPECT_NO_THROW(measured_rig_yaml(rig, "rig.yaml"));
  rig.instruments[0].image_delay_s = 70;
  EXPECT_TRUE(has(input_error([&] { measured_rig_yaml(rig, "rig.yaml"); }), "image_delay_s: is 70"));
}

TEST(JointRecording, IsRefinedSmoothlyAndKeepsItsPauses) {
  JointRecording coarse;
  for (int i = 0; i < 40; ++i) {
    const double time_s = 0.05 * i + (i >= 20 ? 2 : 0);
    coarse.time_s.push_back(time_s), coarse.joints.push_back({std::sin(3 * time_s), 0, 0, 1});
  }
  const JointRecording fine = refined(coarse, 5e-3);
  for (std::size_t i = 0; i < fine.time_s.size(); ++i) {
    EXPECT_TRUE(i == 0 || fine.time_s[i] > fine.time_s[i - 1]) << i;
    EXPECT_NEAR(fine.joints[i][0], std::sin(3 * fine.time_s[i]), 2e-3);
  }
  EXPECT_TRUE(fine.at(0.501) && !fine.at(1.5) && !fine.at(-0.1) && !fine.at(9));
}

TEST(PosesInTable, LeavesOutWhatACameraFromRcmBent) {
  const lapservo::testing::TemporaryFolder folder;
  const std::string header =
      "time_s,instrument,status,theta_rad,marker_x_m,marker_y_m,marker_z_m,marker_qx,marker_qy,marker_qz,marker_qw,"
      "sigma_marker_xy_m,sigma_marker_z_m,sigma_axis_rad,sigma_roll_rad\n";
  const std::string pose = "0.01,0.02,0.1,0,0,0,1,1e-5,1e-4,1e-3,2e-3\n";
  const auto path = folder / "obs.csv";
  const auto read = [&](const std::string& rows) {
    lapservo::testing::write_file(path, header + rows);
    return poses_in_table(path, "A");
  };
  const auto found = read("0,A,ok,," + pose + "1,A,ok,0.3," + pose + "1,B,ok,," + pose + "2,A,cut,,,,,,,,,,,,\n");
  ASSERT_TRUE(found.all.size() == 1 && found.none.empty());
  EXPECT_DOUBLE_EQ(found.all[0].marker.sigma_roll_rad, 2e-3);
  EXPECT_TRUE(has(read("1,A,ok,0.3," + pose).none, "its 1 rows were measured with a camera_from_rcm"));
  EXPECT_TRUE(has(read("1,A,ok,,,,,,,,,,,,\n").none, "its 1 rows that are ok have no pose of the marker"));
  EXPECT_TRUE(has(input_error([&] { read("1,A,ok,," + pose + "0,A,ok,," + pose); }), "clock jumps"));
  EXPECT_TRUE(has(input_error([&] { read("0,A,ok,,0,0,1,0,0,0,2,1,1,1,1\n"); }), "no pose"));
}

TEST(RegisterRcm, PutsItWhereTheAxesMeet) {
  double squares = 0, count = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const Recorded data = recorded({.seed = seed});
    Instrument unknown = data.truth;
    unknown.camera_from_rcm.reset();
    const auto found = register_rcm(unknown, data.poses);
    ASSERT_EQ(found.refusal, "");
    EXPECT_FALSE(found.arm || found.sigma_quaternion);
    const Eigen::Vector3d off_m = found.camera_from_rcm.translation - data.truth.camera_from_rcm->translation;
    EXPECT_LT(off_m.norm(), 5e-4);
    squares += off_m.cwiseQuotient(found.sigma_translation_m).squaredNorm(), count += 3;
    // theta and phi are usable: no axis near the RCM frame's z.
    for (const TimedPose& pose : data.poses)
      EXPECT_GT((found.camera_from_rcm.rotation * Eigen::Vector3d::UnitZ()).cross(pose.axis()).norm(), 0.5);
  }
  EXPECT_GT(std::sqrt(squares / count), 0.05) << "sigma counts what frames have in common; these have nothing";
  EXPECT_LT(std::sqrt(squares / count), 1);
  const Recorded still = recorded({.swing = {0.05, 0.05, 0.05, 0.05}});
  EXPECT_TRUE(has(register_rcm(still.truth, still.poses).refusal, "too alike"));
}

// A fault of poses by themselves, with a size that is gross.
struct PoseFault {
  std::string name, cause;
  double gross;
  std::function<void(TimedPose&, double part, double size)> apply;
};

std::vector<PoseFault> pose_faults() {
  return {{"the RCM moves [m]", "the RCM moves by", 1e-2,
           [](TimedPose& pose, double part, double size) {
             pose.marker.camera_from_marker.translation += (part - 0.5) * size * Eigen::Vector3d(0.6, -0.64, 0.48);
           }},
          {"beside the shaft [m]", "beside the RCM and turns", 5e-3,
           [](TimedPose& pose, double, double size) {
             Rigid3& seen = pose.marker.camera_from_marker;
             seen.translation += size * (seen.rotation * Eigen::Vector3d(0.8, 0.6, 0));
           }},
          {"tilted [rad]", "along the view", 0.05, [](TimedPose& pose, double, double size) {
             const Eigen::Vector3d hinge = pose.axis().cross(pose.origin()).normalized();
             auto& rotation = pose.marker.camera_from_marker.rotation;
             rotation = Eigen::AngleAxisd(size, hinge) * rotation;
           }}};
}

TEST(RegisterRcm, RefusesOrNamesWhatNoPointExplainsAndItsSigmaHolds) {
  constexpr int seeds = 10;
  const auto tell = [&](const PoseFault* fault, double size) {
    int refused = 0, said = 0, named = 0, wrong = 0;
    double squares = 0;
    for (int seed = 1; seed <= seeds; ++seed) {
      Recorded data = recorded({.seed = 100 + static_cast<std::uint64_t>(seed)});
      const double span_s = data.poses.back().time_s - data.poses.front().time_s;
      for (TimedPose& pose : data.poses)
        if (fault) fault->apply(pose, (pose.time_s - data.poses.front().time_s) / span_s, size);
      const Registration found = register_rcm(data.truth, data.poses);
      const std::string words = !found.refusal.empty() ? found.refusal : found.faults.empty() ? "" : found.faults[0];
      said += !words.empty(), refused += !found.refusal.empty(), named += fault && has(words, fault->cause);
      if (!found.refusal.empty()) continue;
      const Eigen::Vector3d off = (found.camera_from_rcm.translation - data.truth.camera_from_rcm->translation)
                                      .cwiseQuotient(found.sigma_translation_m);
      squares += off.squaredNorm() / 3, wrong += off.cwiseAbs().maxCoeff() > 4;
    }
    const double error = std::sqrt(squares / std::max(1, seeds - refused));
    SCOPED_TRACE((fault ? fault->name : "clean") + ": " + std::to_string(size));
    EXPECT_EQ(wrong, 0);
    EXPECT_LT(error, 1.4);
    EXPECT_TRUE(fault || said == 0) << said;
    EXPECT_GE(named, fault ? 0.8 * said : 0);
    EXPECT_TRUE(!fault || size < fault->gross || said == seeds) << said;
  };
  tell(nullptr, 0);
  for (const PoseFault& fault : pose_faults())
    for (const double part : {0.01, 0.1, 0.3, 1.0, 3.0}) tell(&fault, part * fault.gross);
}

}  // namespace lapservo::internal::registration_test
