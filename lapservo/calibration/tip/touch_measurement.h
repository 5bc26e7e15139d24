#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/calibration/camera/board.h"
#include "lapservo/calibration/recording/frame_recording.h"
#include "lapservo/calibration/tip/tip_fit.h"
#include "lapservo/io/frame_source.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// An image of a tip on a corner of a board, or of the board without an instrument.
struct TouchImage {
  std::filesystem::path file;
  std::optional<Eigen::Vector2i> corner;  ///< column, row; nullopt: the board alone
  std::vector<double> wrist_rad{};
};

/// A CSV of `file` (relative to it), `column`, `row` and a column for each joint of the tool's wrist, in rad. Without
/// column and row the image is one of the board alone. Throws InputError for what is none.
std::vector<TouchImage> read_touches(const std::filesystem::path& table, const Board& board, const Tool& tool);

/// Opens an image, of which it may give one eye's half.
using OpenImage = std::function<std::unique_ptr<FrameSource>(const std::string& file)>;

struct TouchMeasurement {
  TipCalibration calibration;               ///< or its refusal
  std::vector<std::string> without_marker;  ///< images that do not count
};

/// Tracks the instrument's marker in the images of touches and finds the board in the others. A chessboard may be found
/// turned by 180 degrees: the touches show which way it lies. Throws InputError as read_frames().
TouchMeasurement measure_touches(const Rig& rig, std::size_t instrument, const Tool& tool, const Board& board,
                                 const std::vector<TouchImage>& images, const OpenImage& open, bool deinterlace,
                                 const JobWatch& watch);

}  // namespace lapservo::internal
