#include "lapservo/experiments/illumination.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/experiments/data_file.h"
#include "lapservo/experiments/stage.h"
#include "lapservo/io/overlay.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/sim/tissue.h"

namespace lapservo::internal {
namespace {

constexpr int light_count = static_cast<int>(IlluminationResult::lights.size());

// By frame (position after position under one light, then the next light), then by method.
using Sightings = std::vector<std::vector<Observation>>;

std::size_t frame_of(int position, int light) {
  return static_cast<std::size_t>(light * IlluminationResult::positions + position);
}

// The measurements at one position: each point relative to its own centroid over the lights.
void add_position(std::vector<IlluminationResult::Point>& points, const Sightings& sightings, std::size_t method,
                  int position, const CentreLine& truth, const Camera& camera) {
  for (int k = 0; k < 4; ++k) {
    std::vector<Eigen::Vector2d> seen;
    std::vector<int> under;
    for (int light = 0; light < light_count; ++light) {
      const Observation& o = sightings[frame_of(position, light)][method];
      if (o.status != Status::ok) continue;
      seen.push_back(o.edges_raw_px[static_cast<std::size_t>(k)]);
      under.push_back(light);
    }
    const auto distances = distances_to_centroid(seen);
    const Eigen::Vector2d true_px = camera.raw_from_ideal(truth.ideal_px[static_cast<std::size_t>(k)]);
    for (std::size_t i = 0; i < seen.size(); ++i)
      points.push_back(
          {position, under[i], k, seen[i], seen.size() > 1 ? distances[i] : std::nan(""), (seen[i] - true_px).norm()});
  }
}

std::vector<IlluminationResult::Largest> max_distances(const std::vector<IlluminationResult::Point>& points) {
  std::map<std::pair<int, int>, std::vector<double>> by_point;
  for (const IlluminationResult::Point& point : points)
    by_point[{point.position, point.point}].push_back(point.to_centroid_px);
  std::vector<IlluminationResult::Largest> largest;
  for (const auto& [where, distances] : by_point)
    if (distances.size() == IlluminationResult::lights.size())
      largest.push_back({where.first, where.second, *std::max_element(distances.begin(), distances.end())});
  return largest;
}

// Three quarters of the frame about the marker, 640 px wide.
cv::Mat tile_of(const cv::Mat& picture, const Eigen::Vector2d& middle_px) {
  const int width = 3 * picture.cols / 4, height = 3 * picture.rows / 4;
  const int left = std::clamp(static_cast<int>(middle_px.x()) - width / 2, 0, picture.cols - width);
  const int top = std::clamp(static_cast<int>(middle_px.y()) - height / 2, 0, picture.rows - height);
  cv::Mat tile;
  cv::resize(picture(cv::Rect(left, top, width, height)), tile, {640, 640 * height / width}, 0, 0, cv::INTER_AREA);
  return tile;
}

cv::Mat example(const ExperimentSetup& setup, Stage& stage, const JointVector& q) {
  Eyes eyes(setup.rig, {setup.methods.back()});
  const Eigen::Vector2d middle = marker_middle_px(setup.rig.camera, setup.rig.instruments[0], q);
  std::array<cv::Mat, 4> tiles;
  for (std::size_t light = 0; light < tiles.size(); ++light) {
    const cv::Mat frame = stage.render(q, IlluminationResult::lights[light], frame_seed(setup.seed, 0));
    tiles[light] = tile_of(draw_overlay(frame, setup.rig, eyes.observe(frame)), middle);
  }
  cv::Mat upper, lower, both;
  cv::hconcat(tiles[0], tiles[1], upper);
  cv::hconcat(tiles[2], tiles[3], lower);
  cv::vconcat(upper, lower, both);
  return both;
}

Series by_position(const IlluminationResult::OfMethod& of_method) {
  const auto point = [](const IlluminationResult::Largest& one) { return PlotPoint({one.position, one.px}); };
  return series_of(method_title(of_method.method), of_method.largest, point, Draw::points,
                   method_colour(of_method.method));
}

Series by_light(const IlluminationResult::OfMethod& of_method) {
  Series series{method_title(of_method.method), {}, {}, Draw::line_and_points, method_colour(of_method.method)};
  for (int light = 0; light < light_count; ++light) {
    std::vector<double> distances;
    for (const IlluminationResult::Point& point : of_method.points)
      if (point.light == light && std::isfinite(point.to_centroid_px)) distances.push_back(point.to_centroid_px);
    if (distances.empty()) continue;
    series.x.push_back(100 * IlluminationResult::lights[static_cast<std::size_t>(light)]);
    series.y.push_back(spread_of(distances).mean);
  }
  return series;
}

Plot distance_plot(const std::string& title, Axis x, const std::string& y, const IlluminationResult& result,
                   Series (*series_of)(const IlluminationResult::OfMethod&)) {
  Plot plot{title, std::move(x), {y, "px", {}, {}, true}};
  for (const auto& of_method : result.methods) plot.series.push_back(series_of(of_method));
  return plot;
}

Plot plot_of_largest(const IlluminationResult& result) {
  Plot plot =
      distance_plot("Largest distance to the centroid, by position",
                    {"position", "", -1, IlluminationResult::positions}, "largest distance", result, by_position);
  plot.references.push_back({fmt::format("the paper\u2019s mean: {} px", IlluminationResult::paper_mean_px),
                             IlluminationResult::paper_mean_px});
  return plot;
}

std::string percents() {
  const auto& lights = IlluminationResult::lights;
  return fmt::format("{:.0f}, {:.0f}, {:.0f} and {:.0f} %", 100 * lights[0], 100 * lights[1], 100 * lights[2],
                     100 * lights[3]);
}

std::vector<Comparison> comparisons_of(const IlluminationResult& result) {
  const auto row = comparing(result.methods);
  const std::string points = fmt::format("{}", 4 * IlluminationResult::positions);
  const std::string measurements = fmt::format("{}", 4 * IlluminationResult::positions * light_count);
  return {row("largest distance of a point\u2019s four measurements to their centroid, mean \u00b1 std of the "
              "points that were found under all four lights",
              fmt::format("{:.2f} \u00b1 {:.2f} px", IlluminationResult::paper_mean_px,
                          IlluminationResult::paper_deviation_px),
              [](const auto& m) { return mean_and_deviation(m.of_largest, "px"); }),
          row("points that were found under all four lights", points,
              [](const auto& m) { return fmt::format("{}", m.largest.size()); }),
          row("measurements", measurements, [](const auto& m) { return fmt::format("{}", m.points.size()); }),
          row("the largest distance of all", "",
              [](const auto& m) { return with_digits(m.of_largest.largest, 3) + " px"; }),
          row("distance to their centroid, all measurements, mean \u00b1 std", "",
              [](const auto& m) { return mean_and_deviation(m.to_centroid, "px"); }),
          row("distance to the truth, all measurements, mean \u00b1 std", "",
              [](const auto& m) { return mean_and_deviation(m.to_truth, "px"); })};
}

}  // namespace

IlluminationResult measure_illumination(const ExperimentSetup& setup) {
  const Camera& camera = setup.rig.camera;
  Random random(setup.seed);
  const auto positions = spread_positions(setup.rig, IlluminationResult::positions, random);
  const cv::Mat tissue = make_tissue(camera.width_px, camera.height_px, setup.seed);

  const Rig unregistered = without_registration(setup.rig);

  Sightings sightings(static_cast<std::size_t>(IlluminationResult::positions * light_count));
  const auto make_worker = [&] {
    return [&, stage = std::make_shared<Stage>(setup.rig, tissue),
            eyes = std::make_shared<Eyes>(unregistered, setup.methods)](int frame) {
      const auto position = static_cast<std::size_t>(frame % IlluminationResult::positions);
      const double light = IlluminationResult::lights[static_cast<std::size_t>(frame / IlluminationResult::positions)];
      sightings[static_cast<std::size_t>(frame)] =
          eyes->observe(stage->render(positions[position], light, frame_seed(setup.seed, frame)));
    };
  };
  in_parallel(IlluminationResult::positions * light_count, make_worker, setup.keep_going);

  IlluminationResult result;
  for (std::size_t m = 0; m < setup.methods.size(); ++m) {
    std::vector<IlluminationResult::Point> points;
    for (int i = 0; i < IlluminationResult::positions; ++i) {
      const JointVector& q = positions[static_cast<std::size_t>(i)];
      const Rigid3 unrolled = *setup.rig.instruments[0].camera_from_rcm * rcm_from_unrolled(q);
      const auto truth = centre_line(camera, setup.rig.instruments[0].marker, unrolled, q.psi_rad);
      add_position(points, sightings, m, i, truth.value(), camera);
    }
    result.methods.push_back(summed_up(setup.methods[m], std::move(points)));
  }
  Stage stage(setup.rig, tissue);
  result.example_bgr = example(setup, stage, positions[0]);
  return result;
}

IlluminationResult::OfMethod summed_up(Method method, std::vector<IlluminationResult::Point> points) {
  IlluminationResult::OfMethod of_method{method, std::move(points), {}, {}, {}, {}};
  of_method.largest = max_distances(of_method.points);
  std::vector<double> largest, to_centroid, to_truth;
  for (const IlluminationResult::Largest& of_point : of_method.largest) largest.push_back(of_point.px);
  for (const IlluminationResult::Point& point : of_method.points) {
    if (std::isfinite(point.to_centroid_px)) to_centroid.push_back(point.to_centroid_px);
    to_truth.push_back(point.to_truth_px);
  }
  of_method.of_largest = spread_of(std::move(largest));
  of_method.to_centroid = spread_of(std::move(to_centroid));
  of_method.to_truth = spread_of(std::move(to_truth));
  return of_method;
}

void write_data(const IlluminationResult& result, const std::filesystem::path& folder) {
  DataFile file(folder / "illumination.csv",
                {"method", "position", "light_percent", "point", "u_px", "v_px", "to_centroid_px", "to_truth_px"});
  for (const auto& of_method : result.methods)
    for (const IlluminationResult::Point& p : of_method.points)
      file.row({std::string(to_string(of_method.method)), p.position,
                100 * IlluminationResult::lights[static_cast<std::size_t>(p.light)], fmt::format("e{}", p.point),
                p.raw_px.x(), p.raw_px.y(), p.to_centroid_px, p.to_truth_px});
  DataFile largest(folder / "illumination_largest.csv", {"method", "position", "point", "largest_to_centroid_px"});
  for (const auto& of_method : result.methods)
    for (const IlluminationResult::Largest& l : of_method.largest)
      largest.row({std::string(to_string(of_method.method)), l.position, fmt::format("e{}", l.point), l.px});
  file.commit();
  largest.commit();
}

ReportSection section_of(const IlluminationResult& result, const ExperimentSetup& setup) {
  ReportSection section{"illumination", "Illumination (section V-B)"};
  section.text = {fmt::format(
      "The instrument stands still at {} positions spread over the field of view, lit at {} of the lamps\u2019 power. "
      "Each of the four boundary points should stay where it is. As in the paper: of each point in each position the "
      "largest distance of its {} measurements to their centroid, and of these {} distances, less those of points that "
      "were not found under every light, the mean and the standard "
      "deviation.",
      IlluminationResult::positions, percents(), light_count, 4 * IlluminationResult::positions)};
  section.comparisons = comparisons_of(result);
  section.figures.push_back({plot_of_largest(result), "The four points of each position, as the paper measures them."});
  section.figures.push_back({distance_plot("Distance to the centroid, by light", {"power of the lamps", "%", 30, 110},
                                           "distance to centroid", result, by_light),
                             "Mean over all positions and points, each measurement counted."});
  section.figures.push_back(
      {Picture{"One position under the four lights", result.example_bgr},
       percents() + " of the power, with what " + method_title(result.methods.back().method) + " saw."});
  section.notes = {
      fmt::format("The lamps are turned down, the camera\u2019s exposure stays: diffuse and specular light of the film "
                  "fade, what saturated near the lamps does no more, and there is less light over the same read noise. "
                  "{:.0f} % of the full light comes from elsewhere and stays, so the shading changes its shape too.",
                  100 * Stage::ambient_fraction),
      "The trackers do not know camera_from_rcm in this experiment, and look at each frame on its own."};
  section.command = "lapservo experiment illumination --out DIR" + setup.options;
  section.files = {"illumination.csv", "illumination_largest.csv"};
  return section;
}

}  // namespace lapservo::internal
