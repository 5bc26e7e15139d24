#include "lapservo/calibration/camera/board.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <map>
#include <numbers>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "lapservo/core/dense_matrix.h"

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

constexpr int large_px = 800;

std::vector<BoardCorner> find_chessboard(const Board& board, const cv::Mat& grey, bool thorough) {
  // Half of the size first: quick, and noise and sharpening matter less. The corners are measured elsewhere.
  std::vector<cv::Point2f> points;
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

constexpr double max_reach_px = 7, min_reach_px = 3;
constexpr double clear_of_corner_px = 4;  // where blur lets the other edge of a corner be seen
constexpr double min_clear_length_px = 6;
constexpr std::uint8_t saturated_value = 252;
constexpr double clear_of_corner_blurs = 4;       // from a corner: there its other edge does not show
constexpr double least_variance = 0.002 * 0.002;  // rounding to 8 bits, and more

EdgePath path_of(const Camera& camera, const Rigid3& camera_from_board, const Eigen::Vector3d& from_m,
                 const Eigen::Vector3d& to_m) {
  EdgePath path;
  path.from_m = from_m, path.to_m = to_m;
  std::array<Eigen::Vector2d, 9> points;
  for (std::size_t i = 0; i < points.size(); ++i)
    points[i] = camera.raw_from_point(camera_from_board * (from_m + (to_m - from_m) * (static_cast<double>(i) / 8)));
  path.from_px = points.front();
  const Eigen::Vector2d chord = points.back() - points.front();
  path.length_px = chord.norm();
  path.along = chord / path.length_px;
  path.normal = {-path.along.y(), path.along.x()};
  path.sag_px = path.normal.dot(points[4] - points.front());
  for (std::size_t i = 0; i < points.size(); ++i)
    path.fraction_of_length[i] = path.along.dot(points[i] - points.front()) / path.length_px;
  return path;
}

// Half of how far the squares beside the edge reach across it, in pixels.
double plain_px(const Board& board, const Camera& camera, const Rigid3& camera_from_board, const EdgePath& path) {
  const Eigen::Vector3d middle_m = (path.from_m + path.to_m) / 2;
  const Eigen::Vector3d across = Eigen::Vector3d::UnitZ().cross((path.to_m - path.from_m).normalized());
  const auto place = [&](double side) {
    return camera.raw_from_point(camera_from_board * (middle_m + side * board.plain_m() * across));
  };
  const Eigen::Vector2d centre = camera.raw_from_point(camera_from_board * middle_m);
  return std::min(std::abs(path.normal.dot(place(1) - centre)), std::abs(path.normal.dot(place(-1) - centre)));
}

void collect(EdgePixels& edge, const cv::Mat& bgr) {
  const Eigen::Vector2d to_px = edge.path.from_px + edge.path.length_px * edge.path.along;
  const double margin = clear_of_corner_px / edge.path.length_px, reach_px = edge.reach_px;
  const Eigen::Vector2d low = edge.path.from_px.cwiseMin(to_px).array() - reach_px - 1;
  const Eigen::Vector2d high = edge.path.from_px.cwiseMax(to_px).array() + reach_px + 1;
  if (low.x() < 0 || low.y() < 0 || high.x() > bgr.cols - 1 || high.y() > bgr.rows - 1) return;
  for (int v = static_cast<int>(low.y()); v <= high.y(); ++v) {
    const std::uint8_t* row = bgr.ptr<std::uint8_t>(v);
    for (int u = static_cast<int>(low.x()); u <= high.x(); ++u) {
      const auto [distance_px, fraction] = edge.path.place_of(Eigen::Vector2d(u, v));
      if (std::abs(distance_px) > reach_px || fraction < margin || fraction > 1 - margin) continue;
      // Towards the corners, where the neighbouring edges come nearer, only what is nearer to this one.
      const double to_corner_px = std::min(fraction, 1 - fraction) * edge.path.length_px;
      if (std::abs(distance_px) > 1.5 * to_corner_px) continue;
      edge.pixels.push_back({distance_px, fraction, {row[3 * u], row[3 * u + 1], row[3 * u + 2]}});
    }
  }
}

struct Levels {
  double below = 0, above = 0;
};

std::optional<Levels> levels_of(const EdgePixels& edge, std::size_t channel, const LightTable& light) {
  Levels sum;
  int below = 0, above = 0;
  for (const EdgePixel& pixel : edge.pixels) {
    if (std::abs(pixel.distance_px) < 0.5 * edge.reach_px) continue;
    if (pixel.distance_px < 0)
      sum.below += light[pixel.value[channel]], ++below;
    else
      sum.above += light[pixel.value[channel]], ++above;
  }
  if (below < 8 || above < 8) return std::nullopt;
  return Levels{sum.below / below, sum.above / above};
}

// Sums over the pixels of a part of a profile.
struct Bin {
  int count = 0;
  double distance_px = 0, distance_px2 = 0, light = 0, value = 0, squares = 0;

  void add(double at_px, double pixel_light, double pixel_value) {
    ++count, distance_px += at_px, distance_px2 += at_px * at_px;
    light += pixel_light, value += pixel_value, squares += pixel_value * pixel_value;
  }
  void add(const Bin& other) {
    count += other.count, light += other.light, value += other.value, squares += other.squares;
  }
  double variance() const { return std::max(0.0, squares / count - value / count * value / count); }
};

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

std::optional<std::pair<int, int>> size_of_chessboard(const cv::Mat& bgr) {
  cv::Mat grey, found;
  cv::cvtColor(bgr, grey, cv::COLOR_BGR2GRAY);
  if (grey.cols > large_px) cv::resize(grey, grey, {}, 0.5, 0.5, cv::INTER_AREA);
  const SameRandomNumbers same;
  try {
    std::vector<cv::Point2f> points;
    if (!cv::findChessboardCornersSB(grey, {3, 3}, points, cv::CALIB_CB_LARGER, found)) return std::nullopt;
  } catch (const cv::Exception&) {  // of its fits to what is no board
    return std::nullopt;
  }
  return std::pair(std::max(found.cols, found.rows), std::min(found.cols, found.rows));
}

std::pair<double, double> EdgePath::place_of(const Eigen::Vector2d& raw_px) const {
  const Eigen::Vector2d from = raw_px - from_px;
  const double fraction = along.dot(from) / length_px;
  return {normal.dot(from) - 4 * sag_px * fraction * (1 - fraction), fraction};
}

Eigen::Vector3d EdgePath::point_m(double fraction) const {
  std::size_t i = 0;
  while (i + 2 < fraction_of_length.size() && fraction_of_length[i + 1] < fraction) ++i;
  const double part = (fraction - fraction_of_length[i]) / (fraction_of_length[i + 1] - fraction_of_length[i]);
  return from_m + (to_m - from_m) * ((static_cast<double>(i) + part) / 8);
}

std::vector<EdgePixels> edges_of(const Board& board, const std::vector<BoardCorner>& corners, const Camera& camera,
                                 const Rigid3& camera_from_board, const cv::Mat& bgr) {
  std::map<std::pair<int, int>, bool> found;
  for (const BoardCorner& corner : corners) found[{corner.column, corner.row}] = true;
  std::vector<EdgePixels> edges;
  for (const BoardCorner& corner : corners)
    for (const auto& [columns, rows] : {std::pair{1, 0}, {0, 1}}) {
      if (!found.contains({corner.column + columns, corner.row + rows})) continue;
      EdgePixels edge;
      edge.path = path_of(camera, camera_from_board, board.corner_m(corner.column, corner.row),
                          board.corner_m(corner.column + columns, corner.row + rows));
      edge.reach_px = std::min(max_reach_px, 0.8 * plain_px(board, camera, camera_from_board, edge.path));
      if (!(edge.reach_px >= min_reach_px) || edge.path.length_px < 2 * clear_of_corner_px + min_clear_length_px)
        continue;
      collect(edge, bgr);
      if (!edge.pixels.empty()) edges.push_back(std::move(edge));
    }
  return edges;
}

std::optional<BoardEdgeFit> fit_edge(const EdgePixels& edge, int channel, const LightTable& light_of_value) {
  const auto c = static_cast<std::size_t>(channel);
  const auto levels = levels_of(edge, c, light_of_value);
  if (!levels) return std::nullopt;
  BoardEdgeFit fit;
  double sum = 0, squares = 0;
  for (const EdgePixel& pixel : edge.pixels) {
    if (pixel.value[c] >= saturated_value) return std::nullopt;
    sum += pixel.fraction, squares += pixel.fraction * pixel.fraction;
  }
  const auto count = static_cast<double>(edge.pixels.size());
  fit.mean_fraction = sum / count;
  fit.spread_fraction = std::sqrt(std::max(0.0, squares / count - fit.mean_fraction * fit.mean_fraction));

  // Light at distance t: below + step * Phi((t - offset - slope * x) / blur), x in pixels along the edge.
  Eigen::Vector<double, 5> p(levels->below, levels->above - levels->below, 0, 0, 1);
  if (std::abs(p[1]) < 0.03 || std::max(levels->below, levels->above) < 2 * std::min(levels->below, levels->above))
    return std::nullopt;
  constexpr double per_root_two_pi = std::numbers::inv_sqrtpi / std::numbers::sqrt2;
  double residual_squares = 0;
  Eigen::Matrix<double, 5, 5> normal;
  for (int round = 0; round < 12; ++round) {
    normal.setZero();
    Eigen::Vector<double, 5> right = Eigen::Vector<double, 5>::Zero();
    residual_squares = 0;
    for (const EdgePixel& pixel : edge.pixels) {
      const double x_px = (pixel.fraction - fit.mean_fraction) * edge.path.length_px;
      const double z = (pixel.distance_px - p[2] - p[3] * x_px) / p[4];
      const double phi = 0.5 * std::erfc(-z / std::numbers::sqrt2);
      const double density = per_root_two_pi * std::exp(-0.5 * z * z);
      const double by_distance = -p[1] * density / p[4];
      Eigen::Vector<double, 5> row;
      row << 1, phi, by_distance, by_distance * x_px, by_distance * z;
      const double residual = light_of_value[pixel.value[c]] - p[0] - p[1] * phi;
      residual_squares += residual * residual;
      normal.noalias() += row * row.transpose();
      right.noalias() += row * residual;
    }
    const Eigen::Vector<double, 5> step = solve_symmetric(normal, right);
    if (!step.allFinite()) return std::nullopt;
    p += step;
    p[4] = std::clamp(p[4], 0.3, edge.reach_px);
    if (std::abs(p[2]) > 0.5 * edge.reach_px) return std::nullopt;
    if (std::abs(step[2]) < 1e-4 && std::abs(step[4]) < 1e-3) break;
  }
  const Eigen::Matrix<double, 5, 5> covariance =
      inverse_of_symmetric(normal) * (residual_squares / std::max(1.0, count - 5));
  fit.offset_px = p[2], fit.slope = p[3], fit.blur_px = p[4];
  fit.towards_bright = p[1] > 0 ? 1 : -1;
  fit.sigma_px = std::sqrt(covariance(2, 2));
  if (!std::isfinite(fit.sigma_px) || fit.sigma_px > 0.5 || fit.blur_px > 0.6 * edge.reach_px) return std::nullopt;
  return fit;
}

std::optional<BoardEdgeProfile> profile_of(const EdgePixels& edge, const BoardEdgeFit& fit, int channel,
                                           const Response& response) {
  const LightTable light = response.table();
  const auto c = static_cast<std::size_t>(channel);
  const int half = static_cast<int>(edge.reach_px / profile_step_px);
  const auto size = static_cast<std::size_t>(2 * half + 1);
  std::vector<Bin> bins(size);
  for (const EdgePixel& pixel : edge.pixels) {
    const double to_corner_px = std::min(pixel.fraction, 1 - pixel.fraction) * edge.path.length_px;
    if (to_corner_px < clear_of_corner_blurs * fit.blur_px) continue;
    const double towards_px = fit.towards_bright * pixel.distance_px;
    const long bin = std::lround(towards_px / profile_step_px);
    if (std::abs(bin) > half) continue;
    bins[static_cast<std::size_t>(bin + half)].add(towards_px, light[pixel.value[c]], pixel.value[c] / 255.0);
  }
  BoardEdgeProfile profile;
  profile.blur_px = fit.blur_px;
  const Eigen::Vector2d along = edge.path.along.cwiseAbs();
  profile.angle_rad = std::atan2(along.minCoeff(), along.maxCoeff());
  constexpr int least = 4;
  profile.value.assign(size, std::numeric_limits<double>::quiet_NaN());
  profile.sigma.assign(size, 0), profile.at_px.assign(size, 0), profile.spread_px2.assign(size, 0);
  for (std::size_t i = 0; i < size; ++i) {
    const Bin& bin = bins[i];
    if (bin.count < least) continue;
    profile.value[i] = response.value_from_light(std::clamp(bin.light / bin.count, 0.0, 1.0));
    profile.at_px[i] = bin.distance_px / bin.count;
    profile.spread_px2[i] = std::max(0.0, bin.distance_px2 / bin.count - profile.at_px[i] * profile.at_px[i]);
  }
  Bin dark, bright;
  for (std::size_t i = 0; i < size / 5; ++i) dark.add(bins[i]), bright.add(bins[size - 1 - i]);
  if (dark.count < 3 * least || bright.count < 3 * least) return std::nullopt;
  profile.dark = response.value_from_light(dark.light / dark.count);
  profile.bright = response.value_from_light(bright.light / bright.count);
  if (profile.bright - profile.dark < 0.05) return std::nullopt;
  for (std::size_t i = 0; i < size; ++i) {
    if (!std::isfinite(profile.value[i])) continue;
    const double part = std::clamp((profile.value[i] - profile.dark) / (profile.bright - profile.dark), 0.0, 1.0);
    profile.sigma[i] =
        std::sqrt(((1 - part) * dark.variance() + part * bright.variance() + least_variance) / bins[i].count);
  }
  return profile;
}

}  // namespace lapservo::internal
