#include "python/src/conversions.h"

#include <cmath>
#include <memory>
#include <string>
#include <string_view>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lapservo/core/error.h"

namespace lapservo::python {

namespace {

std::string type_name(const py::handle& given) {
  return given.is_none() ? "None" : py::str(py::type::handle_of(given).attr("__name__")).cast<std::string>();
}

std::string shape_text(const py::array& array) {
  return fmt::format("[{}]", fmt::join(array.shape(), array.shape() + array.ndim(), ", "));
}

std::string expected_array(int rows, int columns) {
  const std::string count = rows < 0 ? "N" : std::to_string(rows);
  return columns == 1 ? fmt::format("float[{}]", count) : fmt::format("float[{}, {}]", count, columns);
}

using ByRows = py::array_t<double, py::array::c_style | py::array::forcecast>;

ByRows doubles_of(const py::handle& given, const char* argument, const std::string& expected) {
  if (given.is_none()) throw InputError(argument, "type", "None", expected);
  const auto array = py::array::ensure(given);
  if (!array) throw InputError(argument, "type", type_name(given) + " that is no array", expected);
  if (std::string_view("fiu").find(array.dtype().kind()) == std::string_view::npos)
    throw InputError(argument, "dtype", py::str(array.dtype()).cast<std::string>(), expected);
  return array;
}

// One column: at most one dimension is of more than one. Else a matrix, or one of its rows.
bool has_columns(const py::array& array, int columns) {
  const py::ssize_t* begin = array.shape();
  const py::ssize_t* end = begin + array.ndim();
  if (columns == 1) return begin != end && std::count_if(begin, end, [](py::ssize_t n) { return n != 1; }) <= 1;
  return (array.ndim() == 1 || array.ndim() == 2) && end[-1] == columns;
}

// Which Python takes for a number of its unit.
bool is_numpy_time(const py::handle& given) {
  const py::object type = py::getattr(given, "dtype", py::none());
  return py::isinstance<py::dtype>(type) &&
         std::string_view("mM").find(type.cast<py::dtype>().kind()) != std::string_view::npos;
}

}  // namespace

Eigen::MatrixXd numbers_of(const py::handle& given, const char* argument, int rows, int columns, Numbers numbers) {
  const std::string expected = expected_array(rows, columns);
  const ByRows array = doubles_of(given, argument, expected);
  if (!has_columns(array, columns) || (rows >= 0 && array.size() != rows * columns))
    throw InputError(argument, "shape", shape_text(array), expected);
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Eigen::MatrixXd matrix = Eigen::Map<const Matrix>(array.data(), array.size() / columns, columns);
  if (numbers == Numbers::finite && !matrix.allFinite())
    throw InputError(argument, "value", "not finite", expected + " of finite numbers");
  return matrix;
}

std::vector<Eigen::Vector4d> rows_of(const Eigen::Matrix<double, Eigen::Dynamic, 4>& matrix) {
  std::vector<Eigen::Vector4d> rows;
  for (const auto& row : matrix.rowwise()) rows.emplace_back(row.transpose());
  return rows;
}

double number_of(const py::handle& given, const char* argument, Numbers numbers) {
  const std::string expected = numbers == Numbers::finite ? "a finite number" : "a number";
  if (is_numpy_time(given))
    throw InputError(argument, "type", py::str(given.attr("dtype")).cast<std::string>(), expected + " of seconds");
  const double number = PyFloat_AsDouble(given.ptr());
  if (PyErr_Occurred()) {
    PyErr_Clear();
    throw InputError(argument, "type", type_name(given), expected);
  }
  if (numbers == Numbers::finite && !std::isfinite(number))
    throw InputError(argument, "value", fmt::format("{}", number), expected);
  return number;
}

cv::Mat view_of(const py::handle& given, const char* argument) {
  constexpr const char* expected = "uint8[H, W, 3], blue green red, each row's pixels side by side";
  if (!py::isinstance<py::array>(given)) throw InputError(argument, "type", type_name(given), expected);
  const auto array = py::reinterpret_borrow<py::array>(given);
  if (!py::isinstance<Image>(given))
    throw InputError(argument, "dtype", py::str(array.dtype()).cast<std::string>(), expected);
  if (array.ndim() != 3 || array.shape(2) != 3 || array.shape(0) < 1 || array.shape(1) < 1)
    throw InputError(argument, "shape", shape_text(array), expected);
  if (array.strides(2) != 1 || array.strides(1) != 3 || array.strides(0) < 3 * array.shape(1))
    throw InputError(argument, "strides", fmt::format("[{}]", fmt::join(array.strides(), array.strides() + 3, ", ")),
                     std::string(expected) + " (numpy.ascontiguousarray makes it so)");
  // OpenCV has no constant views; nothing that is called with one writes to it.
  return cv::Mat(static_cast<int>(array.shape(0)), static_cast<int>(array.shape(1)), CV_8UC3,
                 const_cast<void*>(array.data()), static_cast<std::size_t>(array.strides(0)));
}

Image array_of(const cv::Mat& bgr) {
  auto held = std::make_unique<cv::Mat>(bgr);
  const cv::Mat& picture = *held;
  const py::capsule owner(held.release(), [](void* mat) { delete static_cast<cv::Mat*>(mat); });
  return Image({picture.rows, picture.cols, 3}, {static_cast<int>(picture.step[0]), 3, 1}, picture.data, owner);
}

py::object read_only(py::object value) {
  if (py::isinstance<py::array>(value)) value.attr("setflags")(py::arg("write") = false);
  if (py::isinstance<py::list>(value) || py::isinstance<py::tuple>(value)) {
    py::list items;
    for (const py::handle item : value) items.append(read_only(py::reinterpret_borrow<py::object>(item)));
    return py::tuple(items);
  }
  if (!py::isinstance<py::dict>(value)) return value;
  py::dict items;
  for (const auto& [key, item] : py::reinterpret_borrow<py::dict>(value))
    items[key] = read_only(py::reinterpret_borrow<py::object>(item));
  return py::module_::import("types").attr("MappingProxyType")(items);
}

Eigen::Matrix4d matrix_of(const Rigid3& a_from_b) {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topLeftCorner<3, 3>() = a_from_b.rotation.toRotationMatrix();
  matrix.topRightCorner<3, 1>() = a_from_b.translation;
  return matrix;
}

Rigid3 rigid_of(const py::handle& a_from_b, const char* argument) {
  constexpr double tolerance = 1e-6;
  const bool upper_rows = py::len_hint(a_from_b) == 3;
  const Eigen::MatrixXd matrix = numbers_of(a_from_b, argument, upper_rows ? 3 : 4, 4);
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  const bool rigid = (upper_rows || matrix.row(3) == Eigen::RowVector4d(0, 0, 0, 1)) &&
                     (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm() < tolerance &&
                     rotation.determinant() > 0;
  if (!rigid)
    throw InputError(argument, "matrix", "no rotation with a translation",
                     "4 x 4 or 3 x 4 with an orthonormal, right-handed rotation (to 1e-6) and the last row 0 0 0 1");
  return {Eigen::Quaterniond(rotation).normalized(), matrix.topRightCorner<3, 1>()};
}

}  // namespace lapservo::python
