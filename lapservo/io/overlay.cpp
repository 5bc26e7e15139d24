#include "lapservo/io/overlay.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/kinematics/features.h"
#include "lapservo/marker/azimuths.h"

namespace lapservo {
using namespace internal;
namespace {

const cv::Scalar white(255, 255, 255), dark(20, 20, 20), outline_colour(255, 255, 255), boundary_colour(40, 220, 255),
    axis_colour(80, 80, 255), rcm_colour(255, 200, 80), refused_colour(60, 140, 255), tip_colour(120, 255, 120);
constexpr double line_height = 30;  // of labels

// Draws at a sixteenth of a pixel, thinner on small frames.
class Pen {
 public:
  explicit Pen(cv::Mat& canvas) : canvas_(canvas), scale_(std::max(1.0, canvas.cols / 1280.0)) {}

  void polyline(const std::vector<Eigen::Vector2d>& points, const cv::Scalar& colour, double width = 1.4) {
    std::vector<cv::Point> fixed;
    for (const Eigen::Vector2d& p : points) fixed.push_back(at(p));
    cv::polylines(canvas_, fixed, false, dark, thickness(width) + 2, cv::LINE_AA, bits);
    cv::polylines(canvas_, fixed, false, colour, thickness(width), cv::LINE_AA, bits);
  }
  void dashes(const std::vector<Eigen::Vector2d>& points, const cv::Scalar& colour) {
    const double dash_px = 7 * scale_;
    double along_px = 0;
    for (std::size_t i = 1; i < points.size(); ++i) {
      const Eigen::Vector2d step = points[i] - points[i - 1];
      const int parts = static_cast<int>(std::clamp<double>(step.norm() / dash_px * 4, 1, max_parts));
      for (int part = 0; part < parts; ++part) {
        if (std::fmod(along_px, 2 * dash_px) < dash_px)
          polyline({points[i - 1] + step * part / parts, points[i - 1] + step * (part + 1) / parts}, colour);
        along_px += step.norm() / parts;
      }
    }
  }
  void cross(const Eigen::Vector2d& p, const cv::Scalar& colour) {
    const double arm = 6 * scale_;
    polyline({p - Eigen::Vector2d(arm, arm), p + Eigen::Vector2d(arm, arm)}, colour);
    polyline({p - Eigen::Vector2d(arm, -arm), p + Eigen::Vector2d(arm, -arm)}, colour);
  }
  void dot(const Eigen::Vector2d& p, const cv::Scalar& colour) {
    const int radius = static_cast<int>(3.5 * scale_ * (1 << bits));
    cv::circle(canvas_, at(p), radius, dark, cv::FILLED, cv::LINE_AA, bits);
    cv::circle(canvas_, at(p), radius * 5 / 8, colour, cv::FILLED, cv::LINE_AA, bits);
  }
  void arrow(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const cv::Scalar& colour) {
    const Eigen::Vector2d along = (to - from).normalized(), across(-along.y(), along.x());
    polyline({from, to}, colour, 2);
    polyline({to - 12 * scale_ * along + 6 * scale_ * across, to, to - 12 * scale_ * along - 6 * scale_ * across},
             colour, 2);
  }
  // The size of a label's text, without its background.
  cv::Size text_size(const std::string& text) const {
    int baseline = 0;
    return cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, font_scale(), thickness(1), &baseline);
  }
  // Keeps the label inside the image. `near`: where the text begins, on its baseline.
  void label(const std::string& text, const Eigen::Vector2d& near) {
    const double font_scale = this->font_scale();
    const int weight = thickness(1);
    int baseline = 0;
    const cv::Size size = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, font_scale, weight, &baseline);
    const int pad = this->pad();
    const int right = std::max(pad, canvas_.cols - size.width - pad), top = size.height + pad;
    const int x = static_cast<int>(std::clamp<double>(near.x(), pad, right));
    const int y = static_cast<int>(std::clamp<double>(near.y(), top, std::max(top, canvas_.rows - baseline - pad)));
    const cv::Rect box =
        cv::Rect(x - pad, y - size.height - pad, size.width + 2 * pad, size.height + baseline + 2 * pad) &
        cv::Rect(0, 0, canvas_.cols, canvas_.rows);
    cv::Mat backing = canvas_(box);
    backing.convertTo(backing, -1, 0.35);
    cv::putText(canvas_, text, {x, y}, cv::FONT_HERSHEY_SIMPLEX, font_scale, white, weight, cv::LINE_AA);
  }
  double scale() const { return scale_; }
  int pad() const { return static_cast<int>(5 * scale_); }  // around a label's text
  cv::Size size() const { return canvas_.size(); }

 private:
  double font_scale() const { return 0.55 * scale_; }
  static constexpr int bits = 4, max_parts = 2000;
  cv::Point at(const Eigen::Vector2d& p) const {
    const auto fixed = [](double x) { return static_cast<int>(std::lround(std::clamp(x, -2e4, 2e4) * (1 << bits))); };
    return {fixed(p.x()), fixed(p.y())};
  }
  int thickness(double width) const { return std::max(1, static_cast<int>(std::lround(width * scale_))); }

  cv::Mat& canvas_;
  double scale_;
};

enum class Style { found, refused };

// The marker where a pose has it: the shaft's sides and the boundaries over the visible surface.
class DrawnMarker {
 public:
  DrawnMarker(const Camera& camera, const Marker& marker, const Rigid3& camera_from_unrolled, double psi_rad)
      : camera_(camera),
        marker_(marker),
        camera_from_unrolled_(camera_from_unrolled),
        psi_rad_(psi_rad),
        view_(view_cylinder(camera_from_unrolled, marker.radius_m())) {}

  bool visible() const { return view_.has_value(); }
  /// `across` runs over the visible surface from -1, one side, to 1, the other.
  Eigen::Vector2d at(double across, double along_m) const {
    return camera_.raw_from_point(camera_from_unrolled_ *
                                  surface_point(marker_.radius_m(), azimuth_rad(across), along_m));
  }
  void draw(Pen& pen, Style style) const {
    draw_sides(pen, style);
    for (std::size_t k = 0; k < 4; ++k) draw_boundary(pen, k, style);
  }

 private:
  static constexpr int steps = 48;
  void draw_sides(Pen& pen, Style style) const {
    for (const double side : {-1.0, 1.0}) {
      std::vector<Eigen::Vector2d> line;
      for (int i = 0; i <= steps; ++i) line.push_back(at(side, marker_.length_m() * (-0.15 + 1.3 * i / steps)));
      stroke(pen, line, style, outline_colour);
    }
  }
  void draw_boundary(Pen& pen, std::size_t k, Style style) const {
    std::vector<Eigen::Vector2d> curve;
    double last_tau = -1;
    for (int i = 0; i <= steps; ++i) {
      const double across = 2.0 * i / steps - 1;
      const double tau = wrap_two_pi(marker_azimuth_rad(marker_, azimuth_rad(across), psi_rad_));
      if (last_tau >= 0 && std::abs(tau - last_tau) > pi) {  // the seam: boundaries jump there
        stroke(pen, curve, style, boundary_colour);
        curve.clear();
      }
      last_tau = tau;
      if (!is_printed(marker_, tau)) continue;
      curve.push_back(at(across, boundaries_m(marker_, tau)[k]));
    }
    stroke(pen, curve, style, boundary_colour);
  }
  double azimuth_rad(double across) const { return view_->facing_azimuth_rad + across * view_->half_visible_rad; }
  static void stroke(Pen& pen, const std::vector<Eigen::Vector2d>& line, Style style, const cv::Scalar& colour) {
    style == Style::found ? pen.polyline(line, colour) : pen.dashes(line, refused_colour);
  }

  const Camera& camera_;
  const Marker& marker_;
  Rigid3 camera_from_unrolled_;
  double psi_rad_;
  std::optional<CylinderView> view_;
};

bool shows(const Camera& camera, const Eigen::Vector2d& px) {
  return px.x() >= 0 && px.x() < camera.width_px && px.y() >= 0 && px.y() < camera.height_px;
}

// The RCM's image and r, when it lies in the image.
void draw_rcm(Pen& pen, const Camera& camera, const Instrument& instrument, const Observation& o) {
  if (!instrument.camera_from_rcm || !(instrument.camera_from_rcm->translation.z() > 0)) return;
  const auto ideal_px = projected_rcm_px(camera, *instrument.camera_from_rcm);
  if (!ideal_px) return;
  const Eigen::Vector2d px = camera.raw_from_ideal(*ideal_px);
  if (!shows(camera, px)) return;
  pen.dashes({px, o.edges_raw_px[0]}, rcm_colour);
  pen.cross(px, rcm_colour);
  pen.label("RCM", px + Eigen::Vector2d(12, -8) * pen.scale());
}

// A cross, and the ellipse that the tip's image is in with a probability of 95 %.
void draw_tip(Pen& pen, const Camera& camera, const Observation::Tip& tip) {
  const Eigen::Vector3d& point = tip.camera_from_tip.translation;
  if (!(point.z() > 0)) return;
  const Eigen::Vector2d px = camera.raw_from_point(point);
  if (!shows(camera, px)) return;
  const double step_m = 1e-4 * point.z(), chi = std::sqrt(5.991);  // of two degrees of freedom
  Eigen::Matrix<double, 2, 3> slopes;
  for (int i = 0; i < 3; ++i)
    slopes.col(i) = (camera.raw_from_point(point + step_m * Eigen::Vector3d::Unit(i)) - px) / step_m;
  const Eigen::Matrix2d rounding = 1e-12 * Eigen::Matrix2d::Identity();
  const Eigen::Matrix2d covariance_px2 = slopes * tip.covariance.topLeftCorner<3, 3>() * slopes.transpose() + rounding;
  const Eigen::Matrix2d root_px = covariance_px2.llt().matrixL();
  std::vector<Eigen::Vector2d> ellipse;
  constexpr int steps = 48;
  for (int i = 0; i <= steps; ++i)
    ellipse.push_back(px + chi * root_px * Eigen::Vector2d(std::cos(two_pi * i / steps), std::sin(two_pi * i / steps)));
  pen.polyline(ellipse, tip_colour);
  pen.cross(px, tip_colour);
  pen.label(fmt::format("tip +-{:.2g} mm", 1e3 * tip.sigma_m()), px + Eigen::Vector2d(12, -8) * pen.scale());
}

// So many decimals, and no minus zero.
std::string decimals(double value, int digits) {
  const std::string text = fmt::format("{:.{}f}", value, digits);
  return text.starts_with('-') && text.find_first_not_of("-0.") == std::string::npos ? text.substr(1) : text;
}

// Units as in files.
std::string rotation_text(const Observation& o) {
  return o.rcm ? fmt::format("psi {} +-{} rad", decimals(o.rcm->q.psi_rad, 4),
                             decimals(std::sqrt(o.rcm->covariance(3, 3)), 4))
               : fmt::format("tau {} +-{} rad", decimals(o.tau_rad, 4), decimals(o.sigma_tau_rad, 4));
}

std::string features_text(const Features& f) {
  const std::string r = f.r_px ? decimals(*f.r_px, 1) : "-";
  return fmt::format("s {} rad  r {}  l {}  d {} px", decimals(f.s_rad, 4), r, decimals(f.l_px, 1),
                     decimals(f.d_px, 1));
}

// Where two lines of text stand beside a shaft, as near to the marker's middle as it goes, on either side; in an image
// that is too small for that, on the side with more room. `along`: the axis, a unit vector; `half_px`: half the shaft's
// width.
Eigen::Vector2d place_beside(const Pen& pen, const std::array<std::string, 2>& lines, const Eigen::Vector2d& middle,
                             const Eigen::Vector2d& along, double half_px) {
  const cv::Size first = pen.text_size(lines[0]), second = pen.text_size(lines[1]);
  const double pad = pen.pad(), line_px = line_height * pen.scale();
  const Eigen::Vector2d half(std::max(first.width, second.width) / 2.0 + pad,
                             (first.height + line_px + second.height / 2.0) / 2 + pad);  // the last: below the baseline
  const Eigen::Vector2d across(-along.y(), along.x());
  const double clear_px = half_px + 8 * pen.scale() + across.cwiseAbs().dot(half);
  const Eigen::Vector2d corner(pen.size().width, pen.size().height);
  const auto is_inside = [&](const Eigen::Vector2d& centre) {
    return ((centre - half).array() >= 0).all() && ((centre + half).array() <= corner.array()).all();
  };
  const auto held_inside = [&](const Eigen::Vector2d& centre) -> Eigen::Vector2d {
    return centre.cwiseMin(corner - half).cwiseMax(half);
  };
  const auto from_axis_px = [&](const Eigen::Vector2d& centre) { return std::abs((centre - middle).dot(across)); };
  const Eigen::Vector2d left = held_inside(middle + clear_px * across), right = held_inside(middle - clear_px * across);
  Eigen::Vector2d best = middle + clear_px * across;
  const double step_px = 10 * pen.scale(), longest_px = corner.norm();
  for (double slid_px = 0; slid_px < longest_px && !is_inside(best); slid_px += step_px)
    for (const double side : {1.0, -1.0})
      for (const double way : {1.0, -1.0})
        if (const Eigen::Vector2d centre = middle + side * clear_px * across + way * slid_px * along;
            !is_inside(best) && is_inside(centre))
          best = centre;
  if (!is_inside(best)) best = from_axis_px(left) > from_axis_px(right) ? left : right;
  return best - half + Eigen::Vector2d(pad, pad + first.height);
}

void draw_found(Pen& pen, const Camera& camera, const Instrument& instrument, const Observation& o) {
  const DrawnMarker marker(camera, instrument.marker, o.camera_from_unrolled, o.psi_rad);
  if (!marker.visible()) return;
  marker.draw(pen, Style::found);
  draw_rcm(pen, camera, instrument, o);
  if (o.tip) draw_tip(pen, camera, *o.tip);
  const Eigen::Vector2d proximal = o.edges_raw_px[0], distal = o.edges_raw_px[3];
  pen.arrow(proximal, distal + 0.25 * (distal - proximal), axis_colour);
  for (const Eigen::Vector2d& edge : o.edges_raw_px) pen.dot(edge, boundary_colour);

  double half_px = 0;
  for (const double end_m : {0.0, instrument.marker.length_m()})
    half_px = std::max(half_px, (marker.at(1, end_m) - marker.at(-1, end_m)).norm() / 2);
  const std::array<std::string, 2> lines{instrument.name + "  " + rotation_text(o), features_text(o.features)};
  const Eigen::Vector2d place =
      place_beside(pen, lines, (proximal + distal) / 2, (distal - proximal).normalized(), half_px);
  for (int i = 0; i < 2; ++i) pen.label(lines[i], place + Eigen::Vector2d(0, i * line_height * pen.scale()));
}

// The rejected detection, in another style.
void draw_refused(Pen& pen, const Camera& camera, const Instrument& instrument, const Observation::Refused& refused) {
  using What = Observation::Refused::What;
  if (refused.what == What::pose) {
    const DrawnMarker marker(camera, instrument.marker, refused.camera_from_unrolled, refused.psi_rad);
    if (marker.visible()) marker.draw(pen, Style::refused);
  }
  if (refused.what == What::edges) {
    pen.dashes({refused.edges_raw_px.front(), refused.edges_raw_px.back()}, refused_colour);
    for (const Eigen::Vector2d& edge : refused.edges_raw_px) pen.cross(edge, refused_colour);
  }
}

}  // namespace

cv::Mat draw_overlay(const cv::Mat& bgr, const Rig& rig, const std::vector<Observation>& observations) {
  cv::Mat canvas = bgr.clone();
  Pen pen(canvas);
  double status_y = 26 * pen.scale();
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const Observation& o = observations[i];
    if (o.status == Status::ok) {
      draw_found(pen, rig.camera, rig.instruments[i], o);
      continue;
    }
    const bool seen = o.refused.what != Observation::Refused::What::nothing;
    if (seen) draw_refused(pen, rig.camera, rig.instruments[i], o.refused);
    pen.label(fmt::format("{}: {}{}", rig.instruments[i].name, to_string(o.status), seen ? " (dashed)" : ""),
              {12 * pen.scale(), status_y});
    status_y += line_height * pen.scale();
  }
  return canvas;
}

}  // namespace lapservo
