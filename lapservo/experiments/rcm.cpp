#include "lapservo/experiments/rcm.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "lapservo/core/error.h"
#include "lapservo/experiments/comparison.h"
#include "lapservo/experiments/data_file.h"
#include "lapservo/experiments/positions.h"
#include "lapservo/experiments/stage.h"
#include "lapservo/rcm/pairwise_mean.h"
#include "lapservo/rcm/projected_rcm.h"
#include "lapservo/sim/tissue.h"

namespace lapservo {
namespace {

using Result = RcmResult;
constexpr int frames = Result::sets * Result::positions;
constexpr double nominal_sigma_px = 0.1;  // only its being the same for all lines counts
// What all lines share, as `lapservo estimate-rcm` has it: the sides of the shaft are lit unequally.
constexpr double common_px = 0.01;

Eigen::Vector2d true_rcm_px(const Rig& rig) {
  const auto rcm_px = projected_rcm_px(rig.camera, *rig.instruments[0].camera_from_rcm);
  if (!rcm_px) throw InputError("rig", "the RCM lies in the camera's focal plane, expected one that has an image");
  return *rcm_px;
}

std::vector<LineObservation> lines_of_set(const Result::OfMethod& of_method, int set) {
  std::vector<LineObservation> lines;
  for (const Result::Line& line : of_method.lines)
    if (line.set == set) lines.push_back(line_between(line.from_px, line.to_px, nominal_sigma_px));
  return lines;
}

void estimate(Result::OfMethod& of_method, const Eigen::Vector2d& true_px) {
  std::vector<Result::Estimate> pairwise, least_squares;
  for (int set = 0; set < Result::sets; ++set) {
    const auto lines = lines_of_set(of_method, set);
    if (const auto mean = mean_of_intersections(lines))
      pairwise.push_back({set, mean->point_px - true_px, mean->covariance_px2});
    if (const auto fit = estimate_projected_rcm(lines, {NoiseScale::estimated, common_px}); fit.status == RcmStatus::ok)
      least_squares.push_back({set, fit.point_px - true_px, fit.covariance_px2});
  }
  of_method.pairwise = summed_up(std::move(pairwise));
  of_method.least_squares = summed_up(std::move(least_squares));
}

std::string mean_and_deviation(const Result::Estimates& of) {
  return fmt::format("{:.3g} \u00b1 {:.2g} px", of.distance.mean, of.distance.deviation);
}

std::string estimator_name(bool pairwise) {
  return pairwise ? "mean of intersections" : "total least squares";
}

// Estimates about the truth.
Plot cloud(const Result::OfMethod& of_method) {
  Plot plot{"Estimates about the truth: " + method_title(of_method.method),
            {"error in u", "px", {}, {}},
            {"error in v", "px", {}, {}},
            {},
            {},
            true};
  plot.series.push_back({"truth", {0}, {0}, {}, Draw::points, -1});
  for (const bool pairwise : {true, false}) {
    const auto& of = pairwise ? of_method.pairwise : of_method.least_squares;
    Series series{estimator_name(pairwise), {}, {}, {}, Draw::points, pairwise ? 1 : 0};
    for (const Result::Estimate& estimate : of.estimates) {
      series.x.push_back(estimate.error_px.x());
      series.y.push_back(estimate.error_px.y());
    }
    plot.series.push_back(std::move(series));
  }
  return plot;
}

Plot distance_by_set(const Result& result) {
  Plot plot{"Distance from the true RCM, by set", {"set of 20 positions", "", 0, Result::sets + 1},
            {"distance", "px", {}, {}, true},     {},
            {{"the paper: 3.62 px", 3.62}},       false};
  for (const auto& of_method : result.methods) {
    Series series{method_title(of_method.method), {}, {}, {}, Draw::line_and_points, method_color(of_method.method)};
    for (const Result::Estimate& estimate : of_method.own().estimates) {
      series.x.push_back(estimate.set + 1);
      series.y.push_back(estimate.error_px.norm());
    }
    plot.series.push_back(std::move(series));
  }
  return plot;
}

// The lines of the first set, from the RCM to their far ends.
Plot fan(const Result& result, const Camera& camera) {
  const Result::OfMethod& of_method = result.methods.back();
  Plot plot{
      "The centre lines of the first set meet in the RCM", {"u", "px", {}, {}}, {"v", "px", {}, {}}, {}, {}, true};
  const double right = camera.width_px - 1, bottom = camera.height_px - 1;
  plot.series.push_back({"image", {0, right, right, 0, 0}, {0, 0, bottom, bottom, 0}, {}, Draw::dashed, -1});
  Series extended{"", {}, {}, {}, Draw::line, -1},
      seen{"e0 to e3", {}, {}, {}, Draw::line, method_color(of_method.method)};
  const auto gap = [](Series& series) { series.x.push_back(std::nan("")), series.y.push_back(std::nan("")); };
  const auto add = [](Series& series, const Eigen::Vector2d& p) {
    series.x.push_back(p.x()), series.y.push_back(p.y());
  };
  for (const Result::Line& line : of_method.lines) {
    if (line.set != 0) continue;
    add(extended, result.true_px), add(extended, line.from_px), gap(extended);
    add(seen, line.from_px), add(seen, line.to_px), gap(seen);
  }
  plot.series.push_back(std::move(extended));
  plot.series.push_back(std::move(seen));
  plot.series.push_back({"true RCM", {result.true_px.x()}, {result.true_px.y()}, {}, Draw::points, 2});
  return plot;
}

Table by_estimator(const Result& result) {
  Table table{"Distance from the true RCM by estimator [px]",
              {"lines of", "estimator", "mean", "std", "largest", "error / sigma", "sets"},
              {}};
  for (const auto& of_method : result.methods)
    for (const bool pairwise : {true, false}) {
      const auto& of = pairwise ? of_method.pairwise : of_method.least_squares;
      table.rows.push_back({method_title(of_method.method), estimator_name(pairwise),
                            fmt::format("{:.3f}", of.distance.mean), fmt::format("{:.3f}", of.distance.deviation),
                            fmt::format("{:.3f}", of.distance.largest), fmt::format("{:.2f}", of.in_sigmas),
                            fmt::format("{}/{}", of.estimates.size(), Result::sets)});
    }
  return table;
}

}  // namespace

RcmResult::Estimates summed_up(std::vector<RcmResult::Estimate> estimates) {
  Result::Estimates summary{std::move(estimates), {}, 0};
  std::vector<double> distances;
  double squares = 0;
  int coordinates = 0;
  for (const Result::Estimate& estimate : summary.estimates) {
    distances.push_back(estimate.error_px.norm());
    if (!estimate.covariance_px2) continue;
    squares += estimate.error_px.dot(estimate.covariance_px2->ldlt().solve(estimate.error_px));
    coordinates += 2;
  }
  summary.distance = spread_of(distances);
  if (coordinates > 0) summary.in_sigmas = std::sqrt(squares / coordinates);
  return summary;
}

RcmResult measure_rcm(const ExperimentSetup& setup) {
  const Camera& camera = setup.rig.camera;
  Result result;
  result.true_px = true_rcm_px(setup.rig);
  Random random(setup.seed + 2);
  std::vector<RcmCoordinates> positions;
  for (int set = 0; set < Result::sets; ++set)
    for (const RcmCoordinates& q : spread_positions(setup.rig, Result::positions, random)) positions.push_back(q);
  const cv::Mat tissue = make_tissue(camera.width_px, camera.height_px, setup.seed + 2);
  Rig unregistered = setup.rig;  // to know the RCM would be to bring it in
  unregistered.instruments[0].camera_from_rcm.reset();

  std::vector<std::vector<Observation>> sightings(frames);
  const auto make_worker = [&] {
    return [&, stage = std::make_shared<Stage>(setup.rig, tissue),
            eyes = std::make_shared<Eyes>(unregistered, setup.methods)](int frame) {
      sightings[static_cast<std::size_t>(frame)] = eyes->observe(
          stage->render(positions[static_cast<std::size_t>(frame)], 1, frame_seed(setup.seed + 2, frame)));
    };
  };
  in_parallel(frames, make_worker, setup.keep_going);

  for (std::size_t m = 0; m < setup.methods.size(); ++m) {
    Result::OfMethod of_method{setup.methods[m], {}, {}, {}};
    for (int frame = 0; frame < frames; ++frame) {
      const Observation& o = sightings[static_cast<std::size_t>(frame)][m];
      if (o.status == Status::ok)
        of_method.lines.push_back(
            {frame / Result::positions, frame % Result::positions, o.edges_ideal_px[0], o.edges_ideal_px[3]});
    }
    estimate(of_method, result.true_px);
    result.methods.push_back(std::move(of_method));
  }
  return result;
}

void write_data(const RcmResult& result, const std::filesystem::path& folder) {
  DataFile lines(folder / "rcm_lines.csv",
                 {"method", "set", "position", "from_u_px", "from_v_px", "to_u_px", "to_v_px"});
  DataFile estimates(folder / "rcm.csv", {"method", "estimator", "set", "true_u_px", "true_v_px", "error_u_px",
                                          "error_v_px", "sigma_u_px", "sigma_v_px", "covariance_uv_px2"});
  for (const auto& of_method : result.methods) {
    const std::string word = method_word(of_method.method);
    for (const Result::Line& line : of_method.lines)
      lines.row({word, line.set, line.position, line.from_px.x(), line.from_px.y(), line.to_px.x(), line.to_px.y()});
    for (const bool pairwise : {true, false})
      for (const Result::Estimate& e : (pairwise ? of_method.pairwise : of_method.least_squares).estimates) {
        const auto covariance = [&e](int i, int j) -> std::optional<double> {
          if (!e.covariance_px2) return std::nullopt;
          return i == j ? std::sqrt((*e.covariance_px2)(i, i)) : (*e.covariance_px2)(i, j);
        };
        estimates.row({word, pairwise ? "pairwise" : "least_squares", e.set, result.true_px.x(), result.true_px.y(),
                       e.error_px.x(), e.error_px.y(), covariance(0, 0), covariance(1, 1), covariance(0, 1)});
      }
  }
  lines.commit();
  estimates.commit();
}

ReportSection section_of(const RcmResult& result, const ExperimentSetup& setup) {
  ReportSection section{"rcm", "Image of the RCM (section V)", {}, {}, {}, {}, {}, {}, {}};
  section.text = {fmt::format(
      "Every centre line, extended, passes through the image of the remote centre of motion, here at ({:.1f}, {:.1f}) "
      "px. From 20 positions its place is estimated without knowing where the instrument\u2019s port is: the paper "
      "takes the mean of the intersections of all pairs of lines, the default a weighted total least squares that "
      "leaves outliers out and states its covariance. Ten sets of 20 positions each.",
      result.true_px.x(), result.true_px.y())};
  section.comparisons = {compared("projected RCM: distance from the truth, 20 positions", "3.62 \u00b1 2.13 px",
                                  result.methods, [](const auto& m) { return mean_and_deviation(m.own()); }),
                         compared("median of ten sets", "", result.methods,
                                  [](const auto& m) { return fmt::format("{:.3g} px", m.own().distance.median); }),
                         compared("largest of ten sets", "", result.methods,
                                  [](const auto& m) { return fmt::format("{:.3g} px", m.own().distance.largest); }),
                         compared("rms of error / stated sigma (1 is honest)", "", result.methods,
                                  [](const auto& m) { return fmt::format("{:.2f}", m.own().in_sigmas); }),
                         compared("lines", "20", result.methods,
                                  [](const auto& m) { return fmt::format("{} of {}", m.lines.size(), frames); })};
  section.figures.push_back({distance_by_set(result), "Each set is another 20 positions of the instrument."});
  section.figures.push_back(
      {fan(result, setup.rig.camera), "As " + method_title(result.methods.back().method) + " saw them."});
  for (const auto& of_method : result.methods)
    section.figures.push_back({cloud(of_method), "Ten sets; both estimators from the same lines."});
  section.tables.push_back(by_estimator(result));
  section.notes = {
      "The trackers do not know camera_from_rcm in this experiment: the default fits the shaft freely.",
      "The sigma of the mean of intersections is a jackknife over the lines, that of the least squares comes from the "
      "fit: the noise of the lines, estimated from how well they meet, and 0.01 px that all lines share."};
  section.command = "lapservo experiment rcm --out DIR" + setup.options;
  section.files = {"rcm.csv", "rcm_lines.csv"};
  return section;
}

}  // namespace lapservo
