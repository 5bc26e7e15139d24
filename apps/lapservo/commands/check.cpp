#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <future>
#include <optional>
#include <string>
#include <unistd.h>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "apps/lapservo/cli/progress.h"
#include "apps/lapservo/cli/subcommands.h"
#include "apps/lapservo/commands/calibrate/calibrate_inputs.h"
#include "apps/lapservo/commands/check_report.h"
#include "apps/lapservo/inputs/joint_input.h"
#include "lapservo/calibration/check/frame_diagnosis.h"
#include "lapservo/calibration/check/rig_check.h"
#include "lapservo/calibration/check/work_space.h"
#include "lapservo/calibration/colour/colour_calibration.h"
#include "lapservo/core/statistics.h"
#include "lapservo/io/frame_source.h"
#include "lapservo/rig/registration_covariance.h"

namespace lapservo::app {
using namespace internal;
namespace {

void print(const CheckedRig& checked) {
  for (const CheckLine& line : check_lines(checked)) std::printf("  %-26s %s\n", line.name.c_str(), line.found.c_str());
  const bool colours = ::isatty(STDOUT_FILENO) != 0 && !std::getenv("NO_COLOR");
  const char* colour = !colours ? "" : checked.good_enough() ? "\033[32m" : "\033[31m";
  std::printf("\n%s%s%s\n  %s\n", colour, verdict_of(checked).c_str(), colours ? "\033[0m" : "",
              region_of(checked).c_str());
  int rank = 0;
  for (const Advice& advice : checked.advice)
    std::printf("  %d. %s%s\n     do: %s\n     gains: %s\n", ++rank, advice.needed ? "" : "(may be) ",
                advice.what.c_str(), advice.command.c_str(), advice.gain.c_str());
}

// Medians over the frames, the largest part first.
std::string tip_text(const Instrument& instrument, const std::vector<FrameEvidence>& frames, const WristInput& wrist) {
  std::vector<double> whole_mm;
  std::array<std::pair<std::vector<double>, const char*>, 3> parts{
      {{{}, "the shaft"}, {{}, "the marker's place"}, {{}, "the wrist's joints"}}};
  TipFrames tip_frames;
  for (const FrameEvidence& frame : frames) {
    Observation seen;
    seen.status = frame.status, seen.marker = frame.marker;
    const auto tip = seen.tip = tip_of(seen, *instrument.tool, wrist_at(wrist, instrument, frame.time_s));
    tip_frames.add(seen, frame.time_s);
    if (!tip) continue;
    whole_mm.push_back(1e3 * tip->sigma_m());
    parts[0].first.push_back(1e3 * tip->sigma_shaft_m), parts[1].first.push_back(1e3 * tip->sigma_place_m);
    parts[2].first.push_back(1e3 * tip->sigma_readings_m);
  }
  const std::string why = no_tip_text(instrument, wrist) + no_reading_text(instrument, wrist, tip_frames);
  if (whole_mm.empty()) return "unknown: " + (why.empty() ? "no frame has the marker and readings" : why);
  std::vector<std::pair<double, const char*>> sizes_mm;
  for (auto& [all_mm, from] : parts)
    if (const double size_mm = median(all_mm); size_mm > 0) sizes_mm.emplace_back(size_mm, from);
  std::sort(sizes_mm.rbegin(), sizes_mm.rend());
  std::vector<std::string> texts;
  for (const auto& [size_mm, from] : sizes_mm) texts.push_back(fmt::format("{:.2g} from {}", size_mm, from));
  return fmt::format("known to {:.2g} mm: {}", median(whole_mm), fmt::join(texts, ", "));
}

}  // namespace

int check(const CalibrateOptions& options) {
  InstrumentJob job(options);
  const Rig& rig = job.rig;
  const std::size_t index = job.index;
  Instrument instrument = job.instrument();
  const auto joints = find_joint_input(options, instrument, job.frames.get());
  if (joints) instrument.joints = joints->joints;
  job.begin();
  constexpr int enough = 1800;
  RigEvidence evidence(rig, index);
  FrameDiagnosis diagnosis(rig, options.deinterlace);
  cv::Mat seen, missed;  // the last frames with and without the marker
  int count = 0;         // of those with it
  const FramesRead read = read_frames(job.recording(), rig, every_of(*job.frames, enough), watched_job(),
                                      [&](const cv::Mat& bgr, double time_s) {
                                        const bool found = evidence.add(bgr, time_s);
                                        diagnosis.add(bgr, {});
                                        (found ? seen : missed) = bgr, count += found;
                                        return fmt::format(", {} in {}", instrument.name, count);
                                      });
  if (read.stopped) return refuse(options.input, "stopped");
  say_complaint(options.input, read.complaint);
  CheckedRig checked;
  {
    Progress progress(std::nullopt);
    progress.show(1, " of 3: the arm");
    checked.findings = findings_of(rig, index, evidence);
    checked.frames = evidence.frames();
    checked.findings.lossy = read.lossy;
    if (checked.findings.found == 0) checked.findings.cause = diagnosis.cause();
    // Takes as long as the rest, which needs nothing of it.
    std::future<PrintCheck> print;
    if (checked.findings.light)
      print = std::async(std::launch::async, [&, frames = evidence.take_key_frames()]() mutable {
        return check_print(rig, index, std::move(frames));
      });
    checked.findings.has_joints = joints.has_value();
    if (joints && !evidence.poses().empty())
      checked.findings.arm = check_arm(instrument, rig.camera, evidence.poses(), evidence.tracked_psi(),
                                       joints->recording, joints->source);
    else
      checked.findings.rcm = check_rcm(instrument, evidence.poses());
    progress.show(2, " of 3: the work space");
    WorkSpaceSurvey survey = survey_work_space(rig, index, evidence);
    checked.maps = std::move(survey.maps), checked.findings.work_space = survey.work_space;
    progress.show(3, " of 3: the print");
    if (print.valid()) checked.findings.print = print.get();
  }
  checked.advice = advice_on(checked.findings);
  if (instrument.tool)
    checked.tip = tip_text(instrument, checked.frames,
                           find_wrist_input(options.input, options.joints, options.joint_topic, rig, index,
                                            job.frames.get(), &options.image_topic));
  checked.exact_registration = exact_registration_text(instrument);
  std::printf("%s\n", instrument.name.c_str());
  print(checked);
  if (!options.report.empty()) {
    if (!seen.empty()) checked.found_segmented = segmentation_picture(seen, rig);
    if (!missed.empty()) checked.missed_segmented = segmentation_picture(missed, rig);
    write_check_report(options.report, instrument.name, checked);
    std::printf("report: %s\n", options.report.c_str());
  }
  return checked.good_enough() ? 0 : 1;
}

void add_check(Command app) {
  auto [command, options] = app.add_subcommand<CalibrateOptions>(
      "check", "Check whether a rig is good enough, and what to improve first.", check);
  command.add_option("input", options.input, required(),
                     "A short recording of the marker in motion: a folder, a video or a bag");
  command.add_option("--rig", options.rig, required(), "The rig to check");
  add_joint_options(
      command, options,
      "CSV of the arm's joints meanwhile (time_s and a column a joint, named as in the rig's joints), or a bag; "
      "without it those in the input, where it is a bag: registration, delay, focal length and drift too");
  add_recording_options(command, options);
  command.add_option("--out", options.report, "HTML page with figures");
  command.footer(
      "Swing, insert and withdraw the instrument, and turn it about its axis once, in 10 to 60 s, the marker in view.\n"
      "Exit code 0: good enough, 1: not good enough.\n"
      "Example:\n  lapservo check swing.mp4 --joints joints.csv --rig rig.yaml --out check.html");
}

}  // namespace lapservo::app
