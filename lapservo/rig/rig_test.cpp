#include "lapservo/rig/rig.h"

#include <array>
#include <cstddef>
#include <filesystem>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "lapservo/rig/check_rig.h"
#include "lapservo/testing/has.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal::rig_test {
namespace fs = std::filesystem;
using testing::input_error;

const std::string good = R"(camera:
  image_width: 1280
  image_height: 720
  distortion_model: plumb_bob
  camera_matrix: {rows: 3, cols: 3, data: [1100, 0, 639.5, 0, 1090, 359.5, 0, 0, 1]}
  distortion_coefficients: {rows: 1, cols: 5, data: [-0.1, 0.02, 0.001, -0.002, 0]}
  response: gamma:2.2
instruments:
  - name: PSM1
    marker:
      diameter_m: 0.0084
      hues_deg: [90, 180, 270]
      bands_upper_m: [0.0035, 0.0036, 0.0169]
      bands_lower_m: [0.0095, 0.0094, 0.0051]
      seam_rad: 0.25
      tolerance_m: 0.0001
    camera_from_rcm:
      translation_m: [-0.0778, 0.0672, 0.0592]
      quaternion_xyzw: [0, 0, 0.6, 0.8]
)";

std::string with(const std::string& old_text, const std::string& new_text) {
  return testing::replaced(good, old_text, new_text);
}

std::string error_of(const std::string& yaml) {
  return input_error([&] { parse_rig(yaml, "rig.yaml"); });
}

std::string with_joints(const std::string& names, const std::string& sign, const std::string& offset) {
  return good + "    joints: {names: " + names + ", sign: " + sign + ", offset: " + offset + "}\n";
}

// Another instrument of these colours and this name.
std::string second_instrument(const std::string& name, const std::string& hues_deg) {
  return "  - name: " + name + "\n    marker:\n      diameter_m: 0.0084\n      hues_deg: " + hues_deg +
         "\n      bands_upper_m: [0.0035, 0.0036, 0.0169]\n      bands_lower_m: [0.0095, 0.0094, 0.0051]\n";
}

TEST(Rig, HoldsWhatTheFileSays) {
  const Response gamma{Response::Kind::power, 2.2};
  const Camera camera{1280, 720, 1100, 1090, 639.5, 359.5, {-0.1, 0.02, 0.001, -0.002, 0}, gamma};
  const Marker print{0.0084, {90, 180, 270}, {0.0035, 0.0036, 0.0169}, {0.0095, 0.0094, 0.0051}, 0.25, 1e-4};
  const Rigid3 camera_from_rcm{Eigen::Quaterniond(0.8, 0, 0, 0.6), {-0.0778, 0.0672, 0.0592}};
  EXPECT_EQ(parse_rig(good, "rig.yaml"), (Rig{camera, {Instrument{"PSM1", print, camera_from_rcm}}}));
}

TEST(Rig, LeavesOutWhatIsOptional) {
  const Camera camera{64, 48, 50, 50, 32, 24, {}, {Response::Kind::srgb}};
  const Marker print{0.005, {90, 180, 270}, {0.003, 0.003, 0.009}, {0.006, 0.006, 0.003}};
  const Rig expected{camera, {Instrument{"tool", print, {}}}};
  EXPECT_EQ(parse_rig(R"(
camera: {image_width: 64, image_height: 48, camera_matrix: {data: [50, 0, 32, 0, 50, 24, 0, 0, 1]}}
instruments:
  - name: tool
    marker: {diameter_m: 0.005, bands_upper_m: [0.003, 0.003, 0.009], bands_lower_m: [0.006, 0.006, 0.003]}
)",
                      "rig.yaml"),
            expected);
}

// The others are read as RigWriter writes them.
TEST(Rig, ReadsALinearResponse) {
  EXPECT_EQ(parse_rig(with("gamma:2.2", "linear"), "rig.yaml").camera.response, (Response{Response::Kind::power, 1}));
}

// Keys that ROS's camera_calibration and calibrate write beside those that a rig needs.
TEST(Rig, TakesTheOtherKeysOfACameraInfoAndSigmas) {
  EXPECT_EQ(error_of(with("  response", R"(  camera_name: endoscope
  header: {frame_id: endoscope}
  rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
  projection_matrix: {rows: 3, cols: 4, data: [1090, 0, 640, 0, 0, 1080, 360, 0, 0, 0, 1, 0]}
  binning_x: 0
  binning_y: 1
  roi: {x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false}
  lateral_chromatic_aberration: {blue: 1, red: 1}
  sigma_camera_matrix: {rows: 3, cols: 3, data: [1, 0, 1, 0, 1, 1, 0, 0, 0]}
  sigma_distortion_coefficients: {data: [0.01, 0.01, 0.01, 0.01, 0]}
  response)")),
            "");
}

TEST(Rig, NormalisesARoundedQuaternion) {
  const Rig rig = parse_rig(with("[0, 0, 0.6, 0.8]", "[0, 0, 0.6001, 0.8]"), "rig.yaml");
  EXPECT_NEAR(rig.instruments[0].camera_from_rcm->rotation.norm(), 1, 1e-12);
}

using Complaints = std::vector<std::pair<std::string, std::string>>;  ///< YAML, and what is said of it

// Fields, and what is expected of them.
const std::string marker = "instruments[0].marker.", from_rcm = "instruments[0].camera_from_rcm.";
const std::string pixels = "expected a whole number of pixels, 16 to 16384";
const std::string finite = "expected a finite number";
const std::string response =
    "expected srgb, rec709, linear, gamma:VALUE with a value of 0.2 to 5, or a table of light and value";
const std::string matrix = " , expected fx 0 cx 0 fy cy 0 0 1 with fx and fy in pixels, at least 128";
const std::string quaternion = "expected x y z w of a unit quaternion, to four digits";
const std::string diameter = "expected 0.0005 to 0.1 (metres)";
const std::string not_decodable = "is not decodable, expected bands whose cross-ratio is monotonic over the rotation: ";

std::string unknown(const std::string& field, const std::string& nearest) {
  return field + ": is unknown, expected a known key, of which " + nearest + " is the nearest";
}

const Complaints missing_keys{
    {" \n", "file: is missing, expected a map with 'camera'"},
    {"image_width: 640\ncamera_matrix: {}",
     "file: is a camera file, expected a rig file with instruments, whose camera may be the path of this file"},
    {"instruments: []", "camera: is missing, expected a map with 'image_width'"},
    {good.substr(0, good.find("instruments")), "instruments: is missing, expected a list of instruments"},
    {good.substr(0, good.find("  - name")) + "  []\n",
     "instruments: is a list of 0, expected one to eight instruments"},
    {with("  image_width: 1280\n", ""), "camera.image_width: is missing, " + pixels},
    {with("data: [1100", "values: [1100"), unknown("camera.camera_matrix.values", "cols")},
    {with("      diameter_m: 0.0084\n", ""), marker + "diameter_m: is missing, " + diameter},
    {with("      translation_m: [-0.0778, 0.0672, 0.0592]\n", ""),
     from_rcm + "translation_m: is missing, expected x y z in metres"},
};

const Complaints wrong_types{
    {"rig", "file: is rig, expected a map with 'camera'"},
    {"camera: [1]\n", "camera: is a list of 1, expected a map with 'image_width'"},
    {with("1280", "1280px"), "camera.image_width: is 1280px, " + pixels},
    {with("  response", "  deinterlace: 1\n  response"), "camera.deinterlace: is 1, expected true or false"},
    {with("  response", "  readout_s: 25\n  response"), "camera.readout_s: is 25, expected -0.1 to 0.1 (seconds)"},
    {with("[-0.1", "[nan"), "camera.distortion_coefficients.data[0]: is nan, " + finite},
    {with("0, 0, 1]}", "0, 0]}"),
     "camera.camera_matrix.data: is a list of 8, expected nine numbers, fx 0 cx 0 fy cy 0 0 1"},
    {with("[-0.1, 0.02, ", "["),
     "camera.distortion_coefficients.data: is a list of 3, expected k1 k2 p1 p2 k3, of which k3 or all may be left "
     "out, or k4 k5 k6 of 0 follow"},
    {with("cols: 5, data: [-0.1, 0.02, 0.001, -0.002, 0]", "cols: 8, data: [-0.1, 0.02, 0.001, -0.002, 0, 0.1, 0, 0]"),
     "camera.distortion_coefficients.data: is a list of 8, expected k4 k5 k6 of 0: a rational lens is not modelled "
     "(lapservo calibrate camera fits plumb_bob)"},
    {with("gamma:2.2", "log"), "camera.response: is log, " + response},
    {with("[90, 180, 270]", "90"), marker + "hues_deg: is 90, expected three hues in degrees"},
    {with("[0.0035, 0.0036, 0.0169]", "[0.0035, 0.0205]"),
     marker + "bands_upper_m: is a list of 2, expected three lengths in metres"},
    {with("0.25", "left"), marker + "seam_rad: is left, expected an angle in radians"},
};

const Complaints impossible_cameras{
    {with("1280", "0"), "camera.image_width: is 0, " + pixels},
    {with("720", "1e6"), "camera.image_height: is 1e6, " + pixels},
    {with("plumb_bob", "equidistant"),
     "camera.distortion_model: is equidistant, expected plumb_bob, which lapservo calibrate camera fits"},
    {with("[1100", "[4.2"), "camera.camera_matrix.data: is 4.2 0 639.5 0 1090 359.5 0 0 1" + matrix},
    {with("1090", "1e7"), "camera.camera_matrix.data: is 1100 0 639.5 0 1e+07 359.5 0 0 1" + matrix},
    {with("[1100, 0,", "[1100, 2,"), "camera.camera_matrix.data: is 1100 2 639.5 0 1090 359.5 0 0 1" + matrix},
    {with("-0.1", "-5"),
     "camera.distortion_coefficients.data: is not invertible within the largest circle amid the image, expected k1 k2 "
     "p1 p2 k3 of a calibration that covers it"},
    {with("gamma:2.2", "gamma:0"), "camera.response: is gamma:0, " + response},
};

// Some rigs with an invalid marker; MarkerProblem tests the rest.
const Complaints impossible_instruments{
    {with("0.0001", "-0.0001"), marker + "tolerance_m: is -0.0001, expected 0 to 0.005 (metres)"},
    {with("[0.0095, 0.0094, 0.0051]", "[0.0165, 0.0036, 0.0039]"),
     "instruments[0].marker: " + not_decodable +
         "the cross-ratio turns back near tau = 3.25 rad, so that two rotations look the same"},
    {with("0.0672", "67.2"), from_rcm + "translation_m[1]: is 67.2, expected a length within 10 m"},
    {with("[0, 0, 0.6, 0.8]", "[0, 0, 0, 0]"), from_rcm + "quaternion_xyzw: is of norm 0.000000, " + quaternion},
    {with("PSM1", "'PSM,1'"), "instruments[0].name: is PSM,1, expected a name without commas and control characters"},
    {with("PSM1", R"("PSM\n1")"),
     "instruments[0].name: is PSM 1, expected a name without commas and control characters"},
};

// Keys that would be ignored or misread; more of them in the tests of KnownKeys.
const Complaints misunderstandings{
    {with("camera_from_rcm", "camera_from_rmc"), unknown("instruments[0].camera_from_rmc", "camera_from_rcm")},
    {good + "instrument: []\n", unknown("instrument", "instruments")},
    {good + "---\n" + good,
     "holds several documents, expected one: no line of three dashes in the midst of a rig file"},
    {with("[0, 0, 0.6, 0.8]", "[0, 0, 0.6, 0.79]"), from_rcm + "quaternion_xyzw: is of norm 0.992018, " + quaternion},
    {with("rows: 3", "rows: 2"), "camera.camera_matrix.rows: is 2, expected 3"},
    {with("  response", "  rectification_matrix: {data: [1, 0, 0, 0, 1, 0, 0, 0, 1.1]}\n  response"),
     "camera.rectification_matrix: is no rotation, expected nine numbers of a rotation"},
    {with("  response", "  lateral_chromatic_aberration: {blue: 0.9993, red: 1.3}\n  response"),
     "camera.lateral_chromatic_aberration.red: is 1.3, expected 0.98 to 1.02, times green's image"},
    {with("gamma:2.2", "{light: [0, 0.5, 0.4, 1], value: [0, 0.3, 0.6, 1]}"),
     "camera.response.light[2]: is 0.4, expected 2 to 4096 numbers that rise from 0 to 1"},
    {with("gamma:2.2", "{light: [0, 0.5, 1], value: [0, 1]}"),
     "camera.response.value: is a list of 2, expected as many numbers as light has"},
    {with("gamma:2.2", "{light: [0, 1], value: [0, 1], sigma_light: [0]}"),
     "camera.response.sigma_light: is a list of 1, expected standard deviations: numbers from 0 up, as many as they "
     "belong to"},
    {with("0, 0, 1]}", "0, 0, 1], sigma_data: [0, 0, 0, 0, 0, 0, 0, 0, 0]}"),
     unknown("camera.camera_matrix.sigma_data", "data")},
};

const std::string names = "[yaw, pitch, insertion, roll]", sign = "[1, -1, 1, 1]", offset = "[0, 1.5, -0.0156, 0]";
const std::string four = "expected four different names, of theta, phi, rho and psi, without commas";
const std::string joints = "instruments[0].joints.";
const Complaints impossible_joints{
    {with_joints(names, sign, "[0, 90, -0.0156, 0]"),
     joints + "offset: is a list of 4, expected radians within 12.57 for number 2: 90 looks like degrees"},
    {with_joints("[a, b, c]", sign, offset), joints + "names: is a list of 3, " + four},
    {with_joints("[a, b, a, d]", sign, offset), joints + "names[2]: is a, " + four},
    {with_joints("[a, b, 'c,', d]", sign, offset), joints + "names[2]: is c,, " + four},
    {with_joints(names, "[1, 2, 1, 1]", offset), joints + "sign: is 2.000000, expected 1 or -1"},
    {good + "    joints: {names: " + names + ", sign: " + sign + "}\n",
     joints + "offset: is missing, expected four numbers, rad rad m rad"},
    {with_joints(names, sign, "[0, 1.5, -156, 0]"),
     joints + "offset[2]: is -156, expected an offset within 100 rad or m"},
    {good + "    joints: {names: " + names + ", sign: " + sign + ", offset: " + offset + ", scale: 1}\n",
     joints + unknown("scale", "names")},
    {good + "    image_delay_s: 80\n", "instruments[0].image_delay_s: is 80, expected -60 to 60 (seconds)"},
};

const Complaints confusable_instruments{
    {good + second_instrument("PSM1", "[180, 270, 90]"),
     "instruments[1].name: is PSM1, expected a name that no other instrument has"},
    {good + second_instrument("PSM2", "[95, 175, 265]"),
     "instruments[1].marker.hues_deg: is like that of PSM1 in the middle band and one more, expected another order of "
     "colours: it is what names the "
     "instrument"},
    {good + second_instrument("PSM2", "[265, 185, 95]"),
     "instruments[1].marker.hues_deg: is like that of PSM1 reversed in the middle band and one more, expected another "
     "middle colour: turned end for "
     "end, the two look the same"},
};

TEST(Rig, IsRefusedInOneLineNamingFileFieldValueAndExpectation) {
  for (const Complaints& complaints : {missing_keys, wrong_types, impossible_cameras, impossible_instruments,
                                       misunderstandings, impossible_joints, confusable_instruments})
    for (const auto& [yaml, expected] : complaints) EXPECT_EQ(error_of(yaml), "rig.yaml: " + expected);
}

TEST(Rig, TakesThreeInstrumentsOfCyclicColourOrdersAndNotNine) {
  const Rig rig = parse_rig(
      good + second_instrument("PSM2", "[180, 270, 90]") + second_instrument("PSM3", "[270, 90, 180]"), "rig.yaml");
  ASSERT_EQ(rig.instruments.size(), 3U);
  EXPECT_EQ(rig.instruments[2].name, "PSM3");
  std::string nine = good;
  for (int i = 2; i <= 9; ++i) nine += second_instrument("PSM" + std::to_string(i), "[90, 180, 270]");
  EXPECT_EQ(error_of(nine), "rig.yaml: instruments: is a list of 9, expected one to eight instruments");
}

TEST(LoadRig, NamesTheFileThatIsWrongOrCanNotBeRead) {
  const testing::TemporaryFolder folder;
  const auto said = [&](const fs::path& path) { return input_error([&] { load_rig(path); }); };
  testing::write_file(folder / "camera.yaml", "image_width: wide");
  testing::write_file(folder / "rig.yaml", "camera: camera.yaml\n" + good.substr(good.find("instruments:")));
  EXPECT_EQ(said(folder / "rig.yaml"), (folder / "camera.yaml").string() + ": image_width: is wide, " + pixels);
  testing::write_file(folder / "empty.yaml", "");
  EXPECT_EQ(said(folder / "empty.yaml"), (folder / "empty.yaml").string() + ": is empty, expected a YAML file");
  EXPECT_EQ(error_of("camera: /dev/zero"), "/dev/zero: is larger than 1 MiB, expected a YAML file");
}

// As older drivers of ROS write plumb_bob.
TEST(Rig, ReadsPlumbBobOfFourFiveEightAndNoNumbers) {
  const std::string five = "cols: 5, data: [-0.1, 0.02, 0.001, -0.002, 0]";
  const auto distortion = [&](const std::string& yaml) { return parse_rig(yaml, "rig").camera.distortion; };
  const std::array<double, 5> expected{-0.1, 0.02, 0.001, -0.002, 0};
  EXPECT_EQ(distortion(good), expected);
  EXPECT_EQ(distortion(with(five, "cols: 4, data: [-0.1, 0.02, 0.001, -0.002]")), expected);
  EXPECT_EQ(distortion(with(five, "cols: 8, data: [-0.1, 0.02, 0.001, -0.002, 0, 0, 0, 0]")), expected);
  EXPECT_EQ(distortion(with(five, "cols: 0, data: []")), (std::array<double, 5>{}));
  EXPECT_EQ(distortion(with("distortion_model: plumb_bob", "camera_model: plumb_bob")), expected);
  EXPECT_EQ(distortion(with("distortion_model: plumb_bob", "distortion_model: rational_polynomial")), expected);
}

// Endoscopes show a circle: the corners were never measured.
TEST(Rig, OfALensThatFoldsInTheCornersAloneIsTaken) {
  const Rig rig = parse_rig(with("[-0.1, 0.02, 0.001, -0.002, 0]", "[-0.45, 0, 0, 0, 0]"), "rig.yaml", "");
  EXPECT_FALSE(rig.camera.ideal_from_raw({0, 0}));
  EXPECT_TRUE(rig.camera.ideal_from_raw({639.5, 0}));
}

TEST(Rig, WhoseCovarianceIsNotSymmetricIsRefused) {
  for (const auto& map : {std::pair<std::string, int>("    camera_from_rcm:\n", 6), {"camera:\n", 9}}) {
    const std::string& place = map.first;
    const int size = map.second;
    const auto text = [&](const std::string& number) {
      std::string numbers = "1e-6, " + number;
      for (int i = 2; i < size * size; ++i) numbers += i % (size + 1) == 0 ? ", 1e-6" : i == size ? ", 5e-7" : ", 0";
      const std::string indent(place.find_first_not_of(' ') + 2, ' ');
      return with(place, fmt::format("{}{}covariance: {{rows: {}, cols: {}, data: [{}]}}\n", place, indent, size, size,
                                     numbers));
    };
    EXPECT_EQ(error_of(text("5e-7")), "") << place;
    EXPECT_NE(error_of(text("4e-7")), "") << place;
  }
}

// Put together in a program.
TEST(Rig, WithWhichNothingCanBeSeenIsRefused) {
  const Rig right = parse_rig(good, "rig.yaml");
  check_rig(right);
  const auto expect_refused = [&](const auto& change) {
    Rig rig = right;
    change(rig);
    EXPECT_THROW(check_rig(rig), InputError);
  };
  constexpr double none = std::numeric_limits<double>::quiet_NaN();
  expect_refused([](Rig& rig) { rig = {}; });
  expect_refused([](Rig& rig) { rig.camera.fx_px = none; });
  expect_refused([](Rig& rig) { rig.camera.distortion[4] = none; });
  expect_refused([=](Rig& rig) { rig.camera.covariance.emplace().setConstant(none); });
  expect_refused([](Rig& rig) { rig.instruments.clear(); });
  expect_refused([](Rig& rig) { rig.instruments[0].marker.diameter_m = -1; });
  expect_refused([](Rig& rig) { rig.instruments.push_back(rig.instruments[0]); });
  expect_refused([](Rig& rig) { rig.instruments[0].camera_from_rcm->translation.x() = none; });
}

}  // namespace lapservo::internal::rig_test
