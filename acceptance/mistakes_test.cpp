// Mistakes of users, and the answers of the tool: a table of inputs with one mistake each, the commands that meet it
// first, and words of the cause and of the remedy that each of them says. The test prints it; a row that fails shows
// the answer. Inputs are recordings of `lapservo sample`, or of `lapservo render` with another rig, that are altered.
// More causes are in the tests of FrameDiagnosis, Rig, ArmLimits and TrajectoryCheck.

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

#include "acceptance/tool_test.h"
#include "lapservo/core/csv.h"

namespace lapservo::internal::mistakes_test {
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
                  servo = "servo --rig rig.yaml --robot sim --duration 1 --out run --set-point 2.43,1194,245,175";

// A pipe of joints, which is opened when the rig has been read.
constexpr auto edit_when_read = "mkfifo late.csv; (echo '# mine' >>rig.yaml; cat swing_joints.csv) >late.csv &";

using Changes = std::vector<std::pair<std::string, std::string>>;

struct Mistake {
  std::string name;
  std::function<void()> make;  ///< in a folder with the sample, whose true rig is rig.yaml
  std::vector<std::string> commands, words;
};

std::string changed(std::string text, const Changes& changes) {
  for (const auto& [what, by] : changes) text = lapservo::testing::replaced(text, what, by);
  return text;
}

void rewrite(const std::string& file, const std::string& text) {
  fs::remove(file);  // a link into the sample
  write_file(file, text);
}

std::function<void()> in_rig(const Changes& changes) {
  return [=] { rewrite("rig.yaml", changed(read_file("rig.yaml"), changes)); };
}

// As before any registration.
void forget_registration() {
  const std::string rig = read_file("rig.yaml");
  const auto from = rig.find("    camera_from_rcm:"), to = rig.find("    joints:");
  rewrite("rig.yaml", rig.substr(0, from) + rig.substr(to));
}

// A folder of its own in the place of the link.
void mirror_images() {
  const fs::path from = fs::canonical("swing");
  fs::remove("swing"), fs::create_directory("swing");
  for (const auto& entry : fs::directory_iterator(from)) {
    cv::Mat image;
    cv::flip(cv::imread(entry.path().string()), image, 1);
    cv::imwrite("swing/" + entry.path().filename().string(), image, {cv::IMWRITE_PNG_COMPRESSION, 1});
  }
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
      for (std::size_t i = 0; i < 5; ++i) text += std::to_string(values[i]) + (i < 4 ? "," : "\n");
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
      {"radius, nothing calibrated",
       [] {
         rewrite("rig.yaml", changed(read_file("../sample/rig.yaml"),
                                     {{diameter, "diameter_m: 0.0042"}, {"[90, 180, 270]", "[116, 209, 294]"}}));
       },
       {track},
       {"with a diameter of 8.40 mm, twice the rig's", "not the radius"}},
      {"diameter 5 % off",
       in_rig({{diameter, "diameter_m: 0.0088"}}),
       {marker},
       {"4.8 % longer", "diameter_m", "callipers"}},
      {"print scaled by the printer",
       mounted("turn", printed_at_96_percent),
       {marker},
       {"4.0 % shorter", "printer", "callipers"}},
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
      {"images mirrored", mirror_images, {track, check}, {"image is mirrored", "mirroring off"}},
      {"too far away",
       [] {
         in_rig({{focal, "[240, 0, 474.3, 0, 240,"}})(), render("swing", {});
       },
       {check},
       {"px wide", "come nearer"}},
      {"joints in degrees",
       in_joints([](auto v) { return v[1] *= degrees, v[2] *= degrees, v[4] *= degrees, v; }),
       {check, registration},
       {"yaw", "looks like degrees"}},
      {"insertion in mm",
       in_joints([](auto v) { return v[3] *= 1000, v; }),
       {check, registration},
       {"insertion", "looks like millimetres"}},
      {"times in ms",
       in_joints([](auto v) { return v[0] *= 1000, v; }),
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
       in_joints([](auto v) { return v[0] += 40, v; }),
       {check, registration},
       {"both clocks run within 30 s", "joints from 39.4 to 52.9 s"}},
      {"joint columns exchanged",
       in_joints([](auto v) { return std::swap(v[1], v[2]), v; }),
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
      {"squares for inner corners", [] {}, {changed(camera, {{"9x6", "10x7"}})}, {"--board 9x6"}},
      {"rig edited meanwhile",
       [] {
         in_rig({})();
         EXPECT_EQ(std::system(edit_when_read), 0);
       },
       {"calibrate registration swing --fps 8 --joints late.csv --rig rig.yaml --out ./rig.yaml"},
       {"rig.yaml: was changed while this ran", "repeat the command"}},
      {"a turn for the swing",
       [] {},
       {"calibrate registration turn --fps 8 --joints turn_joints.csv --rig rig.yaml --out out.yaml"},
       {"pitch moved by 0.00 rad only", "swing the instrument"}},
      {"loop without registration",
       forget_registration,
       {servo},
       {"camera_from_rcm: is missing", "calibrate registration measures it"}},
      {"rates in degrees",
       [] { write_file("fast.yaml", "limits: {rate: [23, 23, 0.04, 86]}\n"); },
       {servo + " --controller fast.yaml"},
       {"limits.rate", "looks like degrees"}},
      {"delay in seconds", [] {}, {servo + " --delay-ms 0.08"}, {"--delay-ms", "looks like seconds"}},
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
    for (const char* name : {"swing_joints.csv", "turn_joints.csv"}) fs::create_symlink(sample / name, name);
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

}  // namespace lapservo::internal::mistakes_test
