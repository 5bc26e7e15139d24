#include "lapservo/calibration/check/rig_check.h"

#include <array>
#include <cmath>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/renderer.h"
#include "lapservo/sim/tissue.h"
#include "lapservo/testing/has.h"
#include "lapservo/testing/scenes.h"

namespace lapservo::internal::rig_check_test {

constexpr double fps = 6, delay_s = 0.1;
constexpr int frames = 108;
constexpr double phi_swing_rad = 0.18;

JointVector q_at(double t, double phi_rad = phi_swing_rad) {
  return {0.22 * std::sin(0.9 * t), 1.57 + phi_rad * std::sin(1.3 * t + 1), 0.089 + 0.008 * std::sin(0.7 * t),
          3.3 * std::sin(0.5 * t + 2)};
}

// As everything really is.
const Rig& true_rig() {
  static const Rig rig = [] {
    Rig usual = scenes::usual_rig();
    usual.instruments[0].joints = Joints{{"yaw", "pitch", "insertion", "roll"}, {1, -1, 1, 1}, {0, 1.5, -0.01, 0.3}};
    usual.instruments[0].image_delay_s = delay_s;
    return usual;
  }();
  return rig;
}

std::vector<cv::Mat> rendered(int count, const RenderOptions& options, double phi_rad = phi_swing_rad,
                              const Rig& rig = true_rig()) {
  Renderer renderer(rig.camera, shafts_of(rig), make_tissue(rig.camera.width_px, rig.camera.height_px, 5), options);
  std::vector<cv::Mat> pictures;
  for (int i = 0; i < count; ++i)
    pictures.push_back(
        renderer.render({placement_of(rig.instruments[0], q_at(i / fps, phi_rad))}, static_cast<std::uint64_t>(i)));
  return pictures;
}

// `slip_rad`: by how much theta's joint lags more at the end than at the beginning.
JointRecording joints_meanwhile(double slip_rad = 0, double phi_rad = phi_swing_rad) {
  const Joints& joints = *true_rig().instruments[0].joints;
  JointRecording recording;
  for (double t = -0.6; t < frames / fps + 0.6; t += 0.02) {
    const Eigen::Vector4d q = q_at(t, phi_rad).vector();
    std::array<double, 4> at;
    for (std::size_t j = 0; j < 4; ++j) at[j] = (q[static_cast<Eigen::Index>(j)] - joints.offset[j]) / joints.sign[j];
    at[0] += slip_rad * t * fps / frames;
    recording.time_s.push_back(t - delay_s), recording.joints.push_back(at);
  }
  return recording;
}

RigFindings found_out(const Rig& rig, const std::vector<cv::Mat>& pictures, const JointRecording& recording,
                      bool with_print = false) {
  RigEvidence evidence(rig, 0);
  for (std::size_t i = 0; i < pictures.size(); ++i) evidence.add(pictures[i], static_cast<double>(i) / fps);
  RigFindings findings = findings_of(rig, 0, evidence);
  if (evidence.poses().size() > 40)
    findings.arm =
        check_arm(rig.instruments[0], rig.camera, evidence.poses(), evidence.tracked_psi(), recording, "joints.csv");
  if (with_print) findings.print = check_print(rig, 0, evidence.take_key_frames());
  return findings;
}

class CheckRig : public ::testing::Test {
 protected:
  static const std::vector<cv::Mat>& pictures() {
    static const std::vector<cv::Mat> all = rendered(frames, {});
    return all;
  }
  // The advice, those that are needed, as text.
  static std::vector<std::string> needed(const RigFindings& findings) {
    std::vector<std::string> texts;
    for (const Advice& advice : advice_on(findings))
      if (advice.needed) texts.push_back(advice.what + " -> " + advice.command);
    return texts;
  }
  static void expect_first(const RigFindings& findings, const std::string& word) {
    const auto texts = needed(findings);
    ASSERT_FALSE(texts.empty()) << word;
    EXPECT_TRUE(testing::has(texts.front(), word));
  }

  static RigFindings well_lit() {
    RigFindings findings;
    findings.light = MarkerLight{.value = 200, .chroma = 100};
    findings.registered = true, findings.width_px = 100;
    return findings;
  }

  Rig rig = true_rig();
  Instrument& instrument = rig.instruments[0];
  const JointRecording joints = joints_meanwhile();
};

// A boundary under blood is found in the only image there is, however long that takes.
TEST(RigEvidence, SearchesEachPictureWhole) {
  Rig rig = true_rig();
  MarkerSigmas& sigmas = rig.instruments[0].marker.sigmas;  // a print that was measured may show little of itself
  sigmas.bands_upper_m = sigmas.bands_lower_m = std::array{1e-5, 1e-5, 1e-5};
  RigEvidence evidence(rig, 0);
  evidence.add(scenes::BloodyMotion(rig, 0.6, 5, 1).frames[0], 0);
  EXPECT_EQ(evidence.count(Status::ok), 1);
}

// With a misprinted marker, so that all of the trackers have something to do.
TEST(RigEvidence, IsTheSameFromOneCoreAndFromTwo) {
  Rig rig = true_rig();
  rig.instruments[0].marker.bands_upper_m[0] += 0.05e-3, rig.instruments[0].marker.bands_upper_m[1] -= 0.05e-3;
  const std::vector<cv::Mat> pictures = rendered(12, {});
  const auto numbers = [&](RigEvidence::Cores cores) {
    RigEvidence evidence(rig, 0, cores);
    for (std::size_t i = 0; i < pictures.size(); ++i) evidence.add(pictures[i], static_cast<double>(i) / fps);
    EXPECT_GE(evidence.poses().size(), 10U);
    std::vector<double> all;
    for (const FrameEvidence& f : evidence.frames()) {
      all.insert(all.end(), {static_cast<double>(f.status), f.sigma_roll_rad, f.psi_rad.value_or(-1), f.width_px});
      all.insert(all.end(), f.light.value().hues_deg.begin(), f.light.value().hues_deg.end());
    }
    for (const TimedPose& pose : evidence.poses())
      for (const Eigen::Vector3d& m : {pose.origin(), pose.by_focal.origin_m})
        all.insert(all.end(), m.begin(), m.end());
    const auto keys = evidence.take_key_frames();
    EXPECT_FALSE(keys.empty());
    for (const KeyFrame& key : keys) all.push_back(key.sighting.tau_rad);
    return all;
  };
  EXPECT_EQ(numbers(RigEvidence::Cores::one), numbers(RigEvidence::Cores::two));
}

// All frames share what the rig's sigmas say: it is no noise of a pose.
TEST(RigEvidence, ItsPosesHaveTheSigmasOfTheirFrames) {
  Rig measured = true_rig();
  Marker& marker = measured.instruments[0].marker;
  marker.sigmas.bands_upper_m = marker.sigmas.bands_lower_m = std::array{1e-5, 1e-5, 1e-5};
  marker.sigmas.diameter_m = 2e-5, marker.tolerance_m = 1e-5, measured.camera.covariance.emplace().setIdentity();
  measured.camera.sigmas.fx_px = measured.camera.sigmas.fy_px = 3, measured.camera.response.sigma = 0.01;
  RigEvidence exact(true_rig(), 0), evidence(measured, 0);
  for (const cv::Mat& picture : rendered(4, {})) exact.add(picture, 0), evidence.add(picture, 0);
  ASSERT_EQ(evidence.poses().size(), 4U);
  ASSERT_EQ(exact.poses().size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(evidence.poses()[i].marker.sigma_roll_rad, exact.poses()[i].marker.sigma_roll_rad);
    EXPECT_EQ(evidence.poses()[i].marker.sigma_z_m, exact.poses()[i].marker.sigma_z_m);
  }
}

// An exception of both halves reaches the caller once, wherever they ran.
TEST(RigEvidence, PassesErrorsOn) {
  for (const auto cores : {RigEvidence::Cores::one, RigEvidence::Cores::two}) {
    RigEvidence evidence(true_rig(), 0, cores);
    EXPECT_ANY_THROW(evidence.add(cv::Mat(), 0));
    EXPECT_ANY_THROW(evidence.add(cv::Mat(7, 7, CV_8UC3), 0));
  }
}

TEST_F(CheckRig, AGoodRigIsGoodEnough) {
  const RigFindings findings = found_out(rig, pictures(), joints, true);
  EXPECT_EQ(needed(findings), std::vector<std::string>{});
  ASSERT_TRUE(findings.arm);
  EXPECT_EQ(findings.arm->refusal, "");
  EXPECT_EQ(findings.arm->region.find("yaw -0.22 to 0.22 rad, pitch"), 0U) << findings.arm->region;
  EXPECT_EQ(findings.print->refusal, "");
  EXPECT_EQ(findings.found, frames);
  EXPECT_NEAR(findings.arm->measured_delay_s, delay_s, 2e-3);
  EXPECT_LT(findings.arm->place_m->value, 0.2e-3);
  EXPECT_LT(findings.arm->focal.value, 2e-3);
  EXPECT_LT(findings.print->psi_rad.value, 3e-3);
  EXPECT_EQ(findings.arm->by_rig.size(), findings.arm->at_best.size());
  EXPECT_GT(findings.arm->beyond_encoder.size(), 100U);
  for (const TrackedPsi& off : findings.arm->beyond_encoder) EXPECT_NEAR(off.psi_rad, 0, 6e-3) << off.time_s;
}

TEST_F(CheckRig, NamesAWrongFocalLengthFirst) {
  rig.camera.fx_px *= 1.03, rig.camera.fy_px *= 1.03;
  const RigFindings findings = found_out(rig, pictures(), joints, true);
  expect_first(findings, "focal length is 2.");
  EXPECT_NEAR(findings.arm->focal.value, 0.03 / 1.03, 0.0025);
}

TEST_F(CheckRig, NamesAWrongRegistrationFirst) {
  instrument.camera_from_rcm->translation += Eigen::Vector3d(6e-3, -6e-3, 5e-3);
  const RigFindings findings = found_out(rig, pictures(), joints);
  expect_first(findings, "registration");
  EXPECT_NEAR(findings.arm->place_m->value, 9.85e-3, 0.3e-3);
}

// A sign of pitch that is wrong shows nowhere in these images.
TEST_F(CheckRig, CallsNoRigGoodWhereAJointStoodStill) {
  instrument.joints->sign[1] *= -1;
  const RigFindings findings = found_out(rig, rendered(60, {}, 0.01), joints_meanwhile(0, 0.01));
  expect_first(findings, "pitch moved by 0.02 rad only, at least 0.10 rad");
}

TEST_F(CheckRig, NamesAWrongDelayFirst) {
  *instrument.image_delay_s += 0.06;
  expect_first(found_out(rig, pictures(), joints), "image_delay_s is 60 ms off");
}

TEST_F(CheckRig, NamesAPrintThatIsOffFirst) {
  instrument.marker.bands_upper_m[0] += 0.2e-3, instrument.marker.bands_upper_m[1] -= 0.2e-3;
  expect_first(found_out(rig, pictures(), joints, true), "the print is not the rig's");
}

// One edge slips in the midst of the recording.
TEST_F(CheckRig, CallsNoRigGoodWhosePrintSlips) {
  Rig slipped = rig;
  for (double& lower_m : slipped.instruments[0].marker.bands_lower_m) lower_m += 0.4e-3;
  std::vector<cv::Mat> both = rendered(frames, {}, phi_swing_rad, slipped);
  std::copy_n(pictures().begin(), frames / 2, both.begin());
  KeyFrames keys(rig, 0);
  for (std::size_t i = 0; i < both.size(); ++i) keys.add(both[i], static_cast<double>(i) / fps);
  RigFindings findings = well_lit();
  findings.print = check_print(rig, 0, keys.take());
  expect_first(findings, "the print slips");
}

TEST_F(CheckRig, NamesDriftFirst) {
  expect_first(found_out(rig, pictures(), joints_meanwhile(0.05)), "drifts by");
}

TEST_F(CheckRig, NamesBadLightFirst) {
  for (const auto& [light, word] : {std::pair(0.02F, "dark"), {6.0F, "overexposed"}})
    expect_first(found_out(rig, rendered(8, {.lighting = {}, .sensor = {.gains = Light::Constant(light)}}), joints),
                 word);
  std::vector<cv::Mat> tinted = rendered(16, {});
  for (double by = -0.2; cv::Mat & bgr : tinted) cv::multiply(bgr, cv::Scalar(1 - by, 1, 1 + by), bgr), by += 0.025;
  expect_first(found_out(rig, tinted, joints), "the hues move by");
}

TEST_F(CheckRig, NamesAWrongResponseFirst) {
  rig.camera.response = {Response::Kind::power, 1.8};
  expect_first(found_out(rig, pictures(), joints),
               "encodes light otherwise than the rig says, rather as srgb: edges of channels");
  rig.camera.response.sigma = 0.0025;  // by a board: the marker contradicts it, and only this replaces it
  RigFindings findings = found_out(rig, pictures(), joints);
  expect_first(findings, "than the rig says and a board did, rather as srgb");
  expect_first(findings, "lapservo calibrate colour --replace-response");
  findings.lossy = true;  // which moves edges, too
  for (const std::string& text : needed(findings)) EXPECT_FALSE(testing::has(text, "encodes light"));
}

// The same marker at the same place may well suffice without losses.
TEST_F(CheckRig, SeesAPoorWorkSpaceInACompressedRecordingAsTheRecordings) {
  for (const bool lossy : {false, true}) {
    RigFindings findings = well_lit();
    findings.lossy = lossy;
    findings.work_space = WorkSpace{.good = 0, .worst_rad = 0.015, .places = 30};
    expect_first(findings, lossy ? "-> record without losses" : "-> come nearer");
  }
}

TEST_F(CheckRig, WithoutJointsComparesTheRcm) {
  RigEvidence evidence(rig, 0);
  for (std::size_t i = 0; i < pictures().size(); ++i) evidence.add(pictures()[i], static_cast<double>(i) / fps);
  const RcmCheck right = check_rcm(instrument, evidence.poses());
  ASSERT_EQ(right.refusal, "");
  EXPECT_LT(right.distance_m.value, 0.5e-3);
  instrument.camera_from_rcm->translation.x() += 10e-3;
  RigFindings findings = findings_of(rig, 0, evidence);
  findings.rcm = check_rcm(instrument, evidence.poses());
  expect_first(findings, "axes meet");
  findings.rcm->distance_m = Told{1.8e-3, 2.15e-3};
  expect_first(findings, "does not show whether the rig's RCM is right");
}

// A camera alone gives poses in its frame, which need no joints.
TEST_F(CheckRig, NeedsARegistrationOnlyForRecordingsWithJoints) {
  for (const bool has_joints : {false, true}) {
    RigFindings findings = well_lit();
    findings.registered = false, findings.has_joints = has_joints;
    const auto all = advice_on(findings);
    ASSERT_EQ(all.size(), 1U);
    EXPECT_EQ(all[0].needed, has_joints);
    EXPECT_TRUE(
        testing::has(all[0].what, has_joints ? "the rig has no camera_from_rcm" : "are not checked: they need joints"));
  }
}

// Too few for the axes' meeting point, and each of them shows it.
TEST_F(CheckRig, CallsNoRigGoodWhoseRcmMostFramesMiss) {
  const std::vector<cv::Mat> few = rendered(8, {});
  EXPECT_FALSE(found_out(rig, few, joints).missed_rcm.is_wrong());
  instrument.camera_from_rcm->translation += Eigen::Vector3d(4e-3, 4e-3, 0);  // across the shaft
  expect_first(found_out(rig, few, joints), "in 8 of 8 frames the shaft misses the rig's RCM");
}

}  // namespace lapservo::internal::rig_check_test
