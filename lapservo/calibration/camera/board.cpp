#include "lapservo/calibration/camera/board.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace lapservo::internal {
namespace {

// In the order of OpenCV's numbers for them.
constexpr std::array dictionaries{
    "DICT_4X4_50",  "DICT_4X4_100",  "DICT_4X4_250", "DICT_4X4_1000", "DICT_5X5_50",        "DICT_5X5_100",
    "DICT_5X5_250", "DICT_5X5_1000", "DICT_6X6_50",  "DICT_6X6_100",  "DICT_6X6_250",       "DICT_6X6_1000",
    "DICT_7X7_50",  "DICT_7X7_100",  "DICT_7X7_250", "DICT_7X7_1000", "DICT_ARUCO_ORIGINAL"};
static_assert(cv::aruco::DICT_4X4_50 == 0 && cv::aruco::DICT_ARUCO_ORIGINAL + 1 == std::ssize(dictionaries));

std::optional<cv::aruco::Dictionary> dictionary_of(const Board& board) {
  const auto at = std::find(dictionaries.begin(), dictionaries.end(), board.dictionary);
  if (at == dictionaries.end()) return {};
  const auto number = static_cast<int>(at - dictionaries.begin());
#if CV_VERSION_MAJOR > 4 || (CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR >= 7)
  return cv::aruco::getPredefinedDictionary(number);
#else
  return *cv::aruco::getPredefinedDictionary(number);
#endif
}

// OpenCV's search for a chessboard draws from its thread's random numbers: each image from the same ones, whatever
// was looked at before.
class SameRandomNumbers {
 public:
  SameRandomNumbers() { cv::theRNG() = cv::RNG(); }
  ~SameRandomNumbers() { cv::theRNG() = others_; }
  SameRandomNumbers(const SameRandomNumbers&) = delete;
  SameRandomNumbers& operator=(const SameRandomNumbers&) = delete;

 private:
  cv::RNG others_ = cv::theRNG();
};

std::vector<BoardCorner> find_chessboard(const Board& board, const cv::Mat& grey, bool thorough) {
  // Half of the size first: quick, and noise and sharpening matter less. The corners are measured elsewhere.
  std::vector<cv::Point2f> points;
  constexpr int large_px = 800;
  const cv::Size size(board.columns, board.rows);
  const auto found_in = [&](const cv::Mat& picture, int flags) {
    return cv::findChessboardCornersSB(picture, size, points, flags);
  };
  bool found = false;
  cv::Mat other;
  if (grey.cols > large_px) {
    cv::resize(grey, other, {}, 0.5, 0.5, cv::INTER_AREA);
    found = found_in(other, 0);
    for (cv::Point2f& p : points) p = 2 * p + cv::Point2f(0.5F, 0.5F);
  }
  if (!found && (thorough || grey.cols <= large_px)) found = found_in(grey, 0);
  if (!found && thorough) found = found_in(grey, cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_EXHAUSTIVE);
  if (!found && thorough) {
    cv::GaussianBlur(grey, other, {}, 1.5);
    found = found_in(other, 0);
  }
  if (!found) return {};
  std::vector<BoardCorner> corners;
  for (int row = 0; row < board.rows; ++row)
    for (int column = 0; column < board.columns; ++column) {
      const cv::Point2f& p = points[static_cast<std::size_t>(row * board.columns + column)];
      corners.push_back({column, row, {p.x, p.y}});
    }
  return corners;
}

std::vector<BoardCorner> find_charuco(const Board& board, const cv::Mat& grey) {
  const auto square_m = static_cast<float>(board.square_m), marker_m = static_cast<float>(board.marker_m);
  std::vector<std::vector<cv::Point2f>> markers;
  std::vector<int> marker_numbers, numbers;
  std::vector<cv::Point2f> points;
#if CV_VERSION_MAJOR > 4 || (CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR >= 7)
  const cv::aruco::CharucoBoard charuco({board.columns + 1, board.rows + 1}, square_m, marker_m,
                                        dictionary_of(board).value());
  cv::aruco::CharucoDetector(charuco).detectBoard(grey, points, numbers, markers, marker_numbers);
#else
  const auto dictionary = cv::makePtr<cv::aruco::Dictionary>(dictionary_of(board).value());
  const auto charuco =
      cv::aruco::CharucoBoard::create(board.columns + 1, board.rows + 1, square_m, marker_m, dictionary);
  cv::aruco::detectMarkers(grey, dictionary, markers, marker_numbers);
  if (marker_numbers.empty()) return {};
  cv::aruco::interpolateCornersCharuco(markers, marker_numbers, grey, charuco, points, numbers);
#endif
  std::vector<BoardCorner> corners;
  for (std::size_t i = 0; i < points.size(); ++i)
    corners.push_back({numbers[i] % board.columns, numbers[i] / board.columns, {points[i].x, points[i].y}});
  return corners;
}

}  // namespace

std::string board_problem(const Board& board) {
  if (board.dictionary.empty()) return {};
  const auto dictionary = dictionary_of(board);
  if (!dictionary)
    return fmt::format("{} is no dictionary of ArUco markers that is known here, expected one of {}", board.dictionary,
                       fmt::join(dictionaries, ", "));
  const int markers = (board.columns + 1) * (board.rows + 1) / 2;
  if (markers > dictionary->bytesList.rows)
    return fmt::format("{} has {} markers and the board {}", board.dictionary, dictionary->bytesList.rows, markers);
  return {};
}

std::vector<BoardCorner> find_board(const Board& board, const cv::Mat& bgr, bool thorough) {
  cv::Mat grey;
  cv::cvtColor(bgr, grey, cv::COLOR_BGR2GRAY);
  const SameRandomNumbers same;
  try {
    return board.dictionary.empty() ? find_chessboard(board, grey, thorough) : find_charuco(board, grey);
  } catch (const cv::Exception&) {  // of its fits to what is no board
    return {};
  }
}

}  // namespace lapservo::internal
