#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/calibration/camera/board.h"
#include "lapservo/calibration/camera/camera_adjustment.h"
#include "lapservo/calibration/camera/response_fit.h"
#include "lapservo/calibration/recording/frame_recording.h"
#include "lapservo/geometry/camera.h"

namespace lapservo::internal {

/// An image in which the board was found.
struct BoardView {
  std::string name;
  cv::Mat bgr;
  std::vector<BoardCorner> corners;
};

/// Chooses, out of the frames of a video, those that show the board differently.
class BoardViews {
 public:
  static constexpr std::size_t least_corners = 12;  ///< of a view

  BoardViews(Board board, std::size_t most) : board_(std::move(board)), most_(most) {}

  /// Keeps the image when its board lies elsewhere than in all that were kept, or, with `always`, wherever it lies.
  /// Returns whether a board was found.
  bool add(const std::string& name, const cv::Mat& bgr, bool always);
  const std::vector<BoardView>& views() const { return views_; }
  std::size_t most() const { return most_; }
  bool full() const { return views_.size() >= most_; }
  std::vector<BoardView> take() { return std::move(views_); }

 private:
  Board board_;
  std::size_t most_;
  std::vector<BoardView> views_;
};

/// Advice for the next images: "fill the lower left", "tilt the board". Empty when nothing is missing.
std::string advice(const std::vector<BoardView>& views, const cv::Size& size);

struct CameraCalibration {
  /// Why there is none, and what to do about it: then nothing else counts. Empty when there is one.
  std::string refusal;
  Camera camera;                        ///< with its sigmas and covariance, to all their digits
  std::optional<ResponseFit> response;  ///< nullopt where the images do not determine it: the camera's response stays
  std::vector<std::optional<double>>
      view_rms_px;  ///< of edges about the fit, by view, green; none where none is measured
  double rms_px = 0;
  double noise = 1;                 ///< how many times the edges' own noise that is, of all colours; robust
  std::vector<std::string> faults;  ///< that show beyond the noise, one sentence each: the sigmas count them
  std::vector<BoardView> views;     ///< of measure_camera(): those that it was measured by
  std::string advice;               ///< likewise: what more images should show; empty when nothing is missing
  double bright_wider_px = 0;  ///< with the calibrated response, green: 0 for a board whose squares are equally wide
};

/// Matrix, distortion, lateral chromatic aberration and response of the camera that took the views, all of one size.
/// `start` gives the response to begin with.
CameraCalibration calibrate_camera(const Board& board, const std::vector<BoardView>& views, const Camera& start,
                                   const JobWatch& watch = {});

}  // namespace lapservo::internal
