#include "lapservo/vision/edges/edge_measurements.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>

#include "lapservo/core/angles.h"
#include "lapservo/core/statistics.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"
#include "lapservo/vision/edges/edge_lines.h"

namespace lapservo::internal {
namespace {

constexpr int max_lines = EdgeMeasurements::max_lines, stations = EdgeMeasurements::max_stations;

// A direction around the shaft, in the unrolled frame and in the camera's, and where its line begins.
struct Generatrix {
  double azimuth_rad;
  Eigen::Vector3d outwards_unrolled, outwards, around, begin;
};

constexpr double aside_rad = 0.05;
using Neighbourhood = std::array<Generatrix, 3>;  // a generatrix between those as far aside of it on either side

struct Frame {
  const Scene& scene;
  const LightImage& light;
  const PoseUnknowns& unknowns;
  double film_m;
  CylinderView view;
  // Axes of the unrolled frame, in the camera; and the camera in that frame [m].
  Eigen::Matrix3d axes = unknowns.pose().camera_from_unrolled.rotation.toRotationMatrix();
  Eigen::Vector3d camera_in_unrolled = -axes.transpose() * unknowns.pose().camera_from_unrolled.translation;
  RowMotion motion = scene.motion_at(unknowns);

  const Marker& marker() const { return scene.marker; }
  Generatrix generatrix(double azimuth_rad) const {
    return generatrix(azimuth_rad, std::cos(azimuth_rad), std::sin(azimuth_rad));
  }
  Generatrix generatrix(double azimuth_rad, double cosine, double sine) const {
    const Eigen::Vector3d outwards = cosine * axes.col(0) + sine * axes.col(1);
    return {azimuth_rad,
            {cosine, sine, 0},
            outwards,
            cosine * axes.col(1) - sine * axes.col(0),
            unknowns.pose().camera_from_unrolled.translation + marker().radius_m() * outwards};
  }
  Neighbourhood neighbourhood(double azimuth_rad) const {
    static const double cosine = std::cos(aside_rad), sine = std::sin(aside_rad);
    const double x = std::cos(azimuth_rad), y = std::sin(azimuth_rad);
    const auto turned = [&](double way) {
      return generatrix(azimuth_rad + way * aside_rad, cosine * x - way * sine * y, cosine * y + way * sine * x);
    };
    return {turned(-1), generatrix(azimuth_rad, x, y), turned(1)};
  }
  Eigen::Vector3d point(const Generatrix& line, double along_m) const { return line.begin + along_m * axes.col(2); }
  Eigen::Vector3d to_camera_from(const Generatrix& line, double along_m) const {
    return camera_in_unrolled - marker().radius_m() * line.outwards_unrolled - Eigen::Vector3d(0, 0, along_m);
  }
  Facing facing(std::size_t k, const Generatrix& line, double along_m) const {
    const Eigen::Vector3d to_camera = to_camera_from(line, along_m);
    const double beyond_m = k == 0 ? -to_camera.z() : k == 3 ? to_camera.z() : 0, per_m = 1 / to_camera.norm();
    return {line.outwards_unrolled.dot(to_camera) * per_m, std::max(0.0, beyond_m * per_m)};
  }
  double diffuse_light(const Generatrix& line, double along_m) const {
    const Eigen::Vector3d to_camera = to_camera_from(line, along_m);
    const double ambient = edge_limits.blurred_ambient_fraction;
    return ambient + (1 - ambient) * std::max(0.0, line.outwards_unrolled.dot(to_camera) / to_camera.norm());
  }
  double tau(double azimuth_rad) const { return marker_azimuth_rad(marker(), azimuth_rad, unknowns.pose().psi_rad); }

  // The line through the image of a point of a generatrix, when all of it can be sampled and no other instrument lies
  // before its ends or its middle.
  std::optional<EdgeLine> edge_line(const Generatrix& generatrix, double along_m, const Eigen::Vector2d& centre_px,
                                    const Eigen::Vector2d& direction, int before, int after, double blur_px) const {
    if (!light.contains(centre_px - before * direction) || !light.contains(centre_px + after * direction))
      return std::nullopt;
    EdgeLine line;
    line.u_px = static_cast<float>(centre_px.x()), line.v_px = static_cast<float>(centre_px.y());
    line.du = static_cast<float>(direction.x()), line.dv = static_cast<float>(direction.y());
    line.before = before, line.after = after;
    line.blur_px = static_cast<float>(blur_px);
    if (scene.others.empty()) return line;
    for (const int at : {0, -before, after}) {
      const auto ideal_px = scene.camera.ideal_from_raw(centre_px + at * direction);
      if (ideal_px && scene.hidden(point(generatrix, along_m).z() * scene.camera.ray_from_ideal(*ideal_px)))
        return std::nullopt;
    }
    return line;
  }
};

// The course of a boundary in the image, in the directions of `along`, by how it goes on around the shaft on either
// side, `depth_m` below the outside. The light is the camera's, diffuse: so the ends' films are seen, too.
BoundaryCourse course_of(const Frame& frame, const Neighbourhood& generatrices, double along_m, double slope_m,
                         double depth_m, const Eigen::Vector2d& point_px, const Eigen::Vector2d& along) {
  const Eigen::Vector2d across(-along.y(), along.x());
  std::array<Eigen::Vector2d, 2> places_px;
  std::array<double, 2> light;
  for (std::size_t i = 0; i < 2; ++i) {
    const Generatrix& aside = generatrices[2 * i];
    const double there_m = along_m + (i == 0 ? -aside_rad : aside_rad) * slope_m;
    const Eigen::Vector2d from_px =
        frame.scene.camera.raw_from_point(frame.point(aside, there_m) - depth_m * aside.outwards) - point_px;
    places_px[i] = {from_px.dot(along), from_px.dot(across)};
    light[i] = frame.diffuse_light(aside, there_m);
  }
  const Eigen::Vector2d &a = places_px[0], &b = places_px[1];
  const double slope_a = a.x() / a.y(), slope_b = b.x() / b.y(), apart_px = b.y() - a.y();
  const double curvature_per_px = 2 * (slope_b - slope_a) / apart_px;
  return {.slope = slope_a - 0.5 * curvature_per_px * a.y(),
          .curvature_per_px = curvature_per_px,
          .light_change_per_px = 2 * (light[1] - light[0]) / (light[1] + light[0]) / apart_px};
}

// A boundary on a generatrix, where it is expected; all of the measurement but residual and sigma.
struct BoundaryPlace {
  Measurement measurement;
  Eigen::Vector2d point_px, along;
  Eigen::Vector2d normal;  // of the boundary, its parts along the shaft and across it
  EdgeLine line;
  EdgeFit edge;  // once it is located
  Facing facing;
  double film_shift;         // by which fraction of its projected width the film's edge is expected to move it
  double film_px_per_m;      // that width by the film's thickness, along the normal
  double film_moved_px = 0;  // how far it moves it beyond what was expected, and one sigma of that
  double film_sigma_px = 0;
  double moved_by_blur_px;  // along the shaft

  bool shows_film() const { return facing.film_edge > 0; }
};

// Whether both sides have the colours that should be there. A blurred band tints the shaft beyond its end.
bool colours_agree(const Frame& frame, const BoundaryPlace& place) {
  const std::size_t k = place.measurement.group;
  const Eigen::Vector2d at_px = place.point_px + static_cast<double>(place.edge.offset_px) * place.along;
  const double on_band_px = 0.8 * place.line.before, on_shaft_px = on_band_px + 1.5 * place.line.blur_px;
  const std::uint8_t before = frame.scene.class_at(at_px - (k == 0 ? on_shaft_px : on_band_px) * place.along);
  const std::uint8_t after = frame.scene.class_at(at_px + (k == 3 ? on_shaft_px : on_band_px) * place.along);
  return before == (k == 0 ? 0 : frame.scene.bands[k - 1]) && after == (k == 3 ? 0 : frame.scene.bands[k]);
}

// Nullopt where it can't be looked for.
std::optional<BoundaryPlace> place_boundary(const Frame& frame, const Neighbourhood& generatrices, std::size_t k,
                                            const std::array<double, 4>& along_m, double slope_m, const Effort& effort,
                                            const BlurEllipse& blur) {
  BoundaryPlace place{};
  const Generatrix& generatrix = generatrices[1];
  place.facing = frame.facing(k, generatrix, along_m[k]);
  place.film_shift = place.shows_film() ? usual_film_edge_level(place.facing) : 0;
  const double depth_m = place.film_shift * frame.film_m;
  const Eigen::Vector3d point = frame.point(generatrix, along_m[k]) - depth_m * generatrix.outwards;
  if (!frame.scene.field.contains(point)) return std::nullopt;
  const ProjectionWithJacobian image = frame.scene.camera.raw_with_jacobian(point);
  const Eigen::Vector2d axis_px = image.d_px_d_point * frame.axes.col(2);
  const double px_per_m = axis_px.norm();
  place.along = axis_px / px_per_m;
  const Eigen::Vector2d tangent =
      (frame.marker().radius_m() * (image.d_px_d_point * generatrix.around) + slope_m * axis_px).normalized();
  const Eigen::Vector2d normal(-tangent.y(), tangent.x());
  place.normal = {normal.dot(place.along), normal.dot(Eigen::Vector2d(-place.along.y(), place.along.x()))};
  const double cosine = std::abs(place.normal.x());
  if (!(cosine > edge_limits.min_normal_cosine)) return std::nullopt;
  place.moved_by_blur_px =
      moved_by_blur_px(course_of(frame, generatrices, along_m[k], slope_m, depth_m, image.point_px, place.along), blur);
  if (!std::isfinite(place.moved_by_blur_px)) return std::nullopt;  // seen along the axis

  const double before_m = k > 0 ? along_m[k] - along_m[k - 1] : HUGE_VAL;
  const double after_m = k < 3 ? along_m[k + 1] - along_m[k] : HUGE_VAL;
  const double own_px = 0.6 * (std::min(before_m, after_m) * px_per_m);  // where it shows alone
  const double blur_px = blur.along_normal_px(place.normal), line_blur_px = blur_px / cosine;
  const int reach = static_cast<int>(std::min(
      {edge_limits.blur_reach * line_blur_px + effort.extra_px, own_px - line_blur_px, double{EdgeLine::max_reach}}));
  if (reach < 3) return std::nullopt;
  const Eigen::Vector3d pull = image.d_px_d_point.transpose() * normal;
  place.film_px_per_m = -pull.dot(generatrix.outwards);
  place.measurement.along_px_per_m = pull.dot(frame.axes.col(2));
  place.measurement.row = frame.unknowns.row(point, pull);
  place.measurement.row[psi_unknown] = -slope_m * place.measurement.along_px_per_m;
  place.point_px = image.point_px + frame.motion.shift_px(place.measurement.row, image.point_px, normal) * normal;
  const auto line = frame.edge_line(generatrix, along_m[k], place.point_px, place.along, reach, reach, line_blur_px);
  if (!line) return std::nullopt;
  place.line = *line;
  place.measurement.row[film_unknown] = place.film_shift * film_sigma_m * place.film_px_per_m;
  place.measurement.group = k;
  place.measurement.turn_fraction = wrap_two_pi(frame.tau(generatrix.azimuth_rad)) / frame.marker().covered_rad();
  place.measurement.expected_px = place.point_px.cast<float>();
  place.measurement.normal = normal.cast<float>();
  place.measurement.clear_px = static_cast<float>(own_px * cosine - blur_px);
  return place;
}

float dot(const std::array<float, 3>& a, const std::array<float, 3>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// The sum of the steps at a boundary, and the points that were located there; of an end, that show the film.
struct LocatedSteps {
  std::array<float, 3> sum{};
  InplaceVector<BoundaryPlace*, max_lines> points;

  LocatedSteps(std::size_t k, std::span<BoundaryPlace> places) {
    for (BoundaryPlace& place : places) {
      if (place.measurement.group != k || !place.edge.converged) continue;
      if ((k == 0 || k == 3) && !place.shows_film()) continue;
      points.push_back(&place);
      for (std::size_t c = 0; c < 3; ++c) sum[c] += place.edge.step[c];
    }
  }
};

double even_light_in(std::span<BoundaryPlace> places) {
  InplaceVector<EvenLight, 2> seen;
  for (const std::size_t k : {1U, 2U}) {
    const LocatedSteps steps(k, places);
    InplaceVector<FadingPoint, max_lines> points;
    for (std::size_t i = 0; i < steps.points.size(); i += 2)  // half of them suffice
      points.push_back({steps.points[i]->facing.outside, dot(steps.points[i]->edge.step, steps.sum)});
    seen.push_back(even_light_of(points));
  }
  return usual_or_seen(seen);
}

// Measures from the located points of an end how far the film's edge, where it shows, moves them.
void see_film(const Frame& frame, std::size_t k, double even_light, const EdgeBlur& blur,
              std::span<BoundaryPlace> places) {
  const LocatedSteps steps(k, places);
  if (steps.points.size() < edge_limits.min_alike) return;
  InplaceVector<EndPoint, max_lines> points;
  for (const BoundaryPlace* place : steps.points) {
    const Eigen::Map<const Eigen::Vector3f> before(place->edge.before.data()), step(place->edge.step.data());
    points.emplace_back().colwise() = before;
    points[points.size() - 1].col(k == 0 ? 1 : 0) += step;
  }
  const EndLight light(points);
  for (std::size_t i = 0; i < points.size(); ++i) {
    BoundaryPlace& place = *steps.points[i];
    const double facing = film_edge_light(place.facing, even_light), matt = light.matt_level(facing);
    const double width_px = frame.film_m * place.film_px_per_m, blur_px = blur.along_px[k];
    const double width_blurs = std::abs(width_px) / blur_px;
    const FilmShift shift = film_shift(matt - light.gloss_level(i), width_blurs);
    const double shift_px = shift.fraction * width_px;
    Measurement& m = place.measurement;
    for (std::size_t c = 0; c < 3; ++c)
      m.channel_px[c] =
          static_cast<float>(film_shift(light.level(facing, i, c), width_blurs).fraction * width_px - shift_px);
    m.row[film_unknown] += (shift.by_width - place.film_shift) * film_sigma_m * place.film_px_per_m;
    place.film_moved_px = shift_px - place.film_shift * width_px;
    // The correction for specular light is no better known.
    const double doubted_px = std::max(std::abs(shift_px), std::abs(matt * width_px));
    place.film_sigma_px = edge_limits.film_doubt * doubted_px * doubted_px / blur_px;
    m.expected_px += static_cast<float>(place.film_moved_px) * m.normal;
  }
}

// Keeps the points of one boundary whose change of light is what most see where the colours agree; gives each its sigma
// from the noise that the lines show.
void trust(const Frame& frame, std::size_t k, std::span<const BoundaryPlace> places, const EdgeBlur& blur,
           EdgeMeasurements& out) {
  InplaceVector<const BoundaryPlace*, max_lines> located;
  InplaceVector<const EdgeFit*, max_lines> agreeing;
  for (const BoundaryPlace& place : places) {
    if (place.measurement.group != k || !place.edge.converged) continue;
    located.push_back(&place);
    if (colours_agree(frame, place)) agreeing.push_back(&place.edge);
  }
  if (agreeing.size() < edge_limits.min_alike) return;
  const auto median_of = [&](const auto& value_of) {
    InplaceVector<float, max_lines> values;
    for (const EdgeFit* edge : agreeing) values.push_back(value_of(*edge));
    return median(values);
  };
  std::array<float, 3> typical;
  for (std::size_t c = 0; c < 3; ++c) typical[c] = median_of([c](const EdgeFit& edge) { return edge.step[c]; });
  const double typical_variance = median_of([](const EdgeFit& edge) { return edge.residual_variance; });
  const float typical_square = dot(typical, typical);
  for (const BoundaryPlace* place : located) {
    const EdgeFit& edge = place->edge;
    const float projection = dot(edge.step, typical), square = dot(edge.step, edge.step);
    const bool alike = projection > edge_limits.min_step * typical_square &&
                       projection * projection > edge_limits.least_alike * square * typical_square;
    const int max_variances = edge_limits.max_residual_sigmas * edge_limits.max_residual_sigmas;
    if (!alike || edge.residual_variance > edge_limits.max_residual * square + max_variances * typical_variance)
      continue;
    const double variance = 0.5 * (edge.residual_variance + typical_variance) * edge_limits.interpolation_noise;
    const double cosine = place->normal.x();
    Measurement& measurement = out.all.emplace_back() = place->measurement;
    const double moved_px = place->moved_by_blur_px * cosine;
    measurement.expected_px += static_cast<float>(moved_px) * measurement.normal;
    measurement.residual_px = edge.offset_px * cosine - moved_px - place->film_moved_px;
    out.ellipse.add(edge, variance, blur, k, place->normal);
    measurement.sigma_px = std::sqrt(variance / edge.information * cosine * cosine +
                                     edge_limits.single_floor_px * edge_limits.single_floor_px +
                                     place->film_sigma_px * place->film_sigma_px);
  }
}

void measure_boundaries(const Frame& frame, const Effort& effort, const EdgeBlur& blur, EdgeMeasurements& out) {
  const double radius_px = frame.marker().radius_m() / frame.view.camera_to_axis_m * frame.scene.camera.fx_px;
  out.radius_px = radius_px;
  out.lines = std::max(edge_limits.min_lines, std::min(static_cast<int>(1.2 * radius_px), max_lines) / effort.thinning);
  const auto slopes_m = boundary_slopes_m(frame.marker());
  std::array<bool, 4> jumps{};
  std::array<BlurEllipse, 4> ellipses;
  for (std::size_t k = 0; k < 4; ++k) jumps[k] = jumps_at_seam(frame.marker(), k), ellipses[k] = blur.ellipse(k);
  // Blur mixes what lies beside the shaft into what is near its sides.
  const double sine_of_half = std::sin(frame.view.half_visible_rad),
               reach = std::clamp(1 - edge_limits.blur_reach * blur.sides_px / radius_px, edge_limits.least_line_reach,
                                  edge_limits.line_reach);
  InplaceVector<BoundaryPlace, 4 * max_lines> places;
  InplaceVector<EdgeLine, 4 * max_lines> lines;
  for (int i = 0; i < out.lines; ++i) {
    const double sine = reach * (2.0 * (i + 0.5) / out.lines - 1) * sine_of_half;
    const Neighbourhood generatrices = frame.neighbourhood(frame.view.facing_azimuth_rad + std::asin(sine));
    const double tau_rad = frame.tau(generatrices[1].azimuth_rad);
    const auto along_m = boundaries_m(frame.marker(), tau_rad);
    const double seam_px = distance_to_seam_rad(frame.marker(), tau_rad) * radius_px * std::sqrt(1 - sine * sine);
    for (std::size_t k = 0; k < 4; ++k) {
      if (jumps[k] && seam_px < edge_limits.blur_reach * blur.along_px[k] + edge_limits.seam_px) continue;
      auto place = place_boundary(frame, generatrices, k, along_m, slopes_m[k], effort, ellipses[k]);
      if (!place) continue;
      ++out.in_image[k];
      place->measurement.across = sine / sine_of_half;
      places.push_back(*place), lines.push_back(place->line);
    }
  }
  const EdgeFits edges = locate_edges(frame.light, lines, effort.iterations);
  for (std::size_t i = 0; i < places.size(); ++i) places[i].edge = edges[i];
  if (effort.thinning == 1) {
    const double even_light = even_light_in(places);
    for (const std::size_t end : {0U, 3U}) see_film(frame, end, even_light, blur, places);
  }
  for (std::size_t k = 0; k < 4; ++k) trust(frame, k, places, blur, out);
}

// Whether one band fills the section between two azimuths at a place, with some room.
bool one_band(const Frame& frame, double azimuth_a_rad, double azimuth_b_rad, double along_m, double room_m) {
  const double tau_a = wrap_two_pi(frame.tau(azimuth_a_rad)), tau_b = wrap_two_pi(frame.tau(azimuth_b_rad));
  if (std::abs(tau_a - tau_b) > pi) return false;  // the seam lies between
  if (!is_printed(frame.marker(), tau_a) || !is_printed(frame.marker(), tau_b)) return false;
  const auto a = boundaries_m(frame.marker(), tau_a), b = boundaries_m(frame.marker(), tau_b);
  const auto band = [](const std::array<double, 4>& e, double x) {
    return std::upper_bound(e.begin(), e.end(), x) - e.begin();
  };
  const auto first = band(a, along_m - room_m);
  return first >= 1 && first <= 3 && first == band(a, along_m + room_m) && first == band(b, along_m - room_m) &&
         first == band(b, along_m + room_m);
}

// One of the shaft's sides, and a generatrix as deep inside as the occluding contour's model holds.
struct Side {
  static constexpr double deep_rad = 0.87;  // where d = R (1 - cos 0.87) = 0.35 R
  Generatrix contour, deep;
  std::size_t group;

  Side(const Frame& frame, double sign)
      : contour(frame.generatrix(frame.view.facing_azimuth_rad + sign * frame.view.half_visible_rad)),
        deep(frame.generatrix(contour.azimuth_rad - sign * deep_rad)),
        group(sign < 0 ? 4 : 5) {}
};

// A point of a side where it is expected, and the line to look along for it.
struct SidePlace {
  Measurement measurement;
  EdgeLine line;
};

// Nullopt where it can't be looked for.
std::optional<SidePlace> place_side(const Frame& frame, const Side& side, double along_m, const Effort& effort,
                                    double blur_px) {
  const Eigen::Vector3d point = frame.point(side.contour, along_m);
  if (!frame.scene.field.contains(point)) return std::nullopt;
  const ProjectionWithJacobian image = frame.scene.camera.raw_with_jacobian(point);
  const Eigen::Vector2d along = (image.d_px_d_point * frame.axes.col(2)).normalized();
  Eigen::Vector2d inwards(-along.y(), along.x());
  if (inwards.dot(frame.scene.camera.raw_from_point(frame.point(side.deep, along_m)) - image.point_px) < 0)
    inwards = -inwards;
  const double radius_px = frame.marker().radius_m() / point.norm() * frame.scene.camera.fx_px;
  // Into the shaft, and out of it: by the blur and, where the side's place is not known to a fraction of it, some more.
  const double reach_px = edge_limits.blur_reach * blur_px;
  const int inside = static_cast<int>(std::min(0.34 * radius_px, 26.0)),
            outside = static_cast<int>(std::min(reach_px + effort.extra_of_sides_px, 14.0));
  if (inside < 3) return std::nullopt;
  const double room_m = reach_px * frame.marker().length_m() / 200;
  if (!one_band(frame, side.contour.azimuth_rad, side.deep.azimuth_rad, along_m, room_m)) return std::nullopt;
  Measurement measurement{};
  measurement.row = frame.unknowns.row(point, image.d_px_d_point.transpose() * inwards);
  const Eigen::Vector2d shown_px =
      image.point_px + frame.motion.shift_px(measurement.row, image.point_px, inwards) * inwards;
  auto line = frame.edge_line(side.contour, along_m, shown_px, inwards, outside, inside, blur_px);
  if (!line) return std::nullopt;
  line->contour_radius_px = static_cast<float>(radius_px);
  measurement.group = side.group;
  measurement.expected_px = shown_px.cast<float>();
  measurement.normal = inwards.cast<float>();
  return SidePlace{measurement, *line};
}

void measure_sides(const Frame& frame, const Effort& effort, double blur_px, EdgeMeasurements& out) {
  const int count = stations / effort.thinning;
  const std::array<Side, 2> sides{Side(frame, -1), Side(frame, 1)};
  InplaceVector<Measurement, 2 * stations> places;
  InplaceVector<EdgeLine, 2 * stations> lines;
  for (int station = 0; station < count; ++station)
    for (const Side& side : sides) {
      const double along_m = frame.marker().length_m() * (station + 0.5) / count;
      if (const auto place = place_side(frame, side, along_m, effort, blur_px))
        places.push_back(place->measurement), lines.push_back(place->line);
    }
  out.sides_in_image = static_cast<int>(places.size());
  const EdgeFits edges = locate_edges(frame.light, lines, effort.iterations);
  InplaceVector<float, 2 * stations> variances;
  for (const EdgeFit& edge : edges)
    if (edge.converged) variances.push_back(edge.residual_variance);
  if (variances.size() < edge_limits.min_side_edges) return;
  const double typical_variance = median(variances);
  for (std::size_t i = 0; i < places.size(); ++i) {
    const EdgeFit& edge = edges[i];
    if (!edge.converged) continue;
    const double variance = 0.5 * (edge.residual_variance + typical_variance) * edge_limits.interpolation_noise;
    const double sigma_px =
        std::sqrt(variance / edge.information + edge_limits.side_floor_px * edge_limits.side_floor_px);
    if (sigma_px > edge_limits.max_side_sigma_px) continue;
    Measurement& measurement = out.all.emplace_back() = places[i];
    measurement.residual_px = edge.offset_px;
    measurement.sigma_px = sigma_px;
    out.side_blur.add(edge, variance);
  }
}

}  // namespace

EdgeMeasurements measure_edges(const Scene& scene, const LightImage& light, const PoseUnknowns& unknowns, double film_m,
                               const Effort& effort, const EdgeBlur& blur) {
  EdgeMeasurements out;
  const auto view = view_cylinder(unknowns.pose().camera_from_unrolled, scene.marker.radius_m());
  if (!view) return out;
  const Frame frame{scene, light, unknowns, film_m, *view};
  measure_boundaries(frame, effort, blur, out);
  measure_sides(frame, effort, blur.sides_px, out);
  return out;
}

}  // namespace lapservo::internal
