#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"
#include "lapservo/testing/markers.h"
#include "lapservo/vision/model/print_evidence.h"

namespace lapservo::internal::print_doubt_test {

struct Line {
  std::size_t boundary;
  double weight;
  PrintVector row;  // px/mm
};

const Marker example = testing::marker_with({0.0035, 0.0035, 0.017}, {0.0095, 0.0095, 0.005});

// Measurements of the boundaries' parts between these turn fractions.
std::vector<Line> random_lines(Random& random, double first, double last) {
  std::vector<Line> lines;
  for (std::size_t k = 0; k < errors_of_boundary.size(); ++k)
    for (int i = 0; i < 12; ++i) {
      const double turn_fraction = random.uniform(first, last), px_per_mm = random.uniform(8, 12);
      PrintVector row = PrintVector::Zero();
      row[errors_of_boundary[k][0]] += px_per_mm * (1 - turn_fraction);
      row[errors_of_boundary[k][1]] += px_per_mm * turn_fraction;
      lines.push_back({k, random.uniform(1, 9), row});
    }
  return lines;
}

// Weighted mean square of what a print's errors move a boundary's measurements by.
double mean_square_px2(const std::vector<Line>& lines, std::size_t boundary, const PrintVector& errors_mm) {
  double sum = 0, weights = 0;
  for (const Line& line : lines) {
    if (line.boundary != boundary) continue;
    sum += line.weight * std::pow(line.row.dot(errors_mm), 2), weights += line.weight;
  }
  return sum / weights;
}

struct Sums {
  PrintMatrix squares = PrintMatrix::Zero();
  std::array<double, 4> weights{};
  explicit Sums(const std::vector<Line>& lines) {
    for (const Line& line : lines) {
      squares += line.weight * line.row * line.row.transpose();
      weights[line.boundary] += line.weight;
    }
  }
};

TEST(PrintDoubt, MovesEachBoundaryByAsMuchAsIsDoubted) {
  Random random(1);
  const auto lines = random_lines(random, 0.3, 0.8);
  const Sums sums(lines);
  const PrintDoubt doubt{0.3, 0.7, 0};
  const PrintShapes shapes = shapes_of(doubt, sums.squares, sums.weights, example);
  for (std::size_t k = 0; k < 4; ++k) {
    double moved = 0;
    for (const PrintVector& shape : shapes) moved += mean_square_px2(lines, k, shape);
    const bool leans = k == 1 || k == 2;
    EXPECT_NEAR(moved, 0.3 * 0.3 + (leans ? 0.7 * 0.7 : 0), 1e-9) << "boundary " << k;
  }
}

TEST(PrintDoubt, OfTheLengthLeavesTheCrossRatioAlone) {
  const PrintDoubt doubt{0, 0, 0.01};
  const PrintVector longer_mm = shapes_of(doubt, PrintMatrix::Zero(), {}, example)[0];
  for (const int edge : {0, 1}) {
    const auto along_m = boundaries_m(example, edge * 0.999999 * example.covered_rad());
    for (std::size_t k = 0; k < 4; ++k)
      EXPECT_NEAR(longer_mm[errors_of_boundary[k][static_cast<std::size_t>(edge)]], 10 * along_m[k], 1e-4);
  }
}

TEST(PrintDoubt, DoubtsNothingOfWhatIsNotSeen) {
  Random random(2);
  auto lines = random_lines(random, 0, 1);
  std::erase_if(lines, [](const Line& line) { return line.boundary == 2; });
  const Sums sums(lines);
  for (const PrintVector& shape : shapes_of({0.3, 0.7, 0}, sums.squares, sums.weights, example)) {
    EXPECT_TRUE(shape.allFinite());
    EXPECT_EQ(shape[3], 0);
    EXPECT_EQ(shape[4], 0);
  }
}

}  // namespace lapservo::internal::print_doubt_test
