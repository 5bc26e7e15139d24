#include "lapservo/rcm/distinct_lines.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <unordered_map>

namespace lapservo {
namespace {

using Ends = Eigen::Vector4d;  // from u, v, to u, v
using Cell = std::array<std::int64_t, 4>;

struct CellHash {
  std::size_t operator()(const Cell& cell) const {
    std::uint64_t hash = 0;
    for (const std::int64_t i : cell) hash = (hash ^ static_cast<std::uint64_t>(i)) * 0x9e3779b97f4a7c15ULL;
    return static_cast<std::size_t>(hash ^ hash >> 32);
  }
};

// Lines of one position: where the first was, and the sum of all.
struct Position {
  Ends first, sum;
  double count;
  Eigen::Matrix4d covariance_px2;
};

// Each joined with the first one that is near, which lies in its cell or in one of those around it.
std::vector<Position> merged(const std::vector<Position>& positions, double apart_px) {
  std::vector<Position> all;
  std::unordered_map<Cell, std::vector<std::size_t>, CellHash> by_cell;
  const auto find_near = [&](const Ends& ends, const Cell& cell) -> Position* {
    for (int n = 0; n < 81; ++n) {
      const Cell around{cell[0] + n % 3 - 1, cell[1] + n / 3 % 3 - 1, cell[2] + n / 9 % 3 - 1, cell[3] + n / 27 - 1};
      const auto found = by_cell.find(around);
      if (found == by_cell.end()) continue;
      for (const std::size_t i : found->second)
        if ((all[i].first - ends).cwiseAbs().maxCoeff() < apart_px) return &all[i];
    }
    return nullptr;
  };
  for (const Position& one : positions) {
    Cell cell;
    for (std::size_t i = 0; i < 4; ++i) cell[i] = static_cast<std::int64_t>(std::floor(one.first[i] / apart_px));
    if (Position* near = find_near(one.first, cell)) {
      near->sum += one.sum, near->count += one.count;
    } else {
      by_cell[cell].push_back(all.size());
      all.push_back(one);
    }
  }
  return all;
}

}  // namespace

std::vector<LineObservation> distinct_lines(std::span<const LineObservation> lines) {
  constexpr std::size_t most = 1000;
  double apart_px = 2;
  std::vector<Position> positions;
  for (const LineObservation& line : lines) {
    if (!is_usable(line)) continue;
    Ends ends;
    ends << line.from_px, line.to_px;
    positions.push_back({ends, ends, 1, line.covariance_px2});
  }
  do {
    positions = merged(positions, apart_px);
    apart_px *= 1.5;
  } while (positions.size() > most);
  std::vector<LineObservation> distinct;
  for (const Position& position : positions) {
    const Ends mean = position.sum / position.count;
    distinct.push_back({mean.head<2>(), mean.tail<2>(), position.covariance_px2});
  }
  return distinct;
}

}  // namespace lapservo
