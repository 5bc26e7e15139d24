#pragma once
#include <optional>
#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <opencv2/core.hpp>

#include "lapservo/core/joint_vector.h"
#include "lapservo/geometry/rigid3.h"

namespace lapservo::python {
namespace py = pybind11;

/// A picture as numpy has it: uint8[H, W, 3], blue green red.
using Image = py::array_t<std::uint8_t>;

/// The same pixels, not copied: valid as long as the array is. Rows may lie apart, pixels of a row may not. Throws
/// InputError naming `argument` for anything else.
cv::Mat view_of(const Image& image, const char* argument = "image");
/// An array that owns the picture.
Image array_of(const cv::Mat& bgr);

/// A 4 x 4 matrix.
Eigen::Matrix4d matrix_of(const Rigid3& a_from_b);
/// Throws InputError naming `argument` for a matrix that is not a rigid transform to 1e-6.
Rigid3 rigid_of(const Eigen::Matrix4d& a_from_b, const char* argument);

inline std::optional<Eigen::Matrix4d> matrix_of(const std::optional<Rigid3>& a_from_b) {
  return a_from_b ? std::optional(matrix_of(*a_from_b)) : std::nullopt;
}

}  // namespace lapservo::python
