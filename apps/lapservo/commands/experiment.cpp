#include <cstdio>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "apps/lapservo/cli/interrupt.h"
#include "apps/lapservo/cli/output_folder.h"
#include "apps/lapservo/cli/progress.h"
#include "apps/lapservo/cli/subcommands.h"
#include "apps/lapservo/inputs/input_files.h"
#include "lapservo/core/error.h"
#include "lapservo/experiments/illumination.h"
#include "lapservo/experiments/rcm.h"
#include "lapservo/experiments/rotation.h"
#include "lapservo/experiments/tracking.h"
#include "lapservo/report/html_report.h"
#include "lapservo/rig/instruments.h"
#include "lapservo/rig/rig.h"

namespace lapservo::app {
using namespace internal;
namespace {
namespace fs = std::filesystem;

constexpr std::uintmax_t experiment_bytes = 16 << 20;

struct ExperimentOptions {
  std::string name, out, rig, method = "both";
  std::uint64_t seed = 1;
  bool force = false;
};

// Measures, leaves the data in the folder, and reports.
template <auto measure>
ReportSection run_experiment(const ExperimentSetup& setup, const fs::path& folder) {
  const auto result = measure(setup);
  write_data(result, folder);
  return section_of(result, setup);
}

const std::map<std::string, ReportSection (*)(const ExperimentSetup& setup, const fs::path& folder)> experiments{
    {"illumination", run_experiment<measure_illumination>},
    {"rcm", run_experiment<measure_rcm>},
    {"rotation", run_experiment<measure_rotation>},
    {"tracking", run_experiment<measure_tracking>}};

ExperimentSetup setup_of(const ExperimentOptions& options) {
  ExperimentSetup setup;
  setup.rig = single_instrument(options.rig.empty() ? paper_rig() : load_rig(options.rig), options.rig);
  setup.seed = options.seed;
  if (const auto method = method_from_string(options.method)) setup.methods = {*method};
  setup.options = fmt::format(" --seed {}", options.seed);
  if (!options.rig.empty()) setup.options += " --rig " + options.rig;
  if (options.method != "both") setup.options += " --method " + options.method;
  return setup;
}

// The parts that an interrupted run lacks; empty when it went to its end.
std::string missing_from(const std::vector<ReportSection>& sections, const std::string& stopped_in) {
  std::string text;
  for (const ReportSection& section : sections)
    if (!section.unfinished.empty()) text += " " + section.title + ": " + section.unfinished;
  if (!stopped_in.empty()) text += " The experiment \u201c" + stopped_in + "\u201d and those after it are missing.";
  return text.empty() ? "" : "This report is not whole: it was stopped." + text;
}

Report report_of(std::vector<ReportSection> sections, const std::string& missing, const ExperimentOptions& options) {
  return {"lapservo: the experiments of the paper",
          {"\u201cImage-Based Trajectory Tracking Control of 4-DoF Laparoscopic Instruments Using a Rotation "
           "Distinguishing Marker\u201d (Wang et al., IEEE Robotics and Automation Letters 2(3), 2017), section V, "
           "once more: in a simulator with exact truth, by the paper\u2019s own method and by lapservo\u2019s default.",
           fmt::format("The simulator: {}, a light beside the camera, tissue behind, a sensor with blur and noise. The "
                       "paper\u2019s method reads the marker on the shaft\u2019s centre line (its Algorithm 1); the "
                       "default fits all visible lines of the surface. Everything is repeatable: seed {}.",
                       options.rig.empty() ? "the rig of configs/paper.yaml" : "the rig " + options.rig, options.seed)},
          std::move(sections),
          missing};
}

void print(const ReportSection& section) {
  std::printf("%s\n", section.title.c_str());
  for (const Comparison& c : with_paper(section)) {
    std::printf("  %s\n", c.what.c_str());
    for (const auto& [who, value] :
         {std::pair{"the paper", c.paper}, {"its method here", c.centerline}, {"the default here", c.surface}})
      if (!value.empty()) std::printf("    %-17s %s\n", who, value.c_str());
  }
}

// Their sections, and the name of the first experiment that has none, as it was stopped.
std::pair<std::vector<ReportSection>, std::string> run_experiments(ExperimentSetup setup,
                                                                   const ExperimentOptions& options,
                                                                   const fs::path& folder) {
  std::vector<ReportSection> sections;
  for (const auto& [name, experiment] : experiments) {
    if (options.name != "all" && options.name != name) continue;
    std::optional<Progress> progress;
    setup.keep_going = [&progress, &label = name](int done, int total) {
      if (!progress) progress.emplace(total);
      progress->show(done, " (" + label + ")");
      return !interrupted();
    };
    try {
      if (interrupted()) throw Interrupted{};
      sections.push_back(experiment(setup, folder));
    } catch (const Interrupted&) {
      return {std::move(sections), name};
    } catch (const InputError& error) {
      // The library knows the rig, but not its file.
      if (error.source() != "rig" || options.rig.empty()) throw;
      throw error.with_source(options.rig);
    }
  }
  return {std::move(sections), ""};
}

int run(const ExperimentOptions& options) {
  ExperimentSetup setup = setup_of(options);
  InputFiles inputs;
  inputs.add_rig(options.rig, setup.rig);
  OutputFolder folder(options.out, setup.rig, inputs, options.force, experiment_bytes);
  watch_for_interrupts();
  auto [sections, stopped_in] = run_experiments(std::move(setup), options, folder / "");
  const std::string missing = missing_from(sections, stopped_in);
  for (const ReportSection& section : sections) print(section);
  if (!missing.empty()) std::printf("%s\n", missing.c_str());
  if (sections.empty()) return 1;
  write_report(folder / "report.html", report_of(std::move(sections), missing, options));
  folder.commit();
  std::printf("report: %s\n", (fs::path(options.out) / "report.html").c_str());
  return missing.empty() ? 0 : 1;
}

}  // namespace

void add_experiment(Command app) {
  auto [command, options] =
      app.add_subcommand<ExperimentOptions>("experiment", "The paper's experiments, in a simulator, as a report.", run);
  std::vector<std::string> choices{"all"};
  std::string help = "Which: ";
  for (const auto& [name, experiment] : experiments) choices.push_back(name), help += name + ", ";
  command.add_option("name", options.name, required(one_of(choices)), help + "all");
  command.add_option("--out", options.out, required(),
                     fmt::format("Folder for report.html, the CSVs behind it and rig.yaml{}", OutputFolder::help));
  command.add_flag("--force", options.force, OutputFolder::force_help);
  command.add_option("--rig", options.rig,
                     "Camera and instrument (the first), with camera_from_rcm; else the built-in configs/paper.yaml");
  command.add_option("--seed", options.seed, seed_number(), "Seed of positions, background and noise");
  command.add_option("--method", options.method, one_of({"both", "centerline", "surface"}),
                     "centerline: the paper's; surface: the default; or both");
  command.footer("Example:\n  lapservo experiment all --out results");
}

}  // namespace lapservo::app
