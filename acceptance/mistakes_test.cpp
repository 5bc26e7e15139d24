// Mistakes of users, and the answers of the tool: a table of inputs with one mistake each, the commands that meet it
// first, and words of the cause and of the remedy that each of them says. The test prints it; a row that fails shows
// the answer. Inputs are recordings of `lapservo sample`, or of `lapservo render` with another rig, that are altered.

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "acceptance/tool_test.h"
#include "lapservo/core/csv.h"

namespace lapservo {
using namespace internal;
namespace {
namespace fs = std::filesystem;
using lapservo::testing::read_file;
using lapservo::testing::write_file;

constexpr double degrees = 180 / std::numbers::pi;

// Lines of the sample's rigs.
const std::string diameter = "diameter_m: 0.0084", hues = "hues_deg: [116, 209, 294]",
                  focal = "[825, 0, 474.3, 0, 825,",
                  upper = "bands_upper_m: [0.006975500000000001, 0.0077745, 0.01025]",
                  lower = "bands_lower_m: [0.01013, 0.011869999999999999, 0.003]", sign = "sign: [1, -1, 1, 1]";

const std::string with_joints = " swing --fps 8 --joints swing_joints.csv --rig rig.yaml";
const std::string track = "track swing --fps 8 --rig rig.yaml --out seen.csv", check = "check" + with_joints,
                  registration = "calibrate registration" + with_joints + " --out out.yaml",
                  marker = "calibrate marker turn --fps 8 --rig rig.yaml --out out.yaml",
                  camera = "calibrate camera boards --board 9x6 --square-mm 5 --rig rig.yaml --out out.yaml",
                  servo = "servo --rig rig.yaml --robot sim --duration 1 --out run --set-point 2.43,1194,245,175",
                  arm =
                      "servo --rig rig.yaml --camera ros2:/endoscope/image_raw --enable-motion --duration 1 "
                      "--set-point 2.43,1194,245,175 --joint-limits joint_limits.yaml --robot ros2:";

using Changes = std::vector<std::pair<std::string, std::string>>;

struct Mistake {
  std::string name;
  std::function<void()> make;  ///< in a folder with the sample, whose true rig is rig.yaml
  std::vector<std::string> commands, words;
};

std::string changed(std::string text, const Changes& changes) {
  for (const auto& [what, by] : changes) {
    const auto at = text.find(what);
    EXPECT_NE(at, std::string::npos) << what;
    if (at != std::string::npos) text.replace(at, what.size(), by);
  }
  return text;
}

void rewrite(const std::string& file, const std::string& text) {
  fs::remove(file);  // a link into the sample
  write_file(file, text);
}

std::function<void()> in_file(const std::string& file, Changes changes) {
  return [=] { rewrite(file, changed(read_file(file), changes)); };
}
std::function<void()> in_rig(Changes changes) {
  return in_file("rig.yaml", std::move(changes));
}

// As before any registration.
void forget_registration() {
  const std::string rig = read_file("rig.yaml");
  const auto from = rig.find("    camera_from_rcm:"), to = rig.find("    joints:");
  rewrite("rig.yaml", rig.substr(0, from) + rig.substr(to));
}

// A folder of its own in the place of the link.
std::function<void()> in_images(std::function<cv::Mat(const cv::Mat&)> change, const std::string& extension = ".png",
                                int quality = 95) {
  return [=] {
    const fs::path from = fs::canonical("swing");
    fs::remove("swing"), fs::create_directory("swing");
    for (const auto& entry : fs::directory_iterator(from))
      cv::imwrite("swing/" + entry.path().stem().string() + extension, change(cv::imread(entry.path().string())),
                  {cv::IMWRITE_PNG_COMPRESSION, 1, cv::IMWRITE_JPEG_QUALITY, quality});
  };
}

cv::Mat mirrored(const cv::Mat& bgr) {
  cv::Mat image;
  cv::flip(bgr, image, 1);
  return image;
}
cv::Mat turned(const cv::Mat& bgr) {
  cv::Mat image;
  cv::rotate(bgr, image, cv::ROTATE_180);
  return image;
}
cv::Mat exchanged(const cv::Mat& bgr) {
  cv::Mat image;
  cv::cvtColor(bgr, image, cv::COLOR_BGR2RGB);
  return image;
}
cv::Mat grey(const cv::Mat& bgr) {
  cv::Mat image;
  cv::cvtColor(bgr, image, cv::COLOR_BGR2GRAY);
  cv::cvtColor(image, image, cv::COLOR_GRAY2BGR);
  return image;
}
std::function<cv::Mat(const cv::Mat&)> levels(double gain, double offset) {
  return [=](const cv::Mat& bgr) {
    cv::Mat image;
    bgr.convertTo(image, -1, gain, offset);
    return image;
  };
}
// A sensor's noise in the dark.
cv::Mat covered(const cv::Mat& bgr) {
  cv::Mat image(bgr.size(), bgr.type());
  cv::RNG random(7);
  random.fill(image, cv::RNG::UNIFORM, 0, 5);
  return image;
}

// Columns time_s, yaw, pitch, insertion, roll.
std::function<void()> in_joints(std::function<std::array<double, 5>(std::array<double, 5>)> change) {
  return [=] {
    const CsvTable table = CsvTable::read("swing_joints.csv");
    const std::array<const char*, 5> columns{"time_s", "yaw", "pitch", "insertion", "roll"};
    std::string text = "time_s,yaw,pitch,insertion,roll\n";
    for (std::size_t row = 0; row < table.rows(); ++row) {
      std::array<double, 5> values{};
      for (std::size_t i = 0; i < 5; ++i) values[i] = table.number(row, columns[i]);
      values = change(values);
      for (std::size_t i = 0; i < 5; ++i) text += (i > 0 ? "," : "") + std::to_string(values[i]);
      text += "\n";
    }
    rewrite("swing_joints.csv", text);
  };
}

// The sample's turn or swing again, before a rig that is changed; its own rig.yaml stays as it is.
void render(const std::string& recording, const Changes& changes) {
  write_file("mounted.yaml", changed(read_file("rig.yaml"), changes));
  const bool turn = recording == "turn";
  std::string poses = "theta_rad,phi_rad,rho_m,psi_rad\n";
  for (int i = 0; i < (turn ? 48 : 100); ++i) {
    const double t = i / 8.0;
    const std::array<double, 4> q =
        turn ? std::array{0.02 * std::sin(t), 1.57, 0.089, -3 + 1.05 * 2 * std::numbers::pi * i / 48}
             : std::array{0.22 * std::sin(0.9 * t), 1.57 + 0.18 * std::sin(1.3 * t + 1),
                          0.089 + 0.008 * std::sin(0.7 * t), 3.3 * std::sin(0.6 * t + 2)};
    for (std::size_t k = 0; k < 4; ++k) poses += std::to_string(q[k]) + (k < 3 ? "," : "\n");
  }
  write_file("poses.csv", poses);
  fs::remove(recording);
  const std::string command = std::string(LAPSERVO_TOOL) + " render --rig mounted.yaml --poses poses.csv --out ";
  EXPECT_EQ(std::system((command + recording + " >stdout 2>stderr").c_str()), 0) << read_file("stderr");
}
std::function<void()> mounted(const std::string& recording, Changes changes) {
  return [=] { render(recording, changes); };
}

const Changes mirrored_print{{upper, "bands_upper_m: [0.01013, 0.01187, 0.003]"},
                             {lower, "bands_lower_m: [0.0069755, 0.0077745, 0.01025]"}};
// Turned about an axis across the shaft: bands, and what of them is up, come in reverse.
const Changes wrong_way_round{{upper, "bands_upper_m: [0.003, 0.01187, 0.01013]"},
                              {lower, "bands_lower_m: [0.01025, 0.0077745, 0.0069755]"},
                              {hues, "hues_deg: [294, 209, 116]"}};
const Changes printed_at_96_percent{{upper, "bands_upper_m: [0.0066965, 0.0074635, 0.00984]"},
                                    {lower, "bands_lower_m: [0.0097248, 0.0113952, 0.00288]"}};
const Changes guessed_focal{{focal, "[1200, 0, 474.3, 0, 1200,"}};

std::vector<Mistake> mistakes() {
  const auto moved_endoscope = mounted("swing", {{"[-0.078, 0.067, 0.059]", "[-0.072, 0.067, 0.063]"}});
  return {
      {"radius for diameter",
       in_rig({{diameter, "diameter_m: 0.0042"}}),
       {track, check},
       {"twice the rig's", "not the radius"}},
      {"diameter in mm", in_rig({{diameter, "diameter_m: 8.4"}}), {track}, {"diameter_m: is 8.4", "metres"}},
      {"diameter 5 % off",
       in_rig({{diameter, "diameter_m: 0.0088"}}),
       {marker},
       {"4.8 % longer", "diameter_m", "callipers"}},
      {"print scaled by the printer",
       mounted("turn", printed_at_96_percent),
       {marker},
       {"4.0 % shorter", "printer", "callipers"}},
      {"hues in reverse order",
       in_rig({{hues, "hues_deg: [294, 209, 116]"}}),
       {track, check},
       {"hues in another order", "hues_deg: [116, 209, 294]"}},
      {"hues of the print's design",
       in_rig({{hues, "hues_deg: [90, 180, 270]"}}),
       {check},
       {"hues are 30 degrees", "calibrate colour"}},
      {"print mirrored", mounted("swing", mirrored_print), {track}, {"the print is mirrored", "print it anew"}},
      {"marker the wrong way round",
       mounted("swing", wrong_way_round),
       {track, check, registration},
       {"mounted the wrong way round", "belongs to the trocar"}},
      {"the same, without registration",
       [] { render("swing", wrong_way_round), forget_registration(); },
       {check, registration},
       {"mounted the wrong way round", "belongs to the trocar"}},
      {"focal length guessed",
       [] { in_rig(guessed_focal)(), forget_registration(); },
       {track, check, registration},
       {"focal length of about", "has 1200", "calibrate camera"}},
      {"focal length in mm", in_rig({{focal, "[4, 0, 474.3, 0, 4,"}}), {track}, {"camera_matrix", "in pixels"}},
      {"another size of image",
       in_rig({{"image_width: 960", "image_width: 1920"},
               {"image_height: 540", "image_height: 1080"},
               {focal, "[1650, 0, 948.6, 0, 1650,"}}),
       {track},
       {"960x540", "1920x1080 as in the rig"}},
      {"rectified images, lens in the rig",
       in_rig({{"data: [0, 0, 0, 0, 0]", "data: [-0.3, 0.1, 0, 0, 0]"}}),
       {track, check, registration},
       {"already undistorted", "need a rig without"}},
      {"images mirrored", in_images(mirrored), {track, check}, {"image is mirrored", "mirroring off"}},
      {"camera upside down", in_images(turned), {track}, {"turned by 180 degrees", "camera_from_rcm"}},
      {"red and blue exchanged",
       in_images(exchanged),
       {track, check},
       {"red and blue are exchanged", "BGR is expected"}},
      {"grey images", in_images(grey), {track, check}, {"grey", "sends mono"}},
      {"too dark", in_images(levels(0.12, 0)), {track, check}, {"dark", "raise the light or the exposure"}},
      {"overexposed", in_images(levels(2.5, 60)), {track, check}, {"overexposed", "lower the exposure"}},
      {"lens cap", in_images(covered), {track, check}, {"dark", "cap off the lens"}},
      {"strong compression",
       in_images([](const cv::Mat& bgr) { return bgr; }, ".jpg", 12),
       {track, check},
       {"compressed", "higher bit rate"}},
      {"too far away",
       [] {
         in_rig({{focal, "[240, 0, 474.3, 0, 240,"}})(), render("swing", {});
       },
       {check},
       {"px wide", "come nearer"}},
      {"joints in degrees",
       in_joints([](auto v) {
         return std::array{v[0], v[1] * degrees, v[2] * degrees, v[3], v[4] * degrees};
       }),
       {check, registration},
       {"yaw", "looks like degrees"}},
      {"insertion in mm",
       in_joints([](auto v) {
         return std::array{v[0], v[1], v[2], v[3] * 1000, v[4]};
       }),
       {check, registration},
       {"insertion", "looks like millimetres"}},
      {"times in ms",
       in_joints([](auto v) {
         return std::array{v[0] * 1000, v[1], v[2], v[3], v[4]};
       }),
       {check, registration},
       {"time_s", "looks like milliseconds"}},
      {"joints of another recording",
       in_joints([](auto v) {
         const double t = v[0];
         return std::array{t, 0.3 * std::sin(1.1 * t), 0.2 * std::sin(0.5 * t), 0.09 + 0.01 * std::sin(t),
                           2 * std::sin(0.8 * t)};
       }),
       {check, registration},
       {"is it this arm's recording", "both clocks"}},
      {"clocks 40 s apart",
       in_joints([](auto v) {
         return std::array{v[0] + 40, v[1], v[2], v[3], v[4]};
       }),
       {check, registration},
       {"both clocks run within 30 s", "joints from 39.4 to 52.9 s"}},
      {"joint columns exchanged",
       in_joints([](auto v) {
         return std::array{v[0], v[2], v[1], v[3], v[4]};
       }),
       {check, registration},
       {"yaw and pitch are exchanged", "joints.names has theta, phi, rho, psi"}},
      {"joint names of another arm",
       in_rig({{"\"yaw\", \"pitch\"", "\"outer_yaw\", \"outer_pitch\""}}),
       {check, registration},
       {"no column 'outer_yaw'", "time_s,yaw,pitch,insertion,roll"}},
      {"wrong rate of images",
       [] {},
       {changed(check, {{"fps 8", "fps 30"}}), changed(registration, {{"fps 8", "fps 30"}})},
       {"8 images a second, read as 30", "give --fps"}},
      {"sign of a joint",
       in_rig({{sign, "sign: [1, 1, 1, 1]"}}),
       {check},
       {"the sign of pitch is the other", "calibrate registration"}},
      {"marker turned since",
       mounted("swing", {{"seam_rad: 0", "seam_rad: 0.35"}}),
       {check},
       {"turned about the shaft", "calibrate registration"}},
      {"endoscope moved since", moved_endoscope, {track}, {"misses the rig's RCM", "calibrate registration"}},
      {"the same, with joints",
       moved_endoscope,
       {check},
       {"the endoscope or the arm's base was moved", "calibrate registration"}},
      {"offset in degrees",
       in_rig({{"offset: [0, 1.5,", "offset: [0, 86,"}}),
       {track},
       {"joints.offset", "looks like degrees"}},
      {"squares for inner corners", [] {}, {changed(camera, {{"9x6", "10x7"}})}, {"number of inner corners"}},
      {"a turn that ends early",
       [] {
         const fs::path from = fs::canonical("turn");
         fs::remove("turn"), fs::create_directory("turn");
         for (int i = 0; i < 12; ++i) fs::copy(from / ((i < 10 ? "000" : "00") + std::to_string(i) + ".png"), "turn");
       },
       {marker},
       {"degrees are missing", "full turn"}},
      {"a turn for the swing",
       [] {},
       {"calibrate registration turn --fps 8 --joints turn_joints.csv --rig rig.yaml --out out.yaml"},
       {"pitch moved by 0.00 rad only", "swing the instrument"}},
      {"loop without registration",
       forget_registration,
       {servo},
       {"camera_from_rcm: is missing", "calibrate registration measures it"}},
      {"goal in degrees", [] {}, {changed(servo, {{"2.43", "139"}})}, {"s_rad is 139", "looks like degrees"}},
      {"rates in degrees",
       [] { write_file("fast.yaml", "limits: {rate: [23, 23, 0.04, 86]}\n"); },
       {servo + " --controller fast.yaml"},
       {"limits.rate", "looks like degrees"}},
      {"delay in seconds", [] {}, {servo + " --delay-ms 0.08"}, {"--delay-ms", "looks like seconds"}},
      {"a key of another program",
       [] { write_file("gain.yaml", "gain: 5\n"); },
       {servo + " --controller gain.yaml"},
       {"gain: is unknown", "gains_per_s"}},
#ifdef LAPSERVO_ROS2
      {"joint limits in degrees",
       in_file("joint_limits.yaml", {{"lower: [-1.5, -1.5", "lower: [-85, -85"}}),
       {arm + "PSM1"},
       {"joint_limits.yaml: lower", "looks like degrees"}},
      {"joint limits in mm",
       in_file("joint_limits.yaml", {{"0.24, 7]", "240, 7]"}}),
       {arm + "PSM1"},
       {"joint_limits.yaml: upper", "looks like millimetres"}},
      {"the other arm", [] {}, {arm + "PSM2"}, {"PSM2, and the rig has PSM1", "--instrument PSM1"}},
#endif
  };
}

class Mistakes : public acceptance::ToolTest {
 protected:
  // The commands of a mistake in a folder with links to the sample; how many of them name cause and remedy.
  static int named_by(const Mistake& mistake) {
    const fs::path sample = fs::absolute("sample"), folder = fs::absolute("mistake");
    fs::create_directory(folder);
    fs::current_path(folder);
    for (const char* name : {"swing", "turn", "boards"}) fs::create_directory_symlink(sample / name, name);
    for (const char* name : {"swing_joints.csv", "turn_joints.csv", "joint_limits.yaml"})
      fs::create_symlink(sample / name, name);
    fs::create_symlink(sample / "truth.yaml", "rig.yaml");
    mistake.make();
    int named = 0;
    for (const std::string& command : mistake.commands) named += is_named(mistake, command) ? 1 : 0;
    fs::current_path(folder.parent_path());
    fs::remove_all(folder);
    return named;
  }

  static bool is_named(const Mistake& mistake, const std::string& command) {
    run(command);
    const std::string said = errors() + output();
    bool named = true;
    for (const std::string& word : mistake.words) named &= said.find(word) != std::string::npos;
    // Advice to run the same command again.
    const std::string itself =
        "lapservo " + command.substr(0, command.find(' ', command.starts_with("calibrate ") ? 10 : 0));
    const bool circle = command.starts_with("calibrate ") && said.find(itself + " ") != std::string::npos;
    std::printf("  %-34s %-24s %s\n", mistake.name.c_str(), itself.substr(9).c_str(),
                named && !circle ? "named"
                : circle         ? "LEADS TO ITSELF"
                                 : "NOT NAMED");
    std::fflush(stdout);
    EXPECT_TRUE(named && !circle) << mistake.name << ": " << command << " says\n" << said;
    return named && !circle;
  }
};

// Nothing is wrong with the sample and its true rig, and nothing is said to be.
TEST_F(Mistakes, AreNamedWithTheirRemedyByTheCommandThatMeetsThemFirst) {
  expect_done("sample sample");
  expect_done("track sample/swing --fps 8 --rig sample/truth.yaml --out seen.csv");
  EXPECT_EQ(errors(), "");
  const std::vector<Mistake> all = mistakes();
  int commands = 0, named = 0;
  for (const Mistake& mistake : all) {
    commands += static_cast<int>(mistake.commands.size());
    named += named_by(mistake);
  }
  std::printf("%zu mistakes; %d of %d commands name cause and remedy\n", all.size(), named, commands);
}

}  // namespace
}  // namespace lapservo
