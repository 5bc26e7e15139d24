#include "lapservo/experiments/rotation.h"

#include <fmt/format.h>

#include "lapservo/core/angles.h"
#include "lapservo/experiments/comparison.h"
#include "lapservo/experiments/data_file.h"
#include "lapservo/experiments/positions.h"
#include "lapservo/experiments/stage.h"
#include "lapservo/sim/tissue.h"

namespace lapservo {
namespace {

using Result = RotationResult;
constexpr int frames = Result::trials * Result::steps;

double true_rotation_rad(int frame) {
  return initial_rotation_rad(frame / Result::steps) + two_pi * (frame % Result::steps) / Result::steps;
}

std::string mrad(double rad) {
  const double value = 1e3 * rad;
  return fmt::format("{:.{}f}", value, std::abs(value) < 10 ? 2 : 1);
}

const Result::OfMethod* find(const Result& result, Method method) {
  for (const auto& of_method : result.methods)
    if (of_method.method == method) return &of_method;
  return nullptr;
}

// Fig. 5 of the paper.
Plot measured_against_true(const Result& result) {
  Plot plot{"Measured against true rotation (the paper\u2019s figure 5)",
            {"true rotation", "rad", {}, {}},
            {"measured", "rad", {}, {}},
            {},
            {},
            false};
  plot.series.push_back({"truth",
                         {Result::first_rad, Result::last_rad + two_pi},
                         {Result::first_rad, Result::last_rad + two_pi},
                         {},
                         Draw::dashed,
                         -1});
  for (const auto& of_method : result.methods) {
    Series series{method_title(of_method.method), {}, {}, {}, Draw::points, method_color(of_method.method)};
    for (const Result::Sample& sample : of_method.samples) {
      series.x.push_back(sample.true_rad);
      series.y.push_back(sample.measured_rad);
    }
    plot.series.push_back(std::move(series));
  }
  return plot;
}

// Fig. 6 of the paper.
Plot error_against_true(const Result::OfMethod& of_method) {
  Plot plot{"Error of the rotation: " + method_title(of_method.method) + " (figure 6)",
            {"true rotation", "rad", {}, {}},
            {"error", "mrad", {}, {}},
            {},
            {{"no error", 0}},
            false};
  Series series{"", {}, {}, {}, Draw::points, method_color(of_method.method)};
  for (const Result::Sample& sample : of_method.samples) {
    series.x.push_back(sample.true_rad);
    series.y.push_back(1e3 * sample.error_rad());
  }
  plot.series.push_back(std::move(series));
  return plot;
}

Plot deviation_by_trial(const Result& result) {
  Plot plot{"Standard deviation of the error, by trial",
            {"initial rotation", "rad", {}, {}},
            {"standard deviation", "mrad", {}, {}, true},
            {},
            {{"the paper, best: 58 mrad", 58}, {"worst: 92 mrad", 92}},
            false};
  for (const auto& of_method : result.methods) {
    Series series{method_title(of_method.method), {}, {}, {}, Draw::line_and_points, method_color(of_method.method)};
    for (int trial = 0; trial < Result::trials; ++trial) {
      series.x.push_back(initial_rotation_rad(trial));
      series.y.push_back(1e3 * of_method.by_trial[static_cast<std::size_t>(trial)].deviation);
    }
    plot.series.push_back(std::move(series));
  }
  return plot;
}

Table table_one(const Result& result) {
  Table table{"Table I: error of the rotation in each trial [mrad]", {"initial rotation [rad]"}, {}};
  for (const auto& of_method : result.methods)
    for (const char* what : {"mean", "std", "largest", "found"})
      table.header.push_back(method_title(of_method.method) + ": " + what);
  for (int trial = 0; trial < Result::trials; ++trial) {
    std::vector<std::string> row{fmt::format("{:.2f}", initial_rotation_rad(trial))};
    for (const auto& of_method : result.methods) {
      const Spread& spread = of_method.by_trial[static_cast<std::size_t>(trial)];
      row.insert(row.end(), {mrad(spread.mean), mrad(spread.deviation), mrad(spread.largest),
                             fmt::format("{}/{}", spread.count, Result::steps)});
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

std::string deviations(const Result::OfMethod& of_method) {
  double least = HUGE_VAL, most = 0;
  for (const Spread& spread : of_method.by_trial) {
    least = std::min(least, spread.deviation);
    most = std::max(most, spread.deviation);
  }
  return fmt::format("{} to {} mrad", mrad(least), mrad(most));
}

}  // namespace

double initial_rotation_rad(int trial) {
  return Result::first_rad + (Result::last_rad - Result::first_rad) * trial / (Result::trials - 1);
}

RotationResult::OfMethod summed_up(Method method, std::vector<RotationResult::Sample> samples) {
  Result::OfMethod of_method{method, std::move(samples), {}, {}, {}};
  std::vector<std::vector<double>> errors(Result::trials);
  std::vector<double> all, in_sigmas;
  for (const Result::Sample& sample : of_method.samples) {
    errors[static_cast<std::size_t>(sample.trial)].push_back(sample.error_rad());
    all.push_back(sample.error_rad());
    in_sigmas.push_back(sample.error_rad() / sample.sigma_rad);
  }
  for (const auto& of_trial : errors) of_method.by_trial.push_back(spread_of(of_trial));
  of_method.all = spread_of(all);
  of_method.in_sigmas = spread_of(in_sigmas);
  return of_method;
}

RotationResult measure_rotation(const ExperimentSetup& setup) {
  const Camera& camera = setup.rig.camera;
  Random random(setup.seed + 1);
  const auto positions = spread_positions(setup.rig, Result::trials, random);
  const cv::Mat tissue = make_tissue(camera.width_px, camera.height_px, setup.seed + 1);

  std::vector<std::vector<Observation>> sightings(frames);
  const auto make_worker = [&] {
    return [&, stage = std::make_shared<Stage>(setup.rig, tissue),
            eyes = std::make_shared<Eyes>(setup.rig, setup.methods)](int frame) {
      RcmCoordinates q = positions[static_cast<std::size_t>(frame / Result::steps)];
      q.psi_rad = true_rotation_rad(frame);
      sightings[static_cast<std::size_t>(frame)] =
          eyes->observe(stage->render(q, 1, frame_seed(setup.seed + 1, frame)));
    };
  };
  in_parallel(frames, make_worker, setup.keep_going);

  Result result;
  for (std::size_t m = 0; m < setup.methods.size(); ++m) {
    std::vector<Result::Sample> samples;
    for (int frame = 0; frame < frames; ++frame) {
      const Observation& o = sightings[static_cast<std::size_t>(frame)][m];
      if (o.status != Status::ok || !o.rcm) continue;
      const double true_rad = true_rotation_rad(frame);
      samples.push_back({frame / Result::steps, frame % Result::steps, true_rad,
                         true_rad + wrap_pi(o.rcm->q.psi_rad - true_rad), std::sqrt(o.rcm->covariance(3, 3))});
    }
    result.methods.push_back(summed_up(setup.methods[m], std::move(samples)));
  }
  return result;
}

void write_data(const RotationResult& result, const std::filesystem::path& folder) {
  DataFile samples(folder / "rotation.csv",
                   {"method", "trial", "step", "true_rad", "measured_rad", "error_rad", "sigma_rad"});
  DataFile trials(folder / "rotation_trials.csv",
                  {"method", "trial", "initial_rad", "found", "mean_error_rad", "std_error_rad", "largest_error_rad"});
  for (const auto& of_method : result.methods) {
    const std::string word = method_word(of_method.method);
    for (const Result::Sample& s : of_method.samples)
      samples.row({word, s.trial, s.step, s.true_rad, s.measured_rad, s.error_rad(), s.sigma_rad});
    for (int trial = 0; trial < Result::trials; ++trial) {
      const Spread& spread = of_method.by_trial[static_cast<std::size_t>(trial)];
      trials.row({word, trial, initial_rotation_rad(trial), static_cast<int>(spread.count), spread.mean,
                  spread.deviation, spread.largest});
    }
  }
  samples.commit();
  trials.commit();
}

ReportSection section_of(const RotationResult& result, const ExperimentSetup& setup) {
  ReportSection section{"rotation", "Rotation (section V-C)", {}, {}, {}, {}, {}, {}, {}};
  section.text = {fmt::format(
      "Ten trials start at rotations from \u22123.5 to \u22121.25 rad, each at its own place in the field of view. In "
      "each the instrument turns about its shaft once round, in {} steps, and the rotation measured in every frame is "
      "compared with the true one.",
      Result::steps)};
  section.comparisons = {
      compared("rotation: standard deviation of the error, over the trials", "58 to 92 mrad", result.methods,
               deviations),
      compared("mean error, all trials", "", result.methods, [](const auto& m) { return mrad(m.all.mean) + " mrad"; }),
      compared("rms error, all trials", "", result.methods, [](const auto& m) { return mrad(m.all.rms) + " mrad"; }),
      compared("median error", "", result.methods, [](const auto& m) { return mrad(m.all.median) + " mrad"; }),
      compared("largest error", "", result.methods, [](const auto& m) { return mrad(m.all.largest) + " mrad"; }),
      compared("rms of error / stated sigma (1 is honest)", "", result.methods,
               [](const auto& m) { return fmt::format("{:.2f}", m.in_sigmas.rms); }),
      compared("frames in which it was found", "", result.methods,
               [](const auto& m) { return fmt::format("{} of {}", m.samples.size(), frames); })};
  section.figures.push_back({measured_against_true(result), "Every frame of the ten trials."});
  for (const Method method : {Method::surface, Method::centerline})
    if (const auto* of_method = find(result, method))
      section.figures.push_back({error_against_true(*of_method), "Mind the scale: it is each method\u2019s own."});
  section.figures.push_back({deviation_by_trial(result), "Table I as a picture, on a logarithmic scale."});
  section.tables.push_back(table_one(result));
  section.notes = {
      "Rotation is psi, absolute: the direction from which the camera sees the shaft is taken into account.",
      "Once in each turn the marker\u2019s seam passes the centre line, where the cross-ratio jumps. The centre-line "
      "method is at its worst there; lines beside the centre carry the default across.",
      "Each frame is looked at on its own, without help from the one before."};
  section.command = "lapservo experiment rotation --out DIR" + setup.options;
  section.files = {"rotation.csv", "rotation_trials.csv"};
  return section;
}

}  // namespace lapservo
