#pragma once
#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <functional>
#include <optional>
#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/geometry/rigid3.h"
#include "lapservo/rig/rig.h"

namespace lapservo::python {
namespace py = pybind11;

/// With the files that it names by absolute paths: who uses it may stand in another folder by then.
Rig with_absolute_files(Rig rig);

/// An image as numpy has it: uint8[H, W, 3], blue green red.
using Image = py::array_t<std::uint8_t>;

/// The same pixels, not copied: valid as long as the array is. Rows may lie apart, pixels of a row may not. Throws
/// InputError naming `argument` for anything else.
cv::Mat view_of(const py::handle& image, const char* argument);
/// Does what does not need Python while its other threads run.
template <typename Job>
auto unlocked(Job job) {
  const py::gil_scoped_release others_run;
  return job();
}

/// Ctrl-C ends a wait as an exception of Python's, in a thread that may have let others run; else false.
inline bool is_interrupted() {
  const py::gil_scoped_acquire mine;
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  return false;
}

/// An array that owns the image.
Image array_of(const cv::Mat& bgr);

/// A value as an attribute gives it, which is a copy: a change of it would be lost. Arrays can't be written, lists are
/// tuples, dicts are mappings that can't be written.
py::object read_only(py::object value);
/// The getter of such an attribute. `read`: a function of what has it, or its member.
template <typename Self, typename Read>
auto read_only(Read read) {
  return [read](const Self& self) { return read_only(py::cast(std::invoke(read, self))); };
}

/// A 4 x 4 matrix.
Eigen::Matrix4d matrix_of(const Rigid3& a_from_b);
inline std::optional<Eigen::Matrix4d> matrix_of(const std::optional<Rigid3>& a_from_b) {
  return a_from_b ? std::optional(matrix_of(*a_from_b)) : std::nullopt;
}
/// The transform of a 4 x 4 matrix, or of its upper three rows. Throws InputError naming `argument` unless it is rigid
/// to 1e-6.
Rigid3 rigid_of(const py::handle& a_from_b, const char* argument);

enum class Numbers { finite, any };
/// Converts anything that numpy makes an array of. Eigen::Dynamic rows: any number. One column: the array may be a row,
/// a column or one-dimensional; a row alone is a matrix of one row. Throws InputError naming `argument`.
Eigen::MatrixXd numbers_of(const py::handle& given, const char* argument, int rows, int columns,
                           Numbers numbers = Numbers::finite);
/// Rows of a matrix of four columns.
std::vector<Eigen::Vector4d> rows_of(const Eigen::Matrix<double, Eigen::Dynamic, 4>& matrix);
/// Throws InputError naming `argument`, also for numpy's times.
double number_of(const py::handle& given, const char* argument, Numbers numbers = Numbers::finite);

/// An argument's name, as an argument of the templates below.
template <std::size_t N>
struct Name {
  constexpr Name(const char (&given)[N]) { std::copy_n(given, N, text); }  // NOLINT(*-explicit-*): of a literal
  char text[N] = {};  // NOLINT(*-c-arrays): std::array would need the literal's length twice
};

// Types of arguments. Each is what Python gives, converted by the function above that throws InputError, in one line,
// where pybind11's own casters make it list all overloads and all that was given.
template <Name name, int Rows, int Columns = 1, Numbers numbers = Numbers::finite>
struct Array {
  Eigen::Matrix<double, Rows, Columns> value;
  static constexpr auto type = py::detail::const_name("ArrayLike");
  static Array of(const py::handle& given) { return {numbers_of(given, name.text, Rows, Columns, numbers)}; }
};
template <Name name>
struct Pose {
  Rigid3 value;
  static constexpr auto type = py::detail::const_name("ArrayLike");
  static Pose of(const py::handle& given) { return {rigid_of(given, name.text)}; }
};
template <Name name, Numbers numbers = Numbers::finite>
struct Number {
  double value = 0;
  static constexpr auto type = py::detail::const_name("float");
  static Number of(const py::handle& given) { return {number_of(given, name.text, numbers)}; }
};
template <Name name>
struct Picture {
  py::object kept;
  cv::Mat bgr;  ///< of `kept`
  static constexpr auto type = py::detail::const_name("numpy.ndarray[numpy.uint8]");
  static Picture of(const py::handle& given) {
    return {py::reinterpret_borrow<py::object>(given), view_of(given, name.text)};
  }
};

/// Their pybind11::type_caster.
template <typename Argument>
struct ArgumentCaster {
  static constexpr auto name = Argument::type;
  template <typename>
  using cast_op_type = const Argument&;
  operator const Argument&() const { return value; }
  bool load(py::handle given, bool) {
    value = Argument::of(given);
    return true;
  }
  Argument value;
};

template <Name name, int Size>
std::array<double, Size> std_array(const Array<name, Size>& given) {
  std::array<double, Size> numbers;
  std::copy_n(given.value.data(), Size, numbers.begin());
  return numbers;
}

}  // namespace lapservo::python

namespace pybind11::detail {
template <typename Argument>
requires requires(handle given) {
  { Argument::of(given) } -> std::same_as<Argument>;
}
struct type_caster<Argument> : lapservo::python::ArgumentCaster<Argument> {};
}  // namespace pybind11::detail
