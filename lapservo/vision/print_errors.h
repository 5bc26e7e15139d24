#pragma once

#include <array>

#include <Eigen/Core>

namespace lapservo::internal {

/// Where a print's boundaries may lie elsewhere than the rig says [mm, distal]: e0, e1 at both edges of the print, e2
/// at both edges, e3: the ends are circles.
inline constexpr int print_errors = 6;
using PrintVector = Eigen::Matrix<double, print_errors, 1>;
using PrintMatrix = Eigen::Matrix<double, print_errors, print_errors>;

/// Which of them boundary 0..3 has at its upper and at its lower edge (tau = 0 and tau -> 2 pi).
inline constexpr std::array<std::array<int, 2>, 4> errors_of_boundary{{{0, 0}, {1, 2}, {3, 4}, {5, 5}}};

}  // namespace lapservo::internal
