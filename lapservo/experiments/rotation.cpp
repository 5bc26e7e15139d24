#include "lapservo/experiments/rotation.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "lapservo/core/angles.h"
#include "lapservo/experiments/data_file.h"
#include "lapservo/experiments/stage.h"
#include "lapservo/sim/tissue.h"

namespace lapservo::internal {
namespace {

constexpr int all_trials = RotationResult::sets * RotationResult::trials, frames = all_trials * RotationResult::steps;

double true_rotation_rad(int frame) {
  return initial_rotation_rad(frame / RotationResult::steps % RotationResult::trials) +
         two_pi * (frame % RotationResult::steps) / RotationResult::steps;
}

std::uint64_t seed_of(const ExperimentSetup& setup, int set) {
  return setup.seed + 1 + 1000 * static_cast<std::uint64_t>(set);
}

std::string mrad(double rad) {
  const double value = 1e3 * rad;
  if (!std::isfinite(value)) return unknown_text;
  return fmt::format("{:.{}f}", value, std::abs(value) < 10 ? 2 : 1);
}

// Fig. 5 of the paper.
Plot one_trial(const RotationResult& result) {
  Plot plot{
      fmt::format("Figure 5: one trial, from {:.2f} rad", initial_rotation_rad(0)), {"time", "s"}, {"rotation", "rad"}};
  Series reference{"reference", {}, {}, Draw::dashed, -1};
  for (int step = 0; step < RotationResult::steps; ++step) {
    reference.x.push_back(RotationResult::turn_s * step / RotationResult::steps);
    reference.y.push_back(true_rotation_rad(step));
  }
  const auto of_trial = [](const RotationResult::Sample& sample) {
    return sample.set == 0 && sample.trial == 0 ? PlotPoint({sample.time_s(), sample.measured_rad}) : std::nullopt;
  };
  for (const auto& m : result.methods)
    plot.series.push_back(
        series_of(method_title(m.method), m.samples, of_trial, Draw::points, method_colour(m.method)));
  plot.series.push_back(std::move(reference));
  return plot;
}

// Fig. 6 of the paper.
Plot distribution_by_trial(const RotationResult::OfMethod& of_method) {
  Plot plot{"Figure 6: errors by trial, " + method_title(of_method.method),
            {"initial rotation", "rad"},
            {"error", "mrad"},
            {},
            {{"no error", 0}}};
  const auto of_set = [](const RotationResult::Sample& sample) {
    return sample.set == 0 ? PlotPoint({initial_rotation_rad(sample.trial), 1e3 * sample.error_rad()}) : std::nullopt;
  };
  plot.series = {series_of("", of_method.samples, of_set, Draw::boxes, method_colour(of_method.method))};
  return plot;
}

Table table_one(const RotationResult& result) {
  Table table{"Table I: mean and standard deviation of the error in each trial of the first set [mrad]",
              {"initial rotation [rad]", "the paper: mean", "std"}};
  for (const auto& of_method : result.methods) {
    table.header.push_back((of_method.method == Method::centerline ? "its method here" : "the default here") +
                           std::string(": mean"));
    table.header.emplace_back("std");
  }
  for (std::size_t trial = 0; trial < RotationResult::trials; ++trial) {
    std::vector<std::string> row{fmt::format("{:.2f}", initial_rotation_rad(static_cast<int>(trial))),
                                 mrad(RotationResult::paper_mean_rad[trial]),
                                 mrad(RotationResult::paper_deviation_rad[trial])};
    for (const auto& of_method : result.methods) {
      row.push_back(mrad(of_method.by_trial[trial].mean));
      row.push_back(mrad(of_method.by_trial[trial].deviation));
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

std::string range_of(std::span<const double> figures) {
  if (figures.empty()) return unknown_text;
  const auto [least, most] = std::ranges::minmax(figures);
  return fmt::format("{} to {} mrad", mrad(least), mrad(most));
}

// Trials in which it is not known do not count.
std::string range_of(const RotationResult::OfMethod& of_method, double Spread::*figure) {
  std::vector<double> known;
  for (const Spread& trial : of_method.by_trial)
    if (std::isfinite(trial.*figure)) known.push_back(trial.*figure);
  return range_of(known);
}

std::string percent(double fraction) {
  return std::isfinite(fraction) ? fmt::format("{:.3g} %", 100 * fraction) : unknown_text;
}

std::vector<Comparison> comparisons_of(const RotationResult& result) {
  const auto row = comparing(result.methods);
  const Pooled paper = pooled(RotationResult::paper_mean_rad, RotationResult::paper_deviation_rad);
  return {row("standard deviation of the error, from trial to trial", range_of(RotationResult::paper_deviation_rad),
              [](const auto& m) { return range_of(m, &Spread::deviation); }),
          row("mean error, from trial to trial", range_of(RotationResult::paper_mean_rad),
              [](const auto& m) { return range_of(m, &Spread::mean); }),
          row("frames in which it was found: the figures below are of these", "not given",
              [](const auto& m) { return fmt::format("{} of {}", m.samples.size(), frames); }),
          row("rms error of all trials together, bias included", mrad(paper.rms) + " mrad (from its Table I)",
              [](const auto& m) { return mrad(m.all.rms) + " mrad"; }),
          row("standard deviation of all trials together", mrad(paper.deviation) + " mrad (from its Table I)",
              [](const auto& m) { return mrad(m.all.deviation) + " mrad"; }),
          row("mean error of all trials together", mrad(paper.mean) + " mrad (from its Table I)",
              [](const auto& m) { return mrad(m.all.mean) + " mrad"; }),
          row("median error", "\u201caround zero\u201d", [](const auto& m) { return mrad(m.all.median) + " mrad"; }),
          row("largest error", "", [](const auto& m) { return mrad(m.all.largest) + " mrad"; }),
          row("errors under 0.1 rad", "half", [](const auto& m) { return percent(m.under_100mrad); }),
          row("errors under 0.2 rad", "most", [](const auto& m) { return percent(m.under_200mrad); }),
          row("normalised error (rms of error / sigma, ideally 1)", "",
              [](const auto& m) { return with_digits(m.in_sigmas.rms, 3); })};
}

std::vector<Figure> figures_of(const RotationResult& result) {
  std::vector<Figure> figures{
      {one_trial(result), fmt::format("Every frame of the first trial: a turn in {:.0f} s.", RotationResult::turn_s)}};
  const std::string boxes =
      "The first set. Boxes from quartile to quartile, with the median; whiskers to the farthest within 1.5 times "
      "that. ";
  for (const auto& of_method : result.methods)
    figures.push_back({distribution_by_trial(of_method), boxes + "Mind the scale."});
  return figures;
}

}  // namespace

double initial_rotation_rad(int trial) {
  return RotationResult::first_rad +
         (RotationResult::last_rad - RotationResult::first_rad) * trial / (RotationResult::trials - 1);
}

Pooled pooled(std::span<const double> means, std::span<const double> deviations) {
  const Spread of_means = spread_of({means.begin(), means.end()});
  const double within = spread_of({deviations.begin(), deviations.end()}).rms;
  const double rms = std::hypot(within, of_means.rms);
  return {of_means.mean, std::sqrt(rms * rms - of_means.mean * of_means.mean), rms};
}

RotationResult::OfMethod summed_up(Method method, std::vector<RotationResult::Sample> samples) {
  RotationResult::OfMethod of_method{method, std::move(samples), {}, {}, {}, 0, 0};
  std::vector<std::vector<double>> errors(all_trials);
  std::vector<double> all, in_sigmas;
  for (const RotationResult::Sample& sample : of_method.samples) {
    errors[static_cast<std::size_t>(sample.set * RotationResult::trials + sample.trial)].push_back(sample.error_rad());
    all.push_back(sample.error_rad());
    in_sigmas.push_back(sample.error_rad() / sample.sigma_rad);
  }
  for (const auto& of_trial : errors) of_method.by_trial.push_back(spread_of(of_trial));
  of_method.all = spread_of(all);
  of_method.in_sigmas = spread_of(in_sigmas);
  of_method.under_100mrad = fraction_within(all, 0.1);
  of_method.under_200mrad = fraction_within(all, 0.2);
  return of_method;
}

RotationResult measure_rotation(const ExperimentSetup& setup) {
  const Camera& camera = setup.rig.camera;
  std::vector<JointVector> positions;
  std::vector<cv::Mat> tissues;
  for (int set = 0; set < RotationResult::sets; ++set) {
    Random random(seed_of(setup, set));
    for (const JointVector& q : spread_positions(setup.rig, RotationResult::trials, random)) positions.push_back(q);
    tissues.push_back(make_tissue(camera.width_px, camera.height_px, seed_of(setup, set)));
  }

  std::vector<std::vector<Observation>> sightings(frames);
  const auto make_worker = [&] {
    return [&, stage = std::shared_ptr<Stage>(), stage_set = -1,
            eyes = std::make_shared<Eyes>(setup.rig, setup.methods)](int frame) mutable {
      const int set = frame / (RotationResult::trials * RotationResult::steps);
      if (set != stage_set) stage = std::make_shared<Stage>(setup.rig, tissues[static_cast<std::size_t>(set)]);
      stage_set = set;
      JointVector q = positions[static_cast<std::size_t>(frame / RotationResult::steps)];
      q.psi_rad = true_rotation_rad(frame);
      sightings[static_cast<std::size_t>(frame)] =
          eyes->observe(stage->render(q, 1, frame_seed(seed_of(setup, set), frame)));
    };
  };
  in_parallel(frames, make_worker, setup.keep_going);

  RotationResult result;
  for (std::size_t m = 0; m < setup.methods.size(); ++m) {
    std::vector<RotationResult::Sample> samples;
    for (int frame = 0; frame < frames; ++frame) {
      const Observation& o = sightings[static_cast<std::size_t>(frame)][m];
      if (o.status != Status::ok || !o.rcm) continue;
      const double true_rad = true_rotation_rad(frame);
      const int trial = frame / RotationResult::steps;
      samples.push_back({trial / RotationResult::trials, trial % RotationResult::trials, frame % RotationResult::steps,
                         true_rad, true_rad + wrap_pi(o.rcm->q.psi_rad - true_rad),
                         std::sqrt(o.rcm->covariance(3, 3))});
    }
    result.methods.push_back(summed_up(setup.methods[m], std::move(samples)));
  }
  return result;
}

void write_data(const RotationResult& result, const std::filesystem::path& folder) {
  DataFile samples(folder / "rotation.csv",
                   {"method", "set", "trial", "step", "time_s", "true_rad", "measured_rad", "error_rad", "sigma_rad"});
  DataFile trials(folder / "rotation_trials.csv", {"method", "set", "trial", "initial_rad", "found", "mean_error_rad",
                                                   "std_error_rad", "rms_error_rad", "largest_error_rad"});
  for (const auto& of_method : result.methods) {
    const std::string word(to_string(of_method.method));
    for (const RotationResult::Sample& s : of_method.samples)
      samples.row({word, s.set, s.trial, s.step, s.time_s(), s.true_rad, s.measured_rad, s.error_rad(), s.sigma_rad});
    for (int i = 0; i < all_trials; ++i) {
      const Spread& spread = of_method.by_trial[static_cast<std::size_t>(i)];
      const int trial = i % RotationResult::trials;
      trials.row({word, i / RotationResult::trials, trial, initial_rotation_rad(trial), static_cast<int>(spread.count),
                  spread.mean, spread.deviation, spread.rms, spread.largest});
    }
  }
  samples.commit();
  trials.commit();
}

ReportSection section_of(const RotationResult& result, const ExperimentSetup& setup) {
  ReportSection section{"rotation", "Rotation (section V-C)"};
  section.text = {
      fmt::format("{} trials start at rotations from {:.2f} to {:.2f} rad, each at its own place in the field of view. "
                  "In each the instrument turns about its shaft once round, in {} steps, and the rotation measured in "
                  "every frame is compared with the true one. {} such sets, each with other places, background and "
                  "noise, are pooled where it says \u201call\u201d or \u201cfrom trial to trial\u201d.",
                  RotationResult::trials, RotationResult::first_rad, RotationResult::last_rad, RotationResult::steps,
                  RotationResult::sets)};
  section.comparisons = comparisons_of(result);
  section.figures = figures_of(result);
  section.tables.push_back(table_one(result));
  section.notes = {
      "Rotation is psi, absolute: the direction from which the camera sees the shaft is taken into account.",
      "The paper\u2019s errors are against its robot\u2019s encoder, ours against the exact rotation of rendered "
      "frames. Its trials\u2019 length is not given; ours are one turn each, so that each passes the seam once.",
      "Once in each turn the marker\u2019s seam passes the centre line, where the cross-ratio jumps. The centre-line "
      "method is at its worst there; lines beside the centre carry the default across.",
      "Each frame is looked at on its own, without help from the one before."};
  section.command = "lapservo experiment rotation --out DIR" + setup.options;
  section.files = {"rotation.csv", "rotation_trials.csv"};
  return section;
}

}  // namespace lapservo::internal
