#include "lapservo/experiments/illumination.h"

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/experiments/comparison.h"
#include "lapservo/experiments/data_file.h"
#include "lapservo/experiments/positions.h"
#include "lapservo/experiments/stage.h"
#include "lapservo/io/overlay.h"
#include "lapservo/sim/tissue.h"

namespace lapservo {
namespace {

constexpr int light_count = static_cast<int>(IlluminationResult::lights.size());

using Result = IlluminationResult;
// By frame (position after position under one light, then the next light), then by method.
using Sightings = std::vector<std::vector<Observation>>;

std::size_t frame_of(int position, int light) {
  return static_cast<std::size_t>(light * Result::positions + position);
}

// What was seen of one position: each point against its own centroid over the lights.
void add_position(Result::OfMethod& of_method, const Sightings& sightings, std::size_t method, int position,
                  const CentreLine& truth, const Camera& camera) {
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
      of_method.points.push_back({position, under[i], k, seen[i], distances[i], (seen[i] - true_px).norm()});
    if (k == 0) of_method.found += static_cast<int>(seen.size());
  }
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

cv::Mat example(const ExperimentSetup& setup, Stage& stage, const RcmCoordinates& q) {
  Eyes eyes(setup.rig, {setup.methods.back()});
  const Eigen::Vector2d middle = marker_middle_px(setup.rig.camera, setup.rig.instruments[0], q);
  std::array<cv::Mat, 4> tiles;
  for (std::size_t light = 0; light < tiles.size(); ++light) {
    const cv::Mat frame = stage.render(q, Result::lights[light], frame_seed(setup.seed, 0));
    tiles[light] = tile_of(draw_overlay(frame, setup.rig, eyes.observe(frame)), middle);
  }
  cv::Mat upper, lower, both;
  cv::hconcat(tiles[0], tiles[1], upper);
  cv::hconcat(tiles[2], tiles[3], lower);
  cv::vconcat(upper, lower, both);
  return both;
}

Series by_position(const Result::OfMethod& of_method) {
  Series series{method_title(of_method.method), {}, {}, {}, Draw::line_and_points, method_color(of_method.method)};
  for (int position = 0; position < Result::positions; ++position) {
    std::vector<double> distances;
    for (const Result::Point& point : of_method.points)
      if (point.position == position) distances.push_back(point.to_centroid_px);
    if (distances.empty()) continue;
    series.x.push_back(position + 1);
    series.y.push_back(spread_of(distances).mean);
  }
  return series;
}

Series by_light(const Result::OfMethod& of_method) {
  Series series{method_title(of_method.method), {}, {}, {}, Draw::line_and_points, method_color(of_method.method)};
  for (int light = 0; light < light_count; ++light) {
    std::vector<double> distances;
    for (const Result::Point& point : of_method.points)
      if (point.light == light) distances.push_back(point.to_centroid_px);
    if (distances.empty()) continue;
    series.x.push_back(100 * Result::lights[static_cast<std::size_t>(light)]);
    series.y.push_back(spread_of(distances).mean);
  }
  return series;
}

Plot map_of_points(const Result::OfMethod& of_method, const Camera& camera) {
  Plot plot{"Where the points were (" + method_title(of_method.method) + ")",
            {"u", "px", 0, camera.width_px},
            {"v", "px", 0, camera.height_px},
            {},
            {},
            true};
  for (int k = 0; k < 4; ++k) {
    Series series{fmt::format("e{}", k), {}, {}, {}, Draw::points, k};
    for (const Result::Point& point : of_method.points)
      if (point.point == k && point.light == 0) {
        series.x.push_back(point.raw_px.x());
        series.y.push_back(point.raw_px.y());
      }
    plot.series.push_back(std::move(series));
  }
  return plot;
}

Plot distance_plot(const std::string& title, Axis x, const Result& result,
                   Series (*series_of)(const Result::OfMethod&)) {
  Plot plot{title, std::move(x), {"distance to centroid", "px", {}, {}, true}, {}, {}, false};
  for (const auto& of_method : result.methods) plot.series.push_back(series_of(of_method));
  plot.references.push_back({"the paper: 1.49 px", Result::paper_mean_px});
  return plot;
}

}  // namespace

IlluminationResult measure_illumination(const ExperimentSetup& setup) {
  const Camera& camera = setup.rig.camera;
  Random random(setup.seed);
  const auto positions = spread_positions(setup.rig, Result::positions, random);
  const cv::Mat tissue = make_tissue(camera.width_px, camera.height_px, setup.seed);

  Sightings sightings(static_cast<std::size_t>(Result::positions * light_count));
  const auto make_worker = [&] {
    return [&, stage = std::make_shared<Stage>(setup.rig, tissue),
            eyes = std::make_shared<Eyes>(setup.rig, setup.methods)](int frame) {
      const auto position = static_cast<std::size_t>(frame % Result::positions);
      const double light = Result::lights[static_cast<std::size_t>(frame / Result::positions)];
      sightings[static_cast<std::size_t>(frame)] =
          eyes->observe(stage->render(positions[position], light, frame_seed(setup.seed, frame)));
    };
  };
  in_parallel(Result::positions * light_count, make_worker, setup.keep_going);

  Result result;
  for (std::size_t m = 0; m < setup.methods.size(); ++m) {
    Result::OfMethod of_method{setup.methods[m], 0, {}, {}, {}};
    for (int i = 0; i < Result::positions; ++i) {
      const RcmCoordinates& q = positions[static_cast<std::size_t>(i)];
      const Rigid3 unrolled = *setup.rig.instruments[0].camera_from_rcm * rcm_from_unrolled(q);
      const auto truth = centre_line(camera, setup.rig.instruments[0].marker, unrolled, q.psi_rad);
      add_position(of_method, sightings, m, i, truth.value(), camera);
    }
    std::vector<double> to_centroid, to_truth;
    for (const Result::Point& point : of_method.points) {
      to_centroid.push_back(point.to_centroid_px);
      to_truth.push_back(point.to_truth_px);
    }
    of_method.to_centroid = spread_of(to_centroid);
    of_method.to_truth = spread_of(to_truth);
    result.methods.push_back(std::move(of_method));
  }
  Stage stage(setup.rig, tissue);
  result.example_bgr = example(setup, stage, positions[0]);
  return result;
}

void write_data(const IlluminationResult& result, const std::filesystem::path& folder) {
  DataFile file(folder / "illumination.csv",
                {"method", "position", "light_percent", "point", "u_px", "v_px", "to_centroid_px", "to_truth_px"});
  for (const auto& of_method : result.methods)
    for (const Result::Point& p : of_method.points)
      file.row({method_word(of_method.method), p.position, 100 * Result::lights[static_cast<std::size_t>(p.light)],
                fmt::format("e{}", p.point), p.raw_px.x(), p.raw_px.y(), p.to_centroid_px, p.to_truth_px});
  file.commit();
}

ReportSection section_of(const IlluminationResult& result, const ExperimentSetup& setup) {
  ReportSection section{"illumination", "Illumination (section V-B)", {}, {}, {}, {}, {}, {}, {}};
  section.text = {
      "The instrument stands still at 20 positions spread over the field of view, lit at 40, 60, 80 and 100 %. Each of "
      "the four boundary points should stay where it is: 320 points, and for each its distance to the centroid of the "
      "same point under all four lights."};
  section.comparisons = {compared("points\u2019 mean distance to their centroid", "1.49 px", result.methods,
                                  [](const auto& m) { return fmt::format("{:.3g} px", m.to_centroid.mean); }),
                         compared("largest", "", result.methods,
                                  [](const auto& m) { return fmt::format("{:.3g} px", m.to_centroid.largest); }),
                         compared("points\u2019 mean distance to the truth", "", result.methods,
                                  [](const auto& m) { return fmt::format("{:.3g} px", m.to_truth.mean); }),
                         compared("points measured", "320", result.methods,
                                  [](const auto& m) { return fmt::format("{}", m.points.size()); })};
  section.figures.push_back(
      {distance_plot("Spread over the lights, by position", {"position", "", 0, 21}, result, by_position),
       "Mean over the four points and four lights of one position."});
  section.figures.push_back(
      {distance_plot("Distance to the centroid, by light", {"light", "%", 30, 110}, result, by_light),
       "Mean over all positions and points."});
  section.figures.push_back({map_of_points(result.methods.back(), setup.rig.camera),
                             "All positions under 40 % of the light: they cover the field of view."});
  section.figures.push_back(
      {Picture{"One position under the four lights", result.example_bgr},
       "40, 60, 80 and 100 % of the light, with what " + method_title(result.methods.back().method) + " saw."});
  section.notes = {"Light here means exposure: the sensor\u2019s noise stays, so darker frames are noisier.",
                   "Each frame is looked at on its own, without help from the one before."};
  section.command = "lapservo experiment illumination --out DIR" + setup.options;
  section.files = {"illumination.csv"};
  return section;
}

}  // namespace lapservo
