#include "apps/lapservo/camera_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/experiments/html_report.h"

namespace lapservo::app {
using namespace internal;
namespace {

// All views' corners over the picture, and in how many views each part of it has some.
Picture coverage_picture(const std::vector<BoardView>& views, const cv::Size& size) {
  constexpr int width = 640;
  const double scale = static_cast<double>(width) / size.width;
  cv::Mat canvas(static_cast<int>(size.height * scale), width, CV_8UC3, cv::Scalar(245, 245, 245));
  const Coverage coverage = coverage_of(views, size);
  for (int row = 0; row < Coverage::rows; ++row)
    for (int column = 0; column < Coverage::columns; ++column) {
      const cv::Point from(canvas.cols * column / Coverage::columns, canvas.rows * row / Coverage::rows);
      const cv::Point to(canvas.cols * (column + 1) / Coverage::columns, canvas.rows * (row + 1) / Coverage::rows);
      const int count = coverage.views[static_cast<std::size_t>(row * Coverage::columns + column)];
      if (count == 0) cv::rectangle(canvas, from, to, cv::Scalar(200, 200, 250), cv::FILLED);
      cv::rectangle(canvas, from, to, cv::Scalar(190, 190, 190));
      cv::putText(canvas, fmt::format("{}", count), from + cv::Point(6, 22), cv::FONT_HERSHEY_SIMPLEX, 0.6,
                  cv::Scalar(60, 60, 60), 1, cv::LINE_AA);
    }
  for (const BoardView& view : views)
    for (const BoardCorner& corner : view.corners)
      cv::circle(canvas, {static_cast<int>(scale * corner.raw_px.x()), static_cast<int>(scale * corner.raw_px.y())}, 2,
                 cv::Scalar(160, 90, 0), cv::FILLED, cv::LINE_AA);
  return {"Coverage", canvas};
}

// Means over so many rings about the principal point, for each side: what a wrong lens model would leave.
Plot residual_plot(const CameraCalibration& calibration) {
  constexpr std::size_t rings = 16;
  const Camera& camera = calibration.camera;
  const Eigen::Vector2d centre(camera.cx_px, camera.cy_px);
  const double reach_px = std::hypot(camera.width_px, camera.height_px) / 2;
  std::array<double, rings> sums{}, squares{}, counts{};
  for (const CameraResidual& residual : calibration.residuals) {
    const Eigen::Vector2d from = residual.raw_px - centre;
    const double radius_px = from.norm(), size_px = residual.beyond_px.norm();
    if (radius_px == 0 || size_px == 0) continue;
    const double outwards_px = residual.beyond_px.dot(from) / radius_px;
    const auto ring = std::min(rings - 1, static_cast<std::size_t>(radius_px / reach_px * rings));
    // An edge tells of the radial direction what its normal has of it.
    const double share = std::abs(outwards_px) / size_px;
    sums[ring] += share * outwards_px, counts[ring] += share * share;
    squares[ring] += outwards_px * outwards_px;
  }
  Series mean{.name = "outwards, mean", .x = {}, .y = {}, .sigma = {}, .draw = Draw::line_and_points, .color = 0};
  Series spread{.name = "rms", .x = {}, .y = {}, .sigma = {}, .draw = Draw::dashed, .color = 1};
  for (std::size_t ring = 0; ring < rings; ++ring) {
    if (counts[ring] < 10) continue;
    const double radius_px = (static_cast<double>(ring) + 0.5) / rings * reach_px;
    mean.x.push_back(radius_px), mean.y.push_back(sums[ring] / counts[ring]);
    spread.x.push_back(radius_px), spread.y.push_back(std::sqrt(squares[ring] / counts[ring]));
  }
  Plot plot;
  plot.title = "What edges miss the fit by";
  plot.x = {.label = "from the principal point", .unit = "px", .low = 0, .high = reach_px};
  plot.y = {.label = "residual", .unit = "px", .low = {}, .high = {}};
  plot.series = {std::move(mean), std::move(spread)};
  plot.references = {{"the model", 0}};
  return plot;
}

Series curve_of(const Response& response, const std::string& name, Draw draw, int color) {
  Series series{.name = name, .x = {}, .y = {}, .sigma = {}, .draw = draw, .color = color};
  constexpr int steps = 100;
  for (int i = 0; i <= steps; ++i) {
    const double light = static_cast<double>(i) / steps;
    series.x.push_back(light), series.y.push_back(response.value_from_light(light));
  }
  return series;
}

Plot response_plot(const Response& before, const CameraCalibration& calibration) {
  Plot plot;
  plot.title = "Response";
  plot.x = {.label = "light", .unit = "", .low = 0, .high = 1};
  plot.y = {.label = "value / 255", .unit = "", .low = 0, .high = 1};
  plot.series = {curve_of(before, "before", Draw::dashed, 1),
                 curve_of(calibration.camera.response, "calibrated", Draw::line, 0)};
  return plot;
}

Table numbers_table(const Camera& before, const CameraCalibration& calibration) {
  const Camera& camera = calibration.camera;
  const CameraSigmas& sigmas = calibration.sigmas;
  Table table{"One standard deviation each", {"", "before", "after", "sigma"}, {}};
  const auto add = [&](const char* name, double was, double is, double sigma) {
    table.rows.push_back({name, fmt::format("{:.6g}", was), fmt::format("{:.7g}", is), fmt::format("{:.2g}", sigma)});
  };
  add("fx [px]", before.fx_px, camera.fx_px, sigmas.fx_px);
  add("fy [px]", before.fy_px, camera.fy_px, sigmas.fy_px);
  add("cx [px]", before.cx_px, camera.cx_px, sigmas.cx_px);
  add("cy [px]", before.cy_px, camera.cy_px, sigmas.cy_px);
  constexpr std::array names{"k1", "k2", "p1", "p2", "k3"};
  for (std::size_t i = 0; i < names.size(); ++i)
    add(names[i], before.distortion[i], camera.distortion[i], sigmas.distortion[i]);
  add("magnification of blue", before.chromatic_aberration.blue, camera.chromatic_aberration.blue, sigmas.blue);
  add("magnification of red", before.chromatic_aberration.red, camera.chromatic_aberration.red, sigmas.red);
  return table;
}

Table views_table(const std::vector<BoardView>& views, const CameraCalibration& calibration) {
  Table table{"Views", {"", "corners", "edges' rms [px]"}, {}};
  for (std::size_t i = 0; i < views.size(); ++i)
    table.rows.push_back(
        {views[i].name, fmt::format("{}", views[i].corners.size()), fmt::format("{:.3f}", calibration.view_rms_px[i])});
  return table;
}

}  // namespace

void write_camera_report(const std::filesystem::path& path, const Camera& before, const std::vector<BoardView>& views,
                         const CameraCalibration& calibration) {
  const cv::Size size = views.front().bgr.size();
  ReportSection section;
  section.id = "camera";
  section.title = "The camera";
  section.text = {fmt::format("{} views of the board. Edges between squares miss the fit by {:.3f} px rms.",
                              views.size(), calibration.rms_px)};
  if (const std::string more = advice(views, size); !more.empty())
    section.text.push_back("Better still: " + more + ".");
  section.figures = {
      {coverage_picture(views, size), "Where corners were seen; the numbers count views in each part of the picture."},
      {residual_plot(calibration), "Green edges, over their distance from the principal point."},
      {response_plot(before.response, calibration), "How values encode light."}};
  section.tables = {numbers_table(before, calibration), views_table(views, calibration)};
  if (calibration.response) {
    const ResponseFit& response = *calibration.response;
    section.notes.push_back(
        fmt::format("The response was seen from values of {:.0f} to {:.0f} of 255, with one sigma of "
                    "{:.4f} of the full value there; beyond, it is as cameras' curves usually go on.",
                    255 * response.low, 255 * response.high, response.sigma));
    if (response.sharpening > 0)
      section.notes.push_back(
          fmt::format("The pictures are sharpened: by {:.2f} over {:.1f} px. Switch it off where the "
                      "camera can.",
                      response.sharpening, response.sharpening_px));
  } else {
    section.notes.push_back("The response is as it was: these pictures don't tell it.");
  }
  Report report;
  report.title = "lapservo calibrate camera";
  report.sections = {section};
  write_report(path, report);
}

}  // namespace lapservo::app
