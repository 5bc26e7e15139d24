#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

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

}  // namespace lapservo::internal
