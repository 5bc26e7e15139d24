#include <cstdio>
#include <string>

#include <fmt/format.h>

#include "apps/lapservo/cli/subcommands.h"
#include "apps/lapservo/commands/calibrate/calibrate_inputs.h"
#include "apps/lapservo/inputs/joint_input.h"
#include "lapservo/calibration/registration/alignment.h"
#include "lapservo/calibration/registration/registration_measurement.h"
#include "lapservo/core/error.h"
#include "lapservo/core/rounded_sigma.h"
#include "lapservo/core/statistics.h"
#include "lapservo/report/html_report.h"

namespace lapservo::app {
using namespace internal;
namespace {

std::string offset_text(const Alignment& found) {
  return fmt::format("image_delay_s: {:.4f}, sigma {:.4f}: a frame's stamp minus the joints' clock at its exposure",
                     found.delay_s, found.sigma_delay_s);
}

std::string drift_text(const Alignment& found) {
  if (!found.drifts())
    return fmt::format("no drift of the clocks shows: {:.1f} ppm, sigma {:.1f}", found.drift_ppm,
                       found.sigma_drift_ppm);
  return fmt::format(
      "the frames' clock runs {:.1f} ppm faster than the joints' (sigma {:.1f}), {:.1f} ms over the {:.0f} s that both "
      "show; the offset is that in the middle",
      found.drift_ppm, found.sigma_drift_ppm, 1e-3 * found.drift_ppm * found.shared_s, found.shared_s);
}

Plot joint_plot(const Alignment& found, const Joints& joints, std::size_t joint) {
  constexpr std::size_t enough = 600;
  const bool is_length = joint == 2;
  const double unit = is_length ? 1e3 : 1;
  const auto pairs = some_of(found.pairs, enough);
  const auto curve = [&](const char* name, std::array<double, 4> Alignment::Pair::*of, Draw draw, int colour) {
    const auto point = [&](const Alignment::Pair& pair) { return PlotPoint({pair.time_s, unit * (pair.*of)[joint]}); };
    return series_of(name, pairs, point, draw, colour);
  };
  return time_plot(joints.names[joint], joints.names[joint], is_length ? "mm" : "rad",
                   {curve("joints, at the offset", &Alignment::Pair::read, Draw::line, 0),
                    curve("as the marker shows it", &Alignment::Pair::seen, Draw::points, 1)});
}

Report page_of(const std::string& input, const Alignment& found, const Joints& joints) {
  ReportSection section{"align", input};
  section.text = {offset_text(found), drift_text(found)};
  for (std::size_t joint = 0; joint < 4; ++joint)
    section.figures.push_back({joint_plot(found, joints, joint), "Over the frames' stamps."});
  return {"lapservo align", {}, {section}};
}

int run(const CalibrateOptions& options) {
  InstrumentJob job(options);
  Instrument instrument = job.instrument();
  const auto joints = find_joint_input(options, job.rig, job.index, job.frames.get());
  if (!joints) throw InputError("--joints", "is missing, expected a CSV or a bag with the joints");
  instrument.joints = joints->joints;
  job.begin();
  const MeasuredPoses poses = poses_in_frames(job.rig, job.index, job.recording(), watched_job());
  say_complaint(options.input, poses.read.complaint);
  if (!poses.none.empty()) return refuse(options.input, poses.none);
  const Alignment found = align(instrument, poses.all, joints->recording, joints->source);
  if (!found.refusal.empty()) return refuse(options.input, found.refusal);
  std::printf("%s\n%s\n", offset_text(found).c_str(), drift_text(found).c_str());
  const auto write_page = [&] { job.write_page(page_of(options.input, found, instrument.joints.value())); };
  if (!job.out) {
    write_page();
    std::printf("to apply it: write it into %s's entry in %s, or repeat this with --out %s\n", instrument.name.c_str(),
                options.rig.c_str(), options.rig.c_str());
    return 0;
  }
  job.rig.instruments[job.index].image_delay_s = found.delay_s;
  job.rig.instruments[job.index].sigma_image_delay_s = rounded_sigma(found.sigma_delay_s);
  const int written = job.write();
  write_page();
  return written;
}

}  // namespace

void add_align(Command app) {
  auto [command, options] = app.add_subcommand<CalibrateOptions>(
      "align", "Measure the time between a video of the marker and a recording of the joints that began apart.", run);
  command.add_option("input", options.input, required(),
                     "The marker in motion: a folder, a video or a bag, of which the joints show a part at least");
  command.add_option("--rig", options.rig, required(), "Camera and marker; where the arm stands need not be known");
  add_joint_options(command, options,
                    "CSV of the arm's joints (time_s and a column a joint, named as in the rig's joints), or a bag; "
                    "without it those in the input, where it is a bag");
  add_recording_options(command, options);
  command.add_option("--out", options.out,
                     "The rig to write or replace, with the offset as image_delay_s; may be --rig's");
  command.add_option("--report", options.report, "HTML page with the curves of both, one over the other");
  command.footer(
      "The clocks may differ by up to 30 s, beyond the image_delay_s that the rig has. All four joints have to move, "
      "for\n"
      "10 s or more of what both show, and not periodically. Exit code 1: no offset, or several that fit.\n"
      "Example:\n  lapservo align video.mp4 --joints joints.csv --rig rig.yaml --out rig.yaml --report align.html");
}

}  // namespace lapservo::app
