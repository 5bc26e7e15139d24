#include "lapservo/experiments/rcm.h"

#include <cmath>

#include <fmt/format.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/dense_matrix.h"
#include "lapservo/experiments/data_file.h"
#include "lapservo/experiments/stage.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/rcm/pairwise_mean.h"
#include "lapservo/rcm/projected_rcm.h"
#include "lapservo/sim/tissue.h"

namespace lapservo::internal {
namespace {

constexpr int all_frames = RcmResult::sets * RcmResult::positions;
constexpr double nominal_sigma_px = 0.1;  // only its being the same for all lines counts
// The common offset of all lines, as in `lapservo estimate-rcm`: the sides of the shaft are lit unequally.
constexpr double common_px = 0.01;

// Pairs of lines that cross at less make up the long tail of the intersections.
constexpr double well_crossed_rad = 10 * pi / 180;

std::vector<LineObservation> lines_of_set(const RcmResult::OfMethod& of_method, int set) {
  std::vector<LineObservation> lines;
  for (const RcmResult::Line& line : of_method.lines)
    if (line.set == set) lines.push_back(line_between(line.from_px, line.to_px, nominal_sigma_px));
  return lines;
}

void estimate(RcmResult::OfMethod& of_method, const Eigen::Vector2d& true_px) {
  std::vector<RcmResult::Estimate> pairwise, least_squares;
  for (int set = 0; set < RcmResult::sets; ++set) {
    const auto lines = lines_of_set(of_method, set);
    if (const auto mean = mean_of_intersections(lines))
      pairwise.push_back({set, mean->point_px - true_px, mean->covariance_px2});
    if (const auto fit = estimate_projected_rcm(lines, {NoiseScale::estimated, common_px}); fit.status == RcmStatus::ok)
      least_squares.push_back({set, fit.point_px - true_px, fit.covariance_px2});
  }
  of_method.pairwise = summed_up(std::move(pairwise));
  of_method.least_squares = summed_up(std::move(least_squares));
}

std::vector<double> distances_of(const RcmResult::OfMethod& of_method, double min_angle_rad) {
  std::vector<double> distances;
  for (const RcmResult::Intersection& at : of_method.intersections)
    if (at.angle_rad >= min_angle_rad) distances.push_back(at.distance_px);
  return distances;
}

// With its scale for most of the points, and how many are beyond it.
Figure cloud_of_intersections(const RcmResult::OfMethod& of_method, const Eigen::Vector2d& true_px) {
  const auto of_set = [&](const RcmResult::Intersection& at) {
    return at.set == 0 ? PlotPoint({at.px.x() - true_px.x(), at.px.y() - true_px.y()}) : std::nullopt;
  };
  Plot plot{"Intersections about the truth: " + method_title(of_method.method),
            {"error in u", "px"},
            {"error in v", "px"},
            {{"truth", {0}, {0}, Draw::points, -1},
             series_of("of two lines", of_method.intersections, of_set, Draw::points, method_colour(of_method.method))},
            {},
            true};
  limit_to_most(plot);
  const std::size_t outside = points_outside(plot);
  return {std::move(plot),
          fmt::format("The {} pairs of the first set, of which {} lie outside the plot.", RcmResult::pairs, outside)};
}

// The fraction of the intersections within a distance.
Plot fractions_within(const RcmResult& result) {
  Plot plot{"Distances of the intersections from the true RCM",
            {"distance", "px", {}, {}, true},
            {"fraction within", "%", 0, 100},
            {},
            {{"half of them", 50}}};
  for (const auto& of_method : result.methods) {
    Series series{method_title(of_method.method), {}, {}, Draw::line, method_colour(of_method.method)};
    const auto distances = distances_of(of_method, 0);
    if (distances.empty()) continue;
    for (int percent = 1; percent <= 100; ++percent) {
      series.x.push_back(quantile_of(distances, 0.01 * percent));
      series.y.push_back(percent);
    }
    plot.series.push_back(std::move(series));
  }
  plot.series.push_back({fmt::format("the paper\u2019s mean, {} px", RcmResult::paper_mean_px),
                         {RcmResult::paper_mean_px, RcmResult::paper_mean_px},
                         {0, 100},
                         Draw::dashed,
                         -1});
  return plot;
}

// The lines of the first set, from the RCM to their far ends.
Plot fan(const RcmResult& result, const Camera& camera) {
  const RcmResult::OfMethod& of_method = result.methods.back();
  Plot plot{"The centre lines of the first set meet in the RCM", {"u", "px"}, {"v", "px"}, {}, {}, true};
  const double right = camera.width_px - 1, bottom = camera.height_px - 1;
  plot.series.push_back({"image", {0, right, right, 0, 0}, {0, 0, bottom, bottom, 0}, Draw::dashed, -1});
  Series extended{"", {}, {}, Draw::line, -1}, seen{"e0 to e3", {}, {}, Draw::line, method_colour(of_method.method)};
  const auto gap = [](Series& series) { series.x.push_back(std::nan("")), series.y.push_back(std::nan("")); };
  const auto add = [](Series& series, const Eigen::Vector2d& p) {
    series.x.push_back(p.x()), series.y.push_back(p.y());
  };
  for (const RcmResult::Line& line : of_method.lines) {
    if (line.set != 0) continue;
    add(extended, result.true_px), add(extended, line.from_px), gap(extended);
    add(seen, line.from_px), add(seen, line.to_px), gap(seen);
  }
  plot.series.push_back(std::move(extended));
  plot.series.push_back(std::move(seen));
  plot.series.push_back({"true RCM", {result.true_px.x()}, {result.true_px.y()}, Draw::points, 2});
  return plot;
}

Table by_estimator(const RcmResult& result) {
  Table table{
      "Distance of the estimate from the true RCM",
      {"lines of", "estimator", "mean [px]", "std [px]", "median [px]", "largest [px]", "error / sigma", "sets"}};
  for (const auto& of_method : result.methods)
    for (const bool pairwise : {true, false}) {
      const auto& of = pairwise ? of_method.pairwise : of_method.least_squares;
      table.rows.push_back({method_title(of_method.method), pairwise ? "mean of intersections" : "total least squares",
                            with_digits(of.distance.mean, 3), with_digits(of.distance.deviation, 3),
                            with_digits(of.distance.median, 3), with_digits(of.distance.largest, 3),
                            with_digits(of.in_sigmas, 3),
                            fmt::format("{} of {}", of.estimates.size(), RcmResult::sets)});
    }
  return table;
}

std::vector<Comparison> comparisons_of(const RcmResult& result) {
  const auto row = comparing(result.methods);
  const auto quantile = [](double fraction) {
    return [fraction](const auto& m) {
      const auto distances = distances_of(m, 0);
      return distances.empty() ? unknown_text : with_digits(quantile_of(distances, fraction), 3) + " px";
    };
  };
  return {row("intersections of two lines: distance from the true RCM, mean \u00b1 std",
              fmt::format("{:.2f} \u00b1 {:.2f} px", RcmResult::paper_mean_px, RcmResult::paper_deviation_px),
              [](const auto& m) { return mean_and_deviation(m.distance, "px"); }),
          row("of pairs of lines that cross at 10\u00b0 or more", "",
              [](const auto& m) { return mean_and_deviation(spread_of(distances_of(m, well_crossed_rad)), "px"); }),
          row("median of all", "", quantile(0.5)),
          row("nine in ten are within", "", quantile(0.9)),
          row("intersections", fmt::format("{}", RcmResult::pairs),
              [](const auto& m) { return fmt::format("{}", m.intersections.size()); }),
          row("lines", fmt::format("{}", RcmResult::positions),
              [](const auto& m) { return fmt::format("{} of {}", m.lines.size(), all_frames); }),
          row("the estimate itself, mean of a set\u2019s intersections (eq. 9): distance from the true RCM", "",
              [](const auto& m) { return mean_and_deviation(m.pairwise.distance, "px"); }),
          row("the estimate itself, weighted total least squares", "",
              [](const auto& m) { return mean_and_deviation(m.least_squares.distance, "px"); })};
}

}  // namespace

RcmResult::Estimates summed_up(std::vector<RcmResult::Estimate> estimates) {
  RcmResult::Estimates summary{std::move(estimates), {}};
  std::vector<double> distances;
  double squares = 0;
  int coordinates = 0;
  for (const RcmResult::Estimate& estimate : summary.estimates) {
    distances.push_back(estimate.error_px.norm());
    if (!estimate.covariance_px2) continue;
    squares += estimate.error_px.dot(solve_symmetric(*estimate.covariance_px2, estimate.error_px).col(0));
    coordinates += 2;
  }
  summary.distance = spread_of(distances);
  if (coordinates > 0) summary.in_sigmas = std::sqrt(squares / coordinates);
  return summary;
}

Rig with_rcm_in_view(Rig rig) {
  const Camera& camera = rig.camera;
  Eigen::Vector3d& at_m = rig.instruments[0].camera_from_rcm->translation;
  const auto inside = [](double px, int size_px) { return px >= 0 && px <= size_px - 1; };
  if (at_m.z() > 0) {
    const Eigen::Vector2d raw_px = camera.raw_from_point(at_m);
    if (inside(raw_px.x(), camera.width_px) && inside(raw_px.y(), camera.height_px)) return rig;
  }
  constexpr double across = 0.15, down = 0.2, depth_m = 0.1;
  at_m = depth_m * camera.ray_from_ideal({across * camera.width_px, down * camera.height_px});
  return rig;
}

std::vector<RcmResult::Intersection> intersections_of(const std::vector<RcmResult::Line>& lines,
                                                      const Eigen::Vector2d& true_px) {
  std::vector<RcmResult::Intersection> found;
  for (std::size_t i = 0; i < lines.size(); ++i)
    for (std::size_t k = i + 1; k < lines.size() && lines[k].set == lines[i].set; ++k) {
      const LineObservation a = line_between(lines[i].from_px, lines[i].to_px, nominal_sigma_px),
                            b = line_between(lines[k].from_px, lines[k].to_px, nominal_sigma_px);
      const auto at = intersection_px(a, b);
      if (!at) continue;
      const double cosine = (a.to_px - a.from_px).normalized().dot((b.to_px - b.from_px).normalized());
      found.push_back({lines[i].set, lines[i].position, lines[k].position, *at, (*at - true_px).norm(),
                       std::acos(std::min(1.0, std::abs(cosine)))});
    }
  return found;
}

RcmResult measure_rcm(const ExperimentSetup& setup) {
  const Rig rig = with_rcm_in_view(setup.rig);
  RcmResult result{rig, projected_rcm_px(rig.camera, *rig.instruments[0].camera_from_rcm).value(), {}};
  Random random(setup.seed + 2);
  std::vector<JointVector> positions;
  for (int set = 0; set < RcmResult::sets; ++set)
    for (const JointVector& q : spread_positions(rig, RcmResult::positions, random)) positions.push_back(q);
  const cv::Mat tissue = make_tissue(rig.camera.width_px, rig.camera.height_px, setup.seed + 2);
  const Rig unregistered = without_registration(rig);  // to know the RCM would be to bring it in

  std::vector<std::vector<Observation>> sightings(all_frames);
  const auto make_worker = [&] {
    return [&, stage = std::make_shared<Stage>(rig, tissue),
            eyes = std::make_shared<Eyes>(unregistered, setup.methods)](int frame) {
      sightings[static_cast<std::size_t>(frame)] = eyes->observe(
          stage->render(positions[static_cast<std::size_t>(frame)], 1, frame_seed(setup.seed + 2, frame)));
    };
  };
  in_parallel(all_frames, make_worker, setup.keep_going);

  for (std::size_t m = 0; m < setup.methods.size(); ++m) {
    RcmResult::OfMethod of_method{setup.methods[m], {}, {}, {}, {}, {}};
    for (int frame = 0; frame < all_frames; ++frame) {
      const Observation& o = sightings[static_cast<std::size_t>(frame)][m];
      if (o.status == Status::ok)
        of_method.lines.push_back(
            {frame / RcmResult::positions, frame % RcmResult::positions, o.edges_ideal_px[0], o.edges_ideal_px[3]});
    }
    of_method.intersections = intersections_of(of_method.lines, result.true_px);
    of_method.distance = spread_of(distances_of(of_method, 0));
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
  DataFile intersections(folder / "rcm_intersections.csv",
                         {"method", "set", "first_position", "second_position", "u_px", "v_px", "true_u_px",
                          "true_v_px", "distance_px", "angle_rad"});
  for (const auto& of_method : result.methods) {
    const std::string word(to_string(of_method.method));
    for (const RcmResult::Intersection& at : of_method.intersections)
      intersections.row({word, at.set, at.first, at.second, at.px.x(), at.px.y(), result.true_px.x(),
                         result.true_px.y(), at.distance_px, at.angle_rad});
    for (const RcmResult::Line& line : of_method.lines)
      lines.row({word, line.set, line.position, line.from_px.x(), line.from_px.y(), line.to_px.x(), line.to_px.y()});
    for (const bool pairwise : {true, false})
      for (const RcmResult::Estimate& e : (pairwise ? of_method.pairwise : of_method.least_squares).estimates) {
        const auto covariance = [&e](int i, int j) -> std::optional<double> {
          if (!e.covariance_px2) return std::nullopt;
          return i == j ? std::sqrt((*e.covariance_px2)(i, i)) : (*e.covariance_px2)(i, j);
        };
        estimates.row({word, pairwise ? "pairwise" : "least_squares", e.set, result.true_px.x(), result.true_px.y(),
                       e.error_px.x(), e.error_px.y(), covariance(0, 0), covariance(1, 1), covariance(0, 1)});
      }
  }
  lines.commit();
  intersections.commit();
  estimates.commit();
}

ReportSection section_of(const RcmResult& result, const ExperimentSetup& setup) {
  ReportSection section{"rcm", "Image of the RCM (section V-B)"};
  section.text = {fmt::format("Every centre line, extended, passes through the image of the remote centre of motion "
                              "(RCM), here in view at ({:.1f}, {:.1f}) px. {} positions give {} lines and {} "
                              "intersections of two; the paper\u2019s figure is the distance of each intersection from "
                              "the RCM in the image. Here: {} sets of {} positions, pooled, against the exact RCM.",
                              result.true_px.x(), result.true_px.y(), RcmResult::positions, RcmResult::positions,
                              RcmResult::pairs, RcmResult::sets, RcmResult::positions),
                  "The loop uses one estimate from all lines, whose error the paper does not give: its mean of the "
                  "intersections (eq. 9), or the default\u2019s weighted total least squares, which leaves outliers "
                  "out and states its covariance."};
  section.comparisons = comparisons_of(result);
  for (const auto& of_method : result.methods)
    section.figures.push_back(cloud_of_intersections(of_method, result.true_px));
  section.figures.push_back({fractions_within(result), fmt::format("All {} sets.", RcmResult::sets)});
  section.figures.push_back(
      {fan(result, result.rig.camera), "As " + method_title(result.methods.back().method) + " saw them."});
  section.tables.push_back(by_estimator(result));
  const Eigen::Vector3d& at_m = result.rig.instruments[0].camera_from_rcm->translation;
  section.notes = {
      fmt::format("The rig is the one of the other experiments{}: the RCM lies at ({:.1f}, {:.1f}, {:.1f}) mm before "
                  "the camera.",
                  at_m == setup.rig.instruments[0].camera_from_rcm->translation ? "" : " with the RCM moved into view",
                  1e3 * at_m.x(), 1e3 * at_m.y(), 1e3 * at_m.z()),
      "Two lines that are nearly parallel meet anywhere. How many there are is a matter of the positions, which the "
      "paper does not give; hence the row for pairs that cross at 10\u00b0 or more.",
      "The trackers do not know camera_from_rcm in this experiment: the default fits the shaft freely.",
      "The sigma of the mean of intersections is a jackknife over the lines, that of the least squares comes from the "
      "fit: the noise of the lines, estimated from how well they meet, and 0.01 px that all lines share."};
  section.command = "lapservo experiment rcm --out DIR" + setup.options;
  section.files = {"rcm_intersections.csv", "rcm.csv", "rcm_lines.csv"};
  return section;
}

}  // namespace lapservo::internal
