#include <algorithm>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <functional>
#include <iostream>
#include <string>
#include <system_error>
#include <unistd.h>
#include <utility>
#include <vector>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include "apps/lapservo/cli/interrupt.h"
#include "apps/lapservo/cli/subcommands.h"
#include "apps/lapservo/commands/calibrate/calibrate_inputs.h"
#include "apps/lapservo/inputs/input_files.h"
#include "apps/lapservo/inputs/joint_input.h"
#include "apps/lapservo/inputs/live_images.h"
#include "apps/lapservo/inputs/transports.h"
#include "lapservo/core/error.h"
#include "lapservo/crtk/crtk_robot.h"
#include "lapservo/rig/calibration_record.h"
#include "lapservo/rig/rig.h"
#ifdef LAPSERVO_BAGS
#include "recordings/open_bag.h"
#include "recordings/session.h"
#endif

namespace lapservo::app {
using namespace internal;
namespace {
namespace fs = std::filesystem;

struct AllOptions : CalibrateOptions {
  std::string boards, motion, turn, swing, judged, judged_joints, redo;
  std::string camera, robot, joint_limits;  // of a live system
  BoardOptions board;
  bool no_questions = false, enable_motion = false;
};

// One step: what the user is to record for it, the command that measures it, and what that does.
struct Step {
  std::string name, what_to_record;
  std::string* input;
  const char* flag;    // of the input
  std::string joints;  // of the arm meanwhile, where they are given
  std::function<int(const CalibrateOptions&)> run;
};

constexpr const char* to_record_turn =
    "a slow full turn about the shaft's axis, there and back, 20 s or more each way, near and sharp";
constexpr const char* to_record_swing =
    "a smooth swing: 0.5 rad in both directions, 20 mm of insertion, 2 rad of turn, 10 to 60 s";

std::string shell_word(const std::string& word) {
  const bool plain = word.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_./:,=") ==
                     std::string::npos;
  if (plain && !word.empty()) return word;
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? "'\\''" : std::string(1, c);
  return text + "'";
}

std::string command_line(const std::vector<std::string>& arguments) {
  std::string text = "lapservo";
  for (const std::string& argument : arguments) text.append(" ").append(shell_word(argument));
  return text;
}

std::string answer_to(const std::string& question) {
  std::fprintf(stderr, "%s? ", question.c_str());
  std::string answer;
  if (!std::getline(std::cin, answer)) return {};
  return answer;
}

bool asks(const AllOptions& options) {
  return !options.no_questions && ::isatty(STDIN_FILENO);
}

class Guide {
 public:
  explicit Guide(AllOptions& options)
      : options_(options), record_file_(record_path(options.rig)), record_(read_record(record_file_)) {
    if (record_.steps.empty() || record_.rig == rig_state(options.rig)) return;
    std::printf("%s is not as the last step left it, or a file that it names: all steps are done anew\n",
                options.rig.c_str());
    record_.steps.clear();
  }

  int run() {
    watch_for_interrupts();
    std::vector<Step> all = steps();
    if (!asks(options_)) {
      for (const Step& step : all) expect_redone(step);
      expect_bag(all);
    }
    for (Step& step : all) {
      const int code = take(step);
      if (code != 0) return code;
    }
    return 0;
  }

 private:
  void expect_redone(const Step& step) const {
    if (step.input->empty() && options_.redo == step.name)
      throw InputError("--redo", fmt::format("{} needs {}: {}", step.name, step.flag, step.what_to_record));
  }

  // Where topics are given.
  void expect_bag(const std::vector<Step>& all) const {
    std::vector<std::string> inputs{options_.joints, options_.judged_joints};
    for (const Step& step : all) inputs.push_back(*step.input);
    if (std::any_of(inputs.begin(), inputs.end(), has_topics)) return;
    for (const auto& [option, topic] :
         {std::pair{"--image-topic", &options_.image_topic}, {"--joint-topic", &options_.joint_topic}})
      if (!topic->empty()) throw InputError(option, "is " + *topic + ", which is for bags, and no recording is one");
  }

  // An endless input can't be distinguished from a finished one, and the Ctrl-C that ends it would end all steps.
  static void expect_recording(const Step& step) {
    if (input_state(*step.input).empty())
      throw InputError(step.flag, fmt::format("is {}, expected a folder with files, a video or a bag; `lapservo {}` "
                                              "alone takes a camera or a stream",
                                              *step.input, (step.name == "check" ? "" : "calibrate ") + step.name));
  }

  std::vector<Step> steps() {
    AllOptions& o = options_;
    return {
        {"camera", "12 or more images of a chessboard: near, sharp, tilted to all sides, in every part of the image",
         &o.boards, "--boards", "", [this](const auto& options) { return run_camera(options); }},
        {"colour", "the mounted marker moved through the image, 10 s", &o.motion, "--motion", "", calibrate_colour},
        {"marker", to_record_turn, &o.turn, "--turn", "", calibrate_marker},
        {"registration", to_record_swing, &o.swing, "--swing", "", calibrate_registration},
        {"check", "another swing, or the same, with a full turn", &o.judged, "--check", o.judged_joints, check}};
  }

  int run_camera(const CalibrateOptions& options) const {
    CalibrateCameraOptions camera;
    static_cast<FrameOptions&>(camera) = options;
    camera.inputs = {options.input}, camera.rig = options.rig;
    camera.board = options_.board;
    return calibrate_camera(camera);
  }

  // Topics are of bags and sessions.
  static bool has_topics([[maybe_unused]] const std::string& input) {
#ifdef LAPSERVO_BAGS
    return !bag_of(input).empty() || is_session(input);
#else
    return false;
#endif
  }

  // As a user types it; where its page goes is no part of what was done.
  std::vector<std::string> arguments_of(const Step& step) const {
    const bool camera = step.name == "camera";
    const CalibrateOptions options = options_of(step);
    std::vector<std::string> all{step.name, options.input};
    if (step.name != "check") all.insert(all.begin(), "calibrate");
    const auto add = [&](const char* option, const std::string& value) {
      if (!value.empty()) all.insert(all.end(), {option, value});
    };
    add("--rig", options.rig), add("--out", camera ? "" : options.out), add("--joints", options.joints);
    if (camera) {
      add("--board", options_.board.corners);
      add("--square-mm", fmt::format("{}", options_.board.square_mm.value()));
      add("--aruco", options_.board.dictionary);
    }
    add("--eye", options.eye), add("--side-by-side", options.side_by_side);
    add("--colour-matrix", options.colour_matrix), add("--chroma-location", options.chroma_location);
    add("--image-topic", options.image_topic), add("--joint-topic", options.joint_topic);
    if (!camera) add("--instrument", options.instrument);
    if (options.deinterlace) all.push_back("--deinterlace");
    if (!camera) add("--fps", fmt::format("{}", options.fps.value_or(options.usual_fps)));
    return all;
  }

  CalibrateOptions options_of(const Step& step) const {
    CalibrateOptions options = options_;
    options.input = *step.input, options.joints = step.joints;
    if (!has_topics(options.input)) options.image_topic.clear();
    if (!has_joints(step) || !has_topics(step.joints.empty() ? options.input : step.joints))
      options.joint_topic.clear();
    if (step.name == "check") return options;
    options.out = options.rig, options.report.clear();
    return options;
  }

  static std::string state_of(const Step& step) {
    return input_state(*step.input) + (step.joints.empty() ? "" : "; " + input_state(step.joints));
  }

  static int tell_done(const CalibrationStep& done) {
    std::printf("%s: done on %s by %s\n", done.name.c_str(), done.when.c_str(), done.command.c_str());
    return 0;
  }

  static bool has_joints(const Step& step) {
    return step.name == "registration" || step.name == "check";
  }

  // Those of the swing are no other recording's.
  void find_joints(Step& step, bool ask) {
    if (!has_joints(step) || step.input->empty()) return;
    if (step.joints.empty() && *step.input == options_.swing) step.joints = options_.joints;
    if (step.joints.empty() && ask && !has_topics(*step.input))
      step.joints = answer_to("  and the joints meanwhile (a CSV, a bag; empty: without)");
    if (step.name == "registration") options_.joints = step.joints;
  }

  int take(Step& step) {
    const bool ask = step.input->empty() && asks(options_);
    if (ask)
      *step.input =
          answer_to(fmt::format("\n{}: {}\n  where is it (a folder, a video, a bag; empty: leave this step out)",
                                step.name, step.what_to_record));
    find_joints(step, ask);
    expect_redone(step);
    const CalibrationStep* done = record_.find(step.name);
    if (step.input->empty()) {
      if (done) return tell_done(*done);
      std::printf("%s: left out; %s names %s\n", step.name.c_str(), step.flag, step.what_to_record.c_str());
      return 0;
    }
    expect_recording(step);
    if (step.name == "camera" && (options_.board.corners.empty() || !options_.board.square_mm))
      throw InputError("--boards", "needs --board and --square-mm, for example --board 9x6 --square-mm 5");
    const CalibrationStep now{step.name, command_line(arguments_of(step)), state_of(step),
                              fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)))};
    const std::string page = options_of(step).report;
    const bool has_page = page.empty() || fs::exists(page);
    if (done && options_.redo != step.name && done->command == now.command && done->inputs == now.inputs && has_page)
      return tell_done(*done);
    std::printf("\n%s: %s\n", step.name.c_str(), now.command.c_str());
    std::fflush(stdout);
    const int code = step.run(options_of(step));
    if (code == 0) {
      record_.add(now), record_.rig = rig_state(options_.rig);
      write_record(record_file_, record_);
    }
    const bool has_verdict = step.name == "check" && code == 1;  // which it has said
    if ((code == 0 || has_verdict) && !interrupted()) return code;
    std::fprintf(stderr, "lapservo: stopped %s %s: the same command goes on from there\n", code == 0 ? "after" : "at",
                 step.name.c_str());
    return 1;
  }

  AllOptions& options_;
  fs::path record_file_;
  CalibrationRecord record_;
};

#ifdef LAPSERVO_BAGS
// Throws InputError where this recording has the images of another camera or the joints of another arm.
void expect_recording_of(const AllOptions& options, const fs::path& folder, const std::string& name) {
  const auto bag = open_bag(folder.string());
  const auto expect = [&](const std::string& option, std::string topic, bool of_joints) {
    if (!topic.starts_with('/')) topic.insert(0, "/");
    std::string others;
    for (const BagTopic& held : bag->topics()) {
      if ((held.type == joint_type) != of_joints) continue;
      if (held.name == topic || "/" + held.name == topic) return;
      others += (others.empty() ? "" : ", ") + held.name;
    }
    if (!others.empty())
      throw InputError(folder.string(),
                       fmt::format("holds {}, expected {} of {}: rename {} to have it recorded anew, or name a "
                                   "recording with --{}",
                                   others, topic, option, folder.parent_path().string(), name));
  };
  expect("--camera", recorded_topic(options.camera), false);
  if (!options.robot.empty())
    expect("--robot", topic_of(address_of(options.robot, "--robot").name, "measured_js"), true);
}

// The recording of this name beside the rig, made now where it isn't there. Empty: it could not be made.
std::string recorded(const AllOptions& options, const std::string& name, const char* what) {
  const fs::path folder = fs::path(options.rig + ".recordings") / name;
  if (fs::exists(folder / "metadata.yaml")) {
    expect_recording_of(options, folder, name);
    std::printf("%s: as recorded in %s\n", name.c_str(), folder.c_str());
    return folder.string();
  }
  if (std::error_code error; fs::exists(folder, error) && !fs::is_empty(folder, error))
    throw InputError(folder.string(), fmt::format("holds a recording that did not end, expected --{} {} if it is long "
                                                  "enough, else that it is removed",
                                                  name, folder.string()));
  RecordOptions recording;
  recording.camera = options.camera, recording.robot = options.robot, recording.rig = options.rig;
  recording.joint_limits = options.joint_limits, recording.out = folder.string();
  recording.instrument = options.instrument;
  recording.enable_motion = options.enable_motion, recording.until_enter = !options.enable_motion;
  if (options.enable_motion) {
    recording.move = name;
  } else {
    if (!asks(options))
      throw InputError("--camera", "needs a terminal, on which a person starts the recordings, or --enable-motion");
    std::fprintf(stderr, "\n%s: %s\n  Enter begins, and ends it: ", name.c_str(), what);
    std::string line;
    std::getline(std::cin, line);
  }
  std::printf("\nrecording %s: %s\n", name.c_str(), folder.c_str());
  std::fflush(stdout);
  try {
    if (record(recording) == 0 && !interrupted()) return folder.string();
  } catch (...) {
    fs::remove_all(folder);
    throw;
  }
  fs::remove_all(folder);
  std::fprintf(stderr, "lapservo: stopped at recording %s: the same command goes on from there\n", name.c_str());
  return {};
}
#endif

// Before it is read: what a pipe holds is gone then.
void expect_replaceable(const fs::path& rig) {
  std::error_code error;
  const fs::file_status status = fs::status(rig, error);
  if (fs::is_fifo(status) || fs::is_character_file(status) || fs::is_socket(status))
    throw InputError(rig.string(), "is a pipe or a device, expected a file: each step replaces it");
}

int run_all(AllOptions options) {
  expect_replaceable(options.rig);
  refuse_other_kind(options.report, ".html");
  if (!options.report.empty()) OutputTarget{options.report};  // the last step writes it
  refuse_shared_place({options.rig, options.report});
  load_rig(options.rig);
  if (options.camera.empty() && (options.enable_motion || !options.robot.empty()))
    throw InputError(options.robot.empty() ? "--enable-motion" : "--robot", "needs --camera: both are to be recorded");
  if (!options.camera.empty()) {
#ifdef LAPSERVO_BAGS
    if (options.turn.empty()) options.turn = recorded(options, "turn", to_record_turn);
    if (options.turn.empty()) return 1;
    if (options.swing.empty()) options.swing = recorded(options, "swing", to_record_swing);
    if (options.swing.empty()) return 1;
#else
    throw InputError("--camera", "can't be recorded by this build, which is without bags");
#endif
  }
  if (options.motion.empty()) options.motion = options.swing.empty() ? options.turn : options.swing;
  if (options.judged.empty()) options.judged = options.swing;
  return Guide(options).run();
}

void add_all(Command parent) {
  auto [command, options] = parent.add_subcommand<AllOptions>(
      "all", "The guided way: camera, colour, marker, registration, check, each where it is not done yet.", run_all);
  command.add_option("--rig", options.rig, required(), "The rig as it is known so far; each step replaces it");
  command.add_option("--boards", options.boards, "For the camera: images of a chessboard");
  command.add_option("--board", options.board.corners, "Its inner corners, COLUMNSxROWS, for example 9x6");
  command.add_option("--square-mm", options.board.square_mm, between(0.1, 1000.0), "Width of its squares");
  command.add_option("--aruco", options.board.dictionary, "For a ChArUco board: its markers' dictionary");
  command.add_option("--motion", options.motion, "For the colours: the marker in motion; else --swing, else --turn");
  command.add_option("--turn", options.turn, "For the marker: a slow full turn about the shaft's axis, there and back");
  command.add_option("--swing", options.swing, "For the registration: a smooth swing");
  command.add_option("--joints", options.joints, "CSV of the joints meanwhile");
  command.add_option("--check", options.judged, "For the check: a recording; else --swing");
  command.add_option("--check-joints", options.judged_joints,
                     "CSV of the joints meanwhile; else, without --check, --joints");
  command.add_option(
      "--camera", options.camera,
      "A live system's images, as `lapservo record` takes them: what is missing of --turn and --swing is "
      "recorded into RIG.recordings; delete it to have it recorded anew");
  command.add_option("--robot", options.robot, "and its arm: ros2:PSM1 or ros1:PSM1");
  command.add_flag(
      "--enable-motion", options.enable_motion,
      "Move the arm for these recordings, see `lapservo record --move`; else a person does, guided by questions");
  command.add_option("--joint-limits", options.joint_limits, "For --enable-motion: YAML of the arm's joints");
  command.add_option("--report", options.report, "The check's HTML page with figures");
  add_recording_options(command, options);
  add_joint_topic_option(command, options.joint_topic);
  command.add_option("--redo", options.redo, one_of({"camera", "colour", "marker", "registration", "check"}),
                     "A step that is done again though it was done, with those after it");
  command.add_flag("--no-questions", options.no_questions, "Leave out what no option names; a terminal prompts for it");
  command.footer(
      "RIG.calibration.yaml beside the rig lists each step with its command and time: a second run goes on where\n"
      "the first one stopped. A step is done again when its recording, its command, an earlier step or the rig "
      "changed.\n"
      "Example:\n  lapservo calibrate all --rig rig.yaml --boards boards/ --board 9x6 --square-mm 5 --turn turn.mp4 "
      "--swing swing.mp4 --joints joints.csv --report check.html\n"
      "  lapservo calibrate all --rig rig.yaml --camera ros2:/endoscope/image_raw --robot ros2:PSM1 --enable-motion "
      "--joint-limits configs/joint_limits/psm-classic.yaml");
}

}  // namespace

void add_calibrate(Command app) {
  Command calibrate = app.add_subcommand("calibrate", "Measure what a rig says, and write it down.");
  calibrate.require_subcommand();
  calibrate.footer(
      "Examples:\n"
      "  lapservo calibrate all --rig rig.yaml --turn turn.mp4 --swing swing.mp4 --joints joints.csv\n"
      "  lapservo calibrate camera boards/ --board 9x6 --square-mm 5 --rig rig.yaml\n"
      "  lapservo calibrate colour motion.mp4 --rig rig.yaml --out rig.yaml\n"
      "  lapservo calibrate marker turn.mp4 --rig rig.yaml --out rig.yaml\n"
      "  lapservo calibrate registration swing.mp4 --joints joints.csv --rig rig.yaml --out rig.yaml\n"
      "  lapservo calibrate tip --pivot pivot.mp4 --rig rig.yaml --out rig.yaml");
  add_all(calibrate);
  add_calibrate_camera(calibrate);
  add_calibrate_colour(calibrate);
  add_calibrate_marker(calibrate);
  add_calibrate_registration(calibrate);
  add_calibrate_tip(calibrate);
}

}  // namespace lapservo::app
