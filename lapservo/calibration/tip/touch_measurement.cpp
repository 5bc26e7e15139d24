#include "lapservo/calibration/tip/touch_measurement.h"

#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <opencv2/calib3d.hpp>

#include "lapservo/calibration/registration/registration_measurement.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/csv.h"
#include "lapservo/core/error.h"
#include "lapservo/core/statistics.h"
#include "lapservo/geometry/rotation.h"

namespace lapservo::internal {
namespace {

// By the corners of one image or more; nullopt where they are no board's.
std::optional<Rigid3> pose_of_board(const Board& board, const Camera& camera, const std::vector<BoardCorner>& corners) {
  constexpr std::size_t least_corners = 8;
  constexpr double max_rms_px = 0.5;  // also of a board that moved between two images
  std::vector<cv::Point3d> on_board;
  std::vector<cv::Point2d> rays;
  for (const BoardCorner& corner : corners) {
    const auto ideal_px = camera.ideal_from_raw(corner.raw_px);
    if (!ideal_px) continue;
    const Eigen::Vector3d point_m = board.corner_m(corner.column, corner.row), ray = camera.ray_from_ideal(*ideal_px);
    on_board.emplace_back(point_m.x(), point_m.y(), 0), rays.emplace_back(ray.x(), ray.y());
  }
  cv::Vec3d rotation, translation;
  const cv::Matx33d identity = cv::Matx33d::eye();
  if (rays.size() < least_corners ||
      !cv::solvePnP(on_board, rays, identity, cv::noArray(), rotation, translation, false, cv::SOLVEPNP_IPPE))
    return std::nullopt;
  cv::solvePnPRefineLM(on_board, rays, identity, cv::noArray(), rotation, translation);
  const Rigid3 pose{rotation_by({rotation[0], rotation[1], rotation[2]}),
                    {translation[0], translation[1], translation[2]}};
  const double rms_px = rms(corners, [&](const BoardCorner& corner) {
    return (camera.raw_from_point(pose * board.corner_m(corner.column, corner.row)) - corner.raw_px).norm();
  });
  return rms_px < max_rms_px ? std::optional(pose) : std::nullopt;
}

}  // namespace

std::vector<TouchImage> read_touches(const std::filesystem::path& table, const Board& board, const Tool& tool) {
  const CsvTable csv = CsvTable::read(table);
  std::vector<TouchImage> images;
  for (std::size_t row = 0; row < csv.rows(); ++row) {
    const auto whole = [&](const char* column, int count) {
      const double number = csv.number(row, column);
      if (number != std::floor(number) || number < 0 || number >= count)
        throw InputError(table.string(), fmt::format("row {}: {}", row + 1, column), csv.text(row, column),
                         fmt::format("0 to {}, an inner corner of the board", count - 1));
      return static_cast<int>(number);
    };
    TouchImage& image = images.emplace_back();
    if (csv.text(row, "file").empty())
      throw InputError(table.string(), fmt::format("row {}: file", row + 1), "empty", "the name of an image");
    image.file = table.parent_path() / csv.text(row, "file");
    if (csv.text(row, "column").empty() && csv.text(row, "row").empty()) continue;
    image.corner = {whole("column", board.columns), whole("row", board.rows)};
    for (const WristJoint& joint : tool.wrist) {
      const double angle_rad = image.wrist_rad.emplace_back(csv.number(row, joint.name));
      if (std::abs(angle_rad) > two_pi)
        throw InputError(table.string(), fmt::format("row {}: {}", row + 1, joint.name), csv.text(row, joint.name),
                         "radians within 6.283: it looks like degrees");
    }
  }
  return images;
}

TouchMeasurement measure_touches(const Rig& rig, std::size_t instrument, const Tool& tool, const Board& board,
                                 const std::vector<TouchImage>& images, const OpenImage& open, bool deinterlace,
                                 const JobWatch& watch) {
  TouchMeasurement result;
  std::vector<BoardCorner> corners;
  std::vector<const TouchImage*> seen;
  std::vector<TipSighting> touches;
  for (const TouchImage& image : images) {
    watch.tell(static_cast<int>(images.size()), static_cast<int>(&image - images.data()), "");
    if (watch.stopped()) return result.calibration.refusal = "stopped", result;
    const auto source = open(image.file.string());
    const FrameRecording recording{*source, image.file.string(), deinterlace};
    if (!image.corner) {
      read_frames(recording, rig, 1, {}, [&](const cv::Mat& bgr, double) {
        const auto found = find_board(board, bgr, true);
        corners.insert(corners.end(), found.begin(), found.end());
        return std::string();
      });
    } else if (const MeasuredPoses poses = poses_in_frames(rig, instrument, recording, {}); poses.all.empty()) {
      result.without_marker.push_back(image.file.string() + ": " + poses.none);
    } else {
      seen.push_back(&image), touches.push_back({poses.all.front(), image.wrist_rad});
    }
  }
  const auto camera_from_board = pose_of_board(board, rig.camera, corners);
  if (!camera_from_board) {
    result.calibration.refusal = fmt::format(
        "the board of {}x{} inner corners is not found where it lies still: give an image of it without the "
        "instrument, before and after the touches",
        board.columns, board.rows);
    return result;
  }
  for (const bool is_turned : {false, true}) {
    if (is_turned && !board.dictionary.empty()) break;
    std::vector<std::string> names;
    for (std::size_t i = 0; i < touches.size(); ++i) {
      Eigen::Vector2i at = *seen[i]->corner;
      if (is_turned) at = Eigen::Vector2i(board.columns - 1, board.rows - 1) - at;
      touches[i].point_in_camera_m = *camera_from_board * board.corner_m(at.x(), at.y());
      names.push_back(seen[i]->file.string());
    }
    TipCalibration calibration = touched_tip(tool, touches, names);
    const auto miss_m = [](const TipCalibration& of) { return of.misses_m.empty() ? HUGE_VAL : rms(of.misses_m); };
    if (!is_turned || miss_m(calibration) < miss_m(result.calibration)) result.calibration = std::move(calibration);
  }
  return result;
}

}  // namespace lapservo::internal
