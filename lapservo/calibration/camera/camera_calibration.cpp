#include "lapservo/calibration/camera/camera_calibration.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <opencv2/calib3d.hpp>

#include "lapservo/core/angles.h"
#include "lapservo/core/rounded_sigma.h"
#include "lapservo/core/statistics.h"
#include "lapservo/geometry/field_of_view.h"
#include "lapservo/geometry/rotation.h"

namespace lapservo::internal {
namespace {

constexpr std::size_t least_views = 4;
constexpr double least_tilt_rad = rad_from_deg(15);
// Worse than these, one sigma, and the views are too alike.
constexpr double max_focal_sigma = 0.003, max_centre_sigma_px = 5;
// A lens of this kind leaves less than this.
constexpr double max_rms_px = 0.2;
// Pixels are square, unless the views say otherwise by more than this.
constexpr double square_pixels = 5e-4, significant_sigmas = 3;

struct Points {
  std::vector<cv::Point3f> on_board;
  std::vector<cv::Point2f> in_picture;
};

Points points_of(const Board& board, const std::vector<BoardCorner>& corners) {
  Points points;
  for (const BoardCorner& corner : corners) {
    const Eigen::Vector3d m = board.corner_m(corner.column, corner.row);
    points.on_board.emplace_back(static_cast<float>(m.x()), static_cast<float>(m.y()), 0.0F);
    points.in_picture.emplace_back(static_cast<float>(corner.raw_px.x()), static_cast<float>(corner.raw_px.y()));
  }
  return points;
}

Rigid3 pose_of(const cv::Mat& rotation_vector, const cv::Mat& translation) {
  const auto vector_of = [](const cv::Mat& m) {
    return Eigen::Vector3d(m.at<double>(0), m.at<double>(1), m.at<double>(2));
  };
  return {rotation_by(vector_of(rotation_vector)), vector_of(translation)};
}

struct AllPoints {
  std::vector<std::vector<cv::Point3f>> on_board;  // by view
  std::vector<std::vector<cv::Point2f>> in_picture;

  AllPoints(const Board& board, const std::vector<BoardView>& views) {
    for (const BoardView& view : views) {
      Points points = points_of(board, view.corners);
      on_board.push_back(std::move(points.on_board)), in_picture.push_back(std::move(points.in_picture));
    }
  }
};

// A sentence where, by the corners alone, the lens sees more than plumb_bob serves and an equidistant one explains the
// views better; else empty.
std::string fisheye_text(const Board& board, const std::vector<BoardView>& views) {
  constexpr double least_field_deg = 100, clearly_less = 0.9;
  const AllPoints all(board, views);
  const cv::Size size = views.front().bgr.size();
  cv::Mat matrix, distortion, equidistant_matrix, equidistant_distortion;
  std::vector<cv::Mat> rotations, translations, other_rotations, other_translations;
  try {
    const double plumb_bob_px =
        cv::calibrateCamera(all.on_board, all.in_picture, size, matrix, distortion, rotations, translations);
    const double equidistant_px = cv::fisheye::calibrate(
        all.on_board, all.in_picture, size, equidistant_matrix, equidistant_distortion, other_rotations,
        other_translations, cv::fisheye::CALIB_RECOMPUTE_EXTRINSIC | cv::fisheye::CALIB_FIX_SKEW);
    const double field_deg = deg_from_rad(std::hypot(size.width, size.height) / equidistant_matrix.at<double>(0, 0));
    if (!(field_deg > least_field_deg) || !(equidistant_px < clearly_less * plumb_bob_px)) return {};
    return fmt::format(
        "the lens is a fisheye of some {:.0f} degrees: an equidistant one misses the corners by {:.2f} px rms, "
        "plumb_bob, the one distortion_model of lapservo, by {:.2f} px; take another lens or the middle {:.0f} degrees "
        "of the images (ffmpeg -vf crop)",
        field_deg, equidistant_px, plumb_bob_px, least_field_deg);
  } catch (const cv::Exception&) {  // of uninformative views
    return {};
  }
}

// By the corners alone, to start with: OpenCV's, without k3 and what else an adjustment finds.
std::optional<CameraAdjustment> first_fit(const Board& board, const std::vector<BoardView>& views,
                                          const Camera& start) {
  const AllPoints all(board, views);
  cv::Mat matrix, distortion;
  std::vector<cv::Mat> rotations, translations;
  CameraAdjustment fit;
  fit.camera = start;
  fit.camera.width_px = views.front().bgr.cols, fit.camera.height_px = views.front().bgr.rows;
  try {
    cv::calibrateCamera(all.on_board, all.in_picture, views.front().bgr.size(), matrix, distortion, rotations,
                        translations, cv::CALIB_FIX_K3);
  } catch (const cv::Exception&) {  // of uninformative views
    return std::nullopt;
  }
  fit.camera.fx_px = matrix.at<double>(0, 0), fit.camera.fy_px = matrix.at<double>(1, 1);
  fit.camera.cx_px = matrix.at<double>(0, 2), fit.camera.cy_px = matrix.at<double>(1, 2);
  for (int i = 0; i < 5; ++i) fit.camera.distortion[static_cast<std::size_t>(i)] = distortion.at<double>(i);
  for (std::size_t i = 0; i < views.size(); ++i) {
    fit.camera_from_board.push_back(pose_of(rotations[i], translations[i]));
    if (!fit.camera_from_board.back().translation.allFinite() || !(fit.camera_from_board.back().translation.z() > 0))
      return std::nullopt;
  }
  if (!std::isfinite(fit.camera.fx_px) || !(fit.camera.fx_px > 0) || !(fit.camera.fy_px > 0)) return std::nullopt;
  return fit;
}

void add_points(const EdgePixels& edge, const BoardEdgeFit& fit, int channel, std::vector<EdgePoint>& points) {
  const EdgePath& path = edge.path;
  for (const double side : {-1.0, 1.0}) {
    const double beyond = side * fit.spread_fraction, fraction = fit.mean_fraction + beyond;
    const double distance_px =
        4 * path.sag_px * fraction * (1 - fraction) + fit.offset_px + fit.slope * beyond * path.length_px;
    points.push_back({path.point_m(fraction),
                      path.from_px + fraction * path.length_px * path.along + distance_px * path.normal, path.normal,
                      std::sqrt(2.0) * fit.sigma_px, fit.towards_bright, channel});
  }
}

struct MeasuredEdges {
  std::vector<std::vector<EdgePoint>> points;  // by view
  std::vector<BoardEdgeProfile> profiles;
};

constexpr int green = 1;

MeasuredEdges measured(const Board& board, const std::vector<BoardView>& views, const CameraAdjustment& fit,
                       bool all_channels, bool with_profiles) {
  const LightTable light = fit.camera.response.table();
  MeasuredEdges result;
  for (std::size_t i = 0; i < views.size(); ++i) {
    auto& points = result.points.emplace_back();
    for (const EdgePixels& edge :
         edges_of(board, views[i].corners, fit.camera, fit.camera_from_board[i], views[i].bgr)) {
      for (int channel = 0; channel < 3; ++channel) {
        if (channel != green && !all_channels) continue;
        const auto edge_fit = fit_edge(edge, channel, light);
        if (!edge_fit) continue;
        add_points(edge, *edge_fit, channel, points);
        if (channel != green || !with_profiles) continue;
        if (auto profile = profile_of(edge, *edge_fit, channel, fit.camera.response))
          result.profiles.push_back(std::move(*profile));
      }
    }
  }
  return result;
}

// Unobservable parameters stay zero: k3, and pixels that are not square.
std::optional<CameraAdjustment> adjust_what_shows(const CameraAdjustment& fit, const MeasuredEdges& edges,
                                                  const AtIteration& at_iteration) {
  CameraFreedom freedom{.faults = false};
  const auto all = adjust_camera(fit.camera, fit.camera_from_board, edges.points, freedom, at_iteration);
  if (!all) return std::nullopt;
  const Camera& camera = all->camera;
  freedom.k3 = std::abs(camera.distortion[4]) > significant_sigmas * camera.sigmas.distortion[4];
  freedom.aspect =
      std::abs(camera.fy_px / camera.fx_px - 1) > std::max(square_pixels, significant_sigmas * all->sigma_aspect);
  freedom.faults = true;
  return adjust_camera(camera, all->camera_from_board, edges.points, freedom, at_iteration);
}

void add_residuals(const CameraAdjustment& adjustment, const MeasuredEdges& edges, CameraCalibration& calibration) {
  std::vector<double> all;
  for (std::size_t i = 0; i < edges.points.size(); ++i) {
    std::vector<double> of_view;
    for (std::size_t k = 0; k < edges.points[i].size(); ++k) {
      if (edges.points[i][k].channel != green) continue;
      const double residual_px = adjustment.residuals_px[i][k];
      of_view.push_back(residual_px), all.push_back(residual_px);
    }
    calibration.view_rms_px.push_back(of_view.empty() ? std::nullopt : std::optional(rms(of_view)));
  }
  calibration.rms_px = rms(all);
}

// Describes the faults of one kind, and the remedy; `where`: in which views.
std::string text_of(CameraFault::Kind kind, double size, const std::string& where) {
  switch (kind) {
    case CameraFault::Kind::zoom:
      return fmt::format(
          "the focal length of {} is {:+.2g} % off the others': images of another camera, zoom or focus; calibrate "
          "each of them by itself",
          where, 100 * size);
    case CameraFault::Kind::centre:
      return fmt::format(
          "the principal point of {} is {:.2g} px off the others': images that are turned, mirrored, cropped or of "
          "another camera; give all as the sensor has them",
          where, std::abs(size));
    case CameraFault::Kind::rolling_shutter:
      return fmt::format(
          "{} is sheared by {:.2g} px from top to bottom: the board or the camera moved, and the shutter rolls; hold "
          "both still",
          where, std::abs(size));
    case CameraFault::Kind::bent_board:
      return fmt::format("the board is bent and sags by {:.2g} mm: mount it on a flat plate", 1e3 * std::abs(size));
    case CameraFault::Kind::stretched_board:
      return fmt::format("the board's squares are {:.2g} % {} than high: print it without scaling, and flat",
                         100 * std::abs(size), size > 0 ? "wider" : "narrower");
  }
  return {};
}

// A sentence for each kind, the clearest first.
std::vector<std::string> texts_of(const std::vector<CameraFault>& faults, const std::vector<BoardView>& views) {
  std::set<CameraFault::Kind> told;
  std::vector<std::string> texts;
  for (const CameraFault& fault : faults) {
    if (!told.insert(fault.kind).second) continue;
    std::set<std::string> where;
    for (const CameraFault& other : faults)
      if (other.kind == fault.kind) where.insert(views[other.view].name);
    texts.push_back(text_of(fault.kind, fault.size, fmt::format("{}", fmt::join(where, ", "))));
  }
  return texts;
}

// Empty where the views suffice.
std::string refusal_of(const CameraAdjustment& adjustment, const std::vector<BoardView>& views) {
  const Camera& camera = adjustment.camera;
  const CameraSigmas& sigmas = camera.sigmas;
  if (sigmas.fx_px < max_focal_sigma * camera.fx_px && sigmas.cx_px < max_centre_sigma_px &&
      sigmas.cy_px < max_centre_sigma_px)
    return {};
  if (!adjustment.faults.empty()) return "the views do not agree: " + texts_of(adjustment.faults, views).front();
  return fmt::format(
      "the views are too alike: one sigma of the focal length is {:.1f} px of {:.0f}, of the principal "
      "point {:.1f} and {:.1f} px",
      sigmas.fx_px, camera.fx_px, sigmas.cx_px, sigmas.cy_px);
}

struct Tilts {
  double up_down_rad = 0, sideways_rad = 0;  // the largest
};

// The board's normal about the image's axes, by a camera of a usual field of view: good enough for advice.
Tilts tilts_of(const std::vector<BoardView>& views, const cv::Size& size) {
  const double focal_px = 1.1 * size.width;
  const cv::Matx33d matrix(focal_px, 0, size.width / 2.0, 0, focal_px, size.height / 2.0, 0, 0, 1);
  const Board unit{0, 0, 1};
  Tilts tilts;
  for (const BoardView& view : views) {
    const Points points = points_of(unit, view.corners);
    cv::Mat rotation, translation;
    if (!cv::solvePnP(points.on_board, points.in_picture, matrix, cv::noArray(), rotation, translation, false,
                      cv::SOLVEPNP_IPPE))
      continue;
    Eigen::Vector3d normal = pose_of(rotation, translation).rotation * Eigen::Vector3d::UnitZ();
    if (normal.z() < 0) normal = -normal;
    tilts.up_down_rad = std::max(tilts.up_down_rad, std::abs(std::atan2(normal.y(), normal.z())));
    tilts.sideways_rad = std::max(tilts.sideways_rad, std::abs(std::atan2(normal.x(), normal.z())));
  }
  return tilts;
}

// Which parts of the image, by row and column, hold a corner in some view.
std::array<std::array<bool, 4>, 3> parts_seen(const std::vector<BoardView>& views, const cv::Size& size) {
  std::array<std::array<bool, 4>, 3> seen{};
  const auto part = [](double at_px, int size_px, int parts) {
    return static_cast<std::size_t>(std::clamp(static_cast<int>(at_px * parts / size_px), 0, parts - 1));
  };
  for (const BoardView& view : views)
    for (const BoardCorner& corner : view.corners)
      seen[part(corner.raw_px.y(), size.height, 3)][part(corner.raw_px.x(), size.width, 4)] = true;
  return seen;
}

}  // namespace

bool BoardViews::add(const std::string& name, const cv::Mat& bgr, bool always) {
  BoardView view{name, bgr, find_board(board_, bgr, always)};
  if (view.corners.size() < least_corners) return false;
  // The places of a few corners determine position, distance and tilt.
  constexpr double different = 0.06;  // of the image's width
  const auto distance_px = [&](const BoardView& other) {
    double most = 0;
    int shared = 0;
    for (const BoardCorner& a : view.corners)
      for (const BoardCorner& b : other.corners)
        if (a.column == b.column && a.row == b.row) most = std::max(most, (a.raw_px - b.raw_px).norm()), ++shared;
    return shared < 4 ? std::numeric_limits<double>::max() : most;
  };
  const bool differs =
      std::ranges::all_of(views_, [&](const BoardView& other) { return distance_px(other) > different * bgr.cols; });
  if (!always && (!differs || full())) return true;
  view.bgr = bgr.clone();
  views_.push_back(std::move(view));
  return true;
}

std::string advice(const std::vector<BoardView>& views, const cv::Size& size) {
  std::vector<std::string> wanted;
  if (views.size() < least_views)
    wanted.push_back(fmt::format("show the board in {} more views", least_views - views.size()));
  const auto seen = parts_seen(views, size);
  constexpr std::array vertical{"upper", "middle", "lower"};
  std::vector<std::string> empty;
  for (std::size_t row = 0; row < seen.size(); ++row)
    for (const auto& [side, from] : {std::pair{"left", 0U}, {"right", 2U}})
      if (!seen[row][from] && !seen[row][from + 1]) empty.push_back(fmt::format("{} {}", vertical[row], side));
  for (const auto& [side, column] : {std::pair{"left side", 0U}, {"right side", 3U}})
    if (!seen[0][column] && !seen[1][column] && !seen[2][column]) empty.push_back(side);
  if (!empty.empty()) wanted.push_back(fmt::format("fill the {}", fmt::join(empty, ", the ")));
  const Tilts tilts = tilts_of(views, size);
  if (tilts.up_down_rad < least_tilt_rad)
    wanted.push_back("tilt the board by 20 to 40 degrees, its upper edge towards the camera and away");
  if (tilts.sideways_rad < least_tilt_rad)
    wanted.push_back("tilt the board by 20 to 40 degrees, its left edge towards the camera and away");
  return fmt::format("{}", fmt::join(wanted, "; "));
}

CameraCalibration calibrate_camera(const Board& board, const std::vector<BoardView>& views, const Camera& start,
                                   const JobWatch& watch) {
  CameraCalibration calibration;
  const AtIteration at_iteration = watch.is_stopped;
  int step = 0;
  const auto progress = [&](const char* what) { watch.tell(std::nullopt, ++step, fmt::format(", {}", what)); };
  const cv::Size size = views.empty() ? cv::Size() : views.front().bgr.size();
  const auto refuse = [&](const std::string& why) {
    const std::string lens = views.size() < least_views ? "" : fisheye_text(board, views);
    if (!lens.empty()) return calibration.refusal = lens, calibration;
    const std::string more = advice(views, size);
    calibration.refusal = why + (more.empty() ? "" : ": " + more);
    return calibration;
  };
  if (views.size() < least_views) return refuse(fmt::format("{} views of the board are too few", views.size()));
  progress("first fit");
  Camera without = start;
  without.chromatic_aberration = {};
  auto fit = first_fit(board, views, without);
  if (!fit) return refuse("the views are too alike to determine the camera");

  // Edges about the fit, and the fit about the edges.
  constexpr int last_round = 1;
  for (int round = 0; round <= last_round; ++round) {
    progress("edges in green");
    const auto points = measured(board, views, *fit, false, false).points;
    if (std::ranges::all_of(points, [](const auto& view) { return view.empty(); }))
      return refuse("no edge between squares can be measured: they are overexposed, or narrower than some 14 px");
    fit = adjust_camera(fit->camera, fit->camera_from_board, points, {.k3 = false, .faults = round == last_round},
                        at_iteration);
    if (!fit) return refuse("the views are too alike to determine the camera");
  }
  if (const std::string why = refusal_of(*fit, views); !why.empty()) return refuse(why);
  // Means are of light as the last round had it.
  constexpr int response_rounds = 2;
  for (int round = 0; round < response_rounds; ++round) {
    progress("response");
    const bool last = round + 1 == response_rounds;
    // More of them add no information.
    const auto response = fit_response(some_of(measured(board, views, *fit, false, true).profiles, last ? 600 : 300),
                                       fit->camera.response, last, at_iteration);
    if (!response) break;
    calibration.response = response;
    fit->camera.response = response->response;
  }
  progress("edges in all colours");
  const MeasuredEdges edges = measured(board, views, *fit, true, false);
  fit = adjust_what_shows(*fit, edges, at_iteration);
  if (!fit) return refuse("the views are too alike to determine the camera");
  calibration.camera = fit->camera;
  // The same from the same images: what the last digits of sums are hangs on where in memory the numbers lie.
  for (const CameraNumber& n : numbers_of(calibration.camera)) n.value = rounded_by_sigma(n.value, n.sigma);
  calibration.bright_wider_px = fit->bright_wider_px[green];
  add_residuals(*fit, edges, calibration);
  calibration.noise = fit->noise, calibration.faults = texts_of(fit->faults, views);
  if (const std::string why = refusal_of(*fit, views); !why.empty()) return refuse(why);
  if (calibration.rms_px > max_rms_px)
    return refuse(fmt::format("edges miss the fit by {:.2f} px rms: {}", calibration.rms_px,
                              calibration.faults.empty() ? "is the board flat, are the images unprocessed and sharp"
                                                         : calibration.faults.front()));
  if (!is_invertible(calibration.camera))
    return refuse("the distortion that fits the views can't be inverted at the image's border: show the board there");
  return calibration;
}

}  // namespace lapservo::internal
