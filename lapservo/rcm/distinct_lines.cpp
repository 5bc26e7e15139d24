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

class Positions {
 public:
  explicit Positions(double apart_px) : apart_px_(apart_px) {}

  void add(const Position& one) {
    const Cell cell = cell_of(one.first);
    if (Position* near = find_near(one.first, cell)) {
      near->sum += one.sum, near->count += one.count;
    } else {
      by_cell_[cell].push_back(all_.size());
      all_.push_back(one);
    }
  }
  const std::vector<Position>& all() const { return all_; }

 private:
  Cell cell_of(const Ends& ends) const {
    Cell cell;
    for (Eigen::Index i = 0; i < 4; ++i)
      cell[static_cast<std::size_t>(i)] = static_cast<std::int64_t>(std::floor(ends[i] / apart_px_));
    return cell;
  }
  // In its cell and those around it.
  Position* find_near(const Ends& ends, const Cell& cell) {
    for (int n = 0; n < 81; ++n) {
      const Cell around{cell[0] + n % 3 - 1, cell[1] + n / 3 % 3 - 1, cell[2] + n / 9 % 3 - 1, cell[3] + n / 27 - 1};
      const auto found = by_cell_.find(around);
      if (found == by_cell_.end()) continue;
      for (const std::size_t i : found->second)
        if ((all_[i].first - ends).cwiseAbs().maxCoeff() < apart_px_) return &all_[i];
    }
    return nullptr;
  }

  double apart_px_;
  std::vector<Position> all_;
  std::unordered_map<Cell, std::vector<std::size_t>, CellHash> by_cell_;
};

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
    Positions merged(apart_px);
    for (const Position& position : positions) merged.add(position);
    positions = merged.all();
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
