#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "lapservo/geometry/camera.h"
#include "lapservo/geometry/response.h"
#include "lapservo/geometry/rigid3.h"

namespace lapservo::internal {

/// A chessboard, or a ChArUco board (white squares hold ArUco markers), flat. Inner corner (column, row) lies at
/// (column, row, 0) * square_m of the board's frame.
struct Board {
  int columns = 0, rows = 0;  ///< inner corners
  double square_m = 0;
  std::string dictionary{};  ///< of a ChArUco board's markers, as OpenCV names it (DICT_4X4_50); empty: a chessboard
  double marker_m = 0;       ///< a marker's width, for a ChArUco board

  Eigen::Vector3d corner_m(double column, double row) const { return {column * square_m, row * square_m, 0}; }
  /// How far from an edge between squares both squares are plain.
  double plain_m() const { return dictionary.empty() ? square_m / 2 : (square_m - marker_m) / 2; }
};

struct BoardCorner {
  int column, row;
  Eigen::Vector2d raw_px;
};

/// The problem with it, for an error message: empty without one.
std::string board_problem(const Board& board);

/// Corners to about a tenth of a pixel: all of a chessboard's, or those of a ChArUco board that are in view. Empty when
/// there is no board. 8-bit BGR. `thorough` takes seconds where there is none. Throws nothing. A chessboard may be
/// found turned by 180 degrees: its corners are the same.
std::vector<BoardCorner> find_board(const Board& board, const cv::Mat& bgr, bool thorough);

/// Columns and rows of inner corners of the chessboard in an image (8-bit BGR), the larger number first; nullopt where
/// there is none. Takes seconds, throws nothing.
std::optional<std::pair<int, int>> size_of_chessboard(const cv::Mat& bgr);

/// The edge between two squares, from one inner corner to the next: where a camera would show it.
struct EdgePath {
  Eigen::Vector3d from_m, to_m;                ///< on the board
  Eigen::Vector2d from_px, along, normal;      ///< raw; unit vectors of the chord
  double length_px = 0, sag_px = 0;            ///< the curve lies this far from the chord at its middle, along normal
  std::array<double, 9> fraction_of_length{};  ///< of the points at 0, 1/8, ... 1 between the corners of the board

  /// Signed distance to the curve along `normal`, and how far along the chord, in parts of it.
  std::pair<double, double> place_of(const Eigen::Vector2d& raw_px) const;
  /// The point of the board that is seen at so many parts of the chord.
  Eigen::Vector3d point_m(double fraction) const;
};

/// A pixel near an edge: its distance to it along `normal`, parts of the chord, and its three values (b, g, r).
struct EdgePixel {
  double distance_px, fraction;
  std::array<std::uint8_t, 3> value;
};

/// Pixels within reach of an edge and clear of its corners.
struct EdgePixels {
  EdgePath path;
  double reach_px = 0;
  std::vector<EdgePixel> pixels;
};

/// Edges between the corners that were found, where they are long enough to be measured and wholly in the image.
/// `board_from`: the board's pose in the camera frame. Green's geometry; those of blue and red differ by far less than
/// `reach_px`.
std::vector<EdgePixels> edges_of(const Board& board, const std::vector<BoardCorner>& corners, const Camera& camera,
                                 const Rigid3& camera_from_board, const cv::Mat& bgr);

/// A straight blurred edge fitted to a channel's light.
struct BoardEdgeFit {
  double offset_px = 0, slope = 0;  ///< distance to the path at mean_fraction, and its change along the edge
  double mean_fraction = 0, spread_fraction = 0;
  double blur_px = 0;      ///< one sigma
  double sigma_px = 0;     ///< of offset_px, by the pixels' scatter about the fit
  int towards_bright = 0;  ///< 1 where `normal` points to the brighter square, else -1
};

/// nullopt where there is no such edge: too little contrast, saturated, or a fit that leaves it.
std::optional<BoardEdgeFit> fit_edge(const EdgePixels& edge, int channel, const LightTable& light_of_value);

/// A channel's encoded values (0 to 1) across an edge, from dark to bright, in steps of `profile_step_px` about the
/// edge; NaN where there is none. Means of light, encoded again: noise comes before the response.
struct BoardEdgeProfile {
  std::vector<double> value, sigma;
  std::vector<double> at_px, spread_px2;  ///< distances of a step's pixels: their mean and variance
  double dark = 0, bright = 0;            ///< values of the squares beside it
  double blur_px = 1;
  double angle_rad = 0;  ///< between the edge and the nearer of rows and columns, 0 to pi/4
};
constexpr double profile_step_px = 0.5;

/// The profile of an edge that was fitted in this channel; nullopt where it shows no two levels.
std::optional<BoardEdgeProfile> profile_of(const EdgePixels& edge, const BoardEdgeFit& fit, int channel,
                                           const Response& response);

}  // namespace lapservo::internal
