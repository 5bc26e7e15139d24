#include "python/src/conversions.h"

#include <cmath>
#include <memory>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <fmt/format.h>

#include "lapservo/core/error.h"

namespace lapservo::python {

cv::Mat view_of(const Image& image, const char* argument) {
  constexpr const char* expected = "uint8[H, W, 3], blue green red, each row's pixels side by side";
  if (image.ndim() != 3 || image.shape(2) != 3 || image.shape(0) < 1 || image.shape(1) < 1) {
    std::string shape;
    for (py::ssize_t i = 0; i < image.ndim(); ++i) shape += (i ? ", " : "") + std::to_string(image.shape(i));
    throw InputError(argument, "shape", "[" + shape + "]", expected);
  }
  if (image.strides(2) != 1 || image.strides(1) != 3 || image.strides(0) < 3 * image.shape(1))
    throw InputError(argument, "strides",
                     fmt::format("[{}, {}, {}]", image.strides(0), image.strides(1), image.strides(2)),
                     std::string(expected) + " (numpy.ascontiguousarray makes it so)");
  // OpenCV has no constant views; nothing that is called with one writes to it.
  return cv::Mat(static_cast<int>(image.shape(0)), static_cast<int>(image.shape(1)), CV_8UC3,
                 const_cast<std::uint8_t*>(image.data()), static_cast<std::size_t>(image.strides(0)));
}

Image array_of(const cv::Mat& bgr) {
  auto held = std::make_unique<cv::Mat>(bgr);
  const cv::Mat& picture = *held;
  const py::capsule owner(held.release(), [](void* mat) { delete static_cast<cv::Mat*>(mat); });
  return Image({picture.rows, picture.cols, 3}, {static_cast<int>(picture.step[0]), 3, 1}, picture.data, owner);
}

Eigen::Matrix4d matrix_of(const Rigid3& a_from_b) {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topLeftCorner<3, 3>() = a_from_b.rotation.toRotationMatrix();
  matrix.topRightCorner<3, 1>() = a_from_b.translation;
  return matrix;
}

Rigid3 rigid_of(const Eigen::Matrix4d& a_from_b, const char* argument) {
  constexpr double tolerance = 1e-6;
  const Eigen::Matrix3d rotation = a_from_b.topLeftCorner<3, 3>();
  const bool rigid = a_from_b.allFinite() && a_from_b.row(3) == Eigen::RowVector4d(0, 0, 0, 1) &&
                     (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm() < tolerance &&
                     rotation.determinant() > 0;
  if (!rigid)
    throw InputError(argument, "matrix", "no rotation with a translation",
                     "4 x 4 with an orthonormal, right-handed rotation (to 1e-6) and the last row 0 0 0 1");
  return {Eigen::Quaterniond(rotation).normalized(), a_from_b.topRightCorner<3, 1>()};
}

}  // namespace lapservo::python
