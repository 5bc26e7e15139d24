#include "lapservo/io/overlay.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/cylinder.h"

namespace lapservo {
namespace {

const cv::Scalar white(255, 255, 255), dark(20, 20, 20), outline_color(255, 255, 255), boundary_color(40, 220, 255),
    axis_color(80, 80, 255);

// Draws at a sixteenth of a pixel, thinner on small frames.
class Pen {
 public:
  explicit Pen(cv::Mat& canvas) : canvas_(canvas), scale_(std::max(1.0, canvas.cols / 1280.0)) {}

  void polyline(const std::vector<Eigen::Vector2d>& points, const cv::Scalar& color, double width = 1.4) {
    std::vector<cv::Point> fixed;
    for (const Eigen::Vector2d& p : points) fixed.push_back(at(p));
    cv::polylines(canvas_, fixed, false, dark, thickness(width) + 2, cv::LINE_AA, bits);
    cv::polylines(canvas_, fixed, false, color, thickness(width), cv::LINE_AA, bits);
  }
  void dot(const Eigen::Vector2d& p, const cv::Scalar& color) {
    const int radius = static_cast<int>(3.5 * scale_ * (1 << bits));
    cv::circle(canvas_, at(p), radius, dark, cv::FILLED, cv::LINE_AA, bits);
    cv::circle(canvas_, at(p), radius * 5 / 8, color, cv::FILLED, cv::LINE_AA, bits);
  }
  void arrow(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const cv::Scalar& color) {
    const Eigen::Vector2d along = (to - from).normalized(), across(-along.y(), along.x());
    polyline({from, to}, color, 2);
    polyline({to - 12 * scale_ * along + 6 * scale_ * across, to, to - 12 * scale_ * along - 6 * scale_ * across},
             color, 2);
  }
  // Keeps the label inside the picture.
  void label(const std::string& text, const Eigen::Vector2d& near) {
    const double font_scale = 0.55 * scale_;
    const int weight = thickness(1);
    int baseline = 0;
    const cv::Size size = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, font_scale, weight, &baseline);
    const int pad = static_cast<int>(5 * scale_);
    const int x = std::clamp(static_cast<int>(near.x()), pad, std::max(pad, canvas_.cols - size.width - pad));
    const int y = std::clamp(static_cast<int>(near.y()), size.height + pad,
                             std::max(size.height + pad, canvas_.rows - baseline - pad));
    const cv::Rect box =
        cv::Rect(x - pad, y - size.height - pad, size.width + 2 * pad, size.height + baseline + 2 * pad) &
        cv::Rect(0, 0, canvas_.cols, canvas_.rows);
    cv::Mat backing = canvas_(box);
    backing.convertTo(backing, -1, 0.35);
    cv::putText(canvas_, text, {x, y}, cv::FONT_HERSHEY_SIMPLEX, font_scale, white, weight, cv::LINE_AA);
  }
  double scale() const { return scale_; }

 private:
  static constexpr int bits = 4;
  cv::Point at(const Eigen::Vector2d& p) const {
    const auto fixed = [](double x) { return static_cast<int>(std::lround(std::clamp(x, -2e4, 2e4) * (1 << bits))); };
    return {fixed(p.x()), fixed(p.y())};
  }
  int thickness(double width) const { return std::max(1, static_cast<int>(std::lround(width * scale_))); }

  cv::Mat& canvas_;
  double scale_;
};

void draw_instrument(Pen& pen, const Camera& camera, const Instrument& instrument, const Observation& o) {
  const Marker& marker = instrument.marker;
  const auto view = view_cylinder(o.camera_from_unrolled, marker.radius_m());
  if (!view) return;
  const auto image = [&](double azimuth_rad, double along_m) {
    return camera.raw_from_point(o.camera_from_unrolled * surface_point(marker.radius_m(), azimuth_rad, along_m));
  };
  constexpr int steps = 48;
  const double length_m = marker.length_m();
  for (const double side : {-1.0, 1.0}) {
    std::vector<Eigen::Vector2d> line;
    for (int i = 0; i <= steps; ++i)
      line.push_back(
          image(view->facing_azimuth_rad + side * view->half_visible_rad, length_m * (-0.15 + 1.3 * i / steps)));
    pen.polyline(line, outline_color);
  }
  for (std::size_t k = 0; k < 4; ++k) {
    std::vector<Eigen::Vector2d> curve;
    double last_tau = -1;
    for (int i = 0; i <= steps; ++i) {
      const double azimuth_rad = view->facing_azimuth_rad + view->half_visible_rad * (2.0 * i / steps - 1);
      const double tau = wrap_two_pi(azimuth_rad - o.psi_rad - marker.seam_rad);
      if (last_tau >= 0 && std::abs(tau - last_tau) > pi) {  // the seam: boundaries jump there
        pen.polyline(curve, boundary_color);
        curve.clear();
      }
      last_tau = tau;
      curve.push_back(image(azimuth_rad, boundaries_m(marker, tau)[k]));
    }
    pen.polyline(curve, boundary_color);
  }
  const Eigen::Vector2d proximal = o.edges_raw_px[0], distal = o.edges_raw_px[3];
  pen.arrow(proximal, distal + 0.25 * (distal - proximal), axis_color);
  for (const Eigen::Vector2d& edge : o.edges_raw_px) pen.dot(edge, boundary_color);

  const std::string rotation =
      o.rcm ? fmt::format("psi {:+.1f} deg  +-{:.2f}", deg_from_rad(o.rcm->q.psi_rad),
                          deg_from_rad(std::sqrt(o.rcm->covariance(3, 3))))
            : fmt::format("tau {:.1f} deg  +-{:.2f}", deg_from_rad(o.tau_rad), deg_from_rad(o.sigma_tau_rad));
  const Eigen::Vector2d along = (distal - proximal).normalized();
  const double width_px = (image(view->facing_azimuth_rad + view->half_visible_rad, 0) - proximal).norm();
  const Eigen::Vector2d beside(std::abs(along.y()) * (width_px + 14 * pen.scale()),
                               std::abs(along.x()) * (width_px + 22 * pen.scale()));
  pen.label(instrument.name + "  " + rotation, (proximal + distal) / 2 + beside);
}

}  // namespace

cv::Mat draw_overlay(const cv::Mat& bgr, const Rig& rig, const std::vector<Observation>& observations) {
  cv::Mat canvas = bgr.clone();
  Pen pen(canvas);
  double status_y = 26 * pen.scale();
  for (std::size_t i = 0; i < observations.size(); ++i) {
    if (observations[i].status == Status::ok) {
      draw_instrument(pen, rig.camera, rig.instruments[i], observations[i]);
      continue;
    }
    pen.label(fmt::format("{}: {}", rig.instruments[i].name, status_word(observations[i].status)),
              {12 * pen.scale(), status_y});
    status_y += 30 * pen.scale();
  }
  return canvas;
}

}  // namespace lapservo
