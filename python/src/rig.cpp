#include <algorithm>
#include <array>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lapservo/core/atomic_file.h"
#include "lapservo/core/error.h"
#include "lapservo/rig/camera_formats.h"
#include "lapservo/rig/rig_files.h"
#include "lapservo/rig/rig_writer.h"
#include "lapservo/tool/wrist.h"
#include "python/src/bindings.h"
#include "python/src/conversions.h"
#include "python/src/state.h"

namespace lapservo::python {
namespace {

// "srgb", "rec709", "linear", a power, or a table of light and value.
Response response_of(const py::object& given) {
  Response response;
  if (py::isinstance<py::str>(given)) {
    const auto word = given.cast<std::string>();
    if (word == "srgb") return response;
    if (word == "rec709") return {.kind = Response::Kind::rec709};
    if (word == "linear") return {.kind = Response::Kind::power};
    throw InputError("Camera", "response", word, "srgb, rec709, linear, a power or (light, value)");
  }
  if (py::isinstance<py::float_>(given) || py::isinstance<py::int_>(given))
    return {.kind = Response::Kind::power, .gamma = given.cast<double>()};
  auto [light, value] = given.cast<std::pair<std::vector<double>, std::vector<double>>>();
  response.kind = Response::Kind::table;
  response.table_light = std::move(light);
  response.table_value = std::move(value);
  return response;
}

py::object response_to_python(const Response& response) {
  switch (response.kind) {
    case Response::Kind::srgb:
      return py::str("srgb");
    case Response::Kind::rec709:
      return py::str("rec709");
    case Response::Kind::power:
      return py::float_(response.gamma);
    case Response::Kind::table:
      break;
  }
  return read_only(py::make_tuple(response.table_light, response.table_value));
}

std::array<double, 5> distortion_of(const Eigen::VectorXd& given) {
  const std::span coefficients(given.data(), static_cast<std::size_t>(given.size()));
  if (const char* expected = internal::expected_distortion(coefficients))
    throw InputError("Camera", "distortion", fmt::format("[{}]", fmt::join(coefficients, ", ")), expected);
  std::array<double, 5> distortion{};
  std::copy_n(coefficients.begin(), std::min(coefficients.size(), distortion.size()), distortion.begin());
  return distortion;
}

Camera make_camera(int width_px, int height_px, const Array<"matrix", 3, 3>& given_matrix,
                   const Array<"distortion", Eigen::Dynamic>& distortion, const py::object& response,
                   const std::pair<double, double>& chromatic_aberration, bool deinterlace, double readout_s,
                   std::optional<double> sigma_response) {
  Camera camera;
  if (sigma_response && *sigma_response < 0)
    throw InputError("Camera", "sigma_response", fmt::format("{}", *sigma_response), "a standard deviation or None");
  camera.width_px = width_px;
  camera.height_px = height_px;
  const Eigen::Matrix3d& matrix = given_matrix.value;
  if (matrix(0, 1) != 0 || matrix.row(1)(0) != 0 || matrix.row(2) != Eigen::RowVector3d(0, 0, 1))
    throw InputError("Camera", "matrix", "has other entries", "fx 0 cx; 0 fy cy; 0 0 1");
  camera.fx_px = matrix(0, 0), camera.fy_px = matrix(1, 1);
  camera.cx_px = matrix(0, 2), camera.cy_px = matrix(1, 2);
  camera.distortion = distortion_of(distortion.value);
  camera.response = response_of(response);
  camera.response.sigma = sigma_response;
  camera.chromatic_aberration = {chromatic_aberration.first, chromatic_aberration.second};
  camera.deinterlace = deinterlace;
  if (!(std::abs(readout_s) <= Camera::longest_readout_s))
    throw InputError("Camera", "readout_s", fmt::format("{}", readout_s), "-0.1 to 0.1 (seconds)");
  camera.readout_s = readout_s;
  return camera;
}

Eigen::Matrix3d matrix_of_camera(const Camera& camera) {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  matrix(0, 0) = camera.fx_px, matrix(1, 1) = camera.fy_px;
  matrix(0, 2) = camera.cx_px, matrix(1, 2) = camera.cy_px;
  return matrix;
}

void bind_camera(py::module_& m) {
  py::class_<Camera> type(m, "Camera", R"(A pinhole camera with plumb_bob distortion, as in a ROS camera_info.

Pixel centres lie at integer coordinates. Raw pixels are those of the image; ideal pixels are undistorted with the same
matrix.)");
  bind_state(type);
  type.def(py::init(&make_camera), py::arg("width_px"), py::arg("height_px"), py::arg("matrix"), py::kw_only(),
           py::arg("distortion") = std::array<double, 5>{}, py::arg("response") = py::str("srgb"),
           py::arg("chromatic_aberration") = std::pair(1.0, 1.0), py::arg("deinterlace") = false,
           py::arg("readout_s") = 0.0, py::arg("sigma_response") = py::none(),
           "matrix: float[3, 3] in px; distortion: k1 k2 p1 p2 k3 as OpenCV has them (k3 or all may be left out, zeros "
           "may follow); response: 'srgb', 'rec709', 'linear', a power, or (light, value); chromatic_aberration: "
           "magnification of blue and of red beside green's; readout_s: of a rolling shutter, from the first row's "
           "exposure "
           "to the last one's; sigma_response: of a response that was measured.")
      .def_readonly("width_px", &Camera::width_px)
      .def_readonly("height_px", &Camera::height_px)
      .def_property_readonly("matrix", read_only<Camera>(&matrix_of_camera), "float[3, 3], px")
      .def_property_readonly("distortion", read_only<Camera>(&Camera::distortion), "k1 k2 p1 p2 k3")
      .def_property_readonly("response", [](const Camera& camera) { return response_to_python(camera.response); })
      .def_property_readonly("chromatic_aberration",
                             [](const Camera& camera) {
                               return std::pair(camera.chromatic_aberration.blue, camera.chromatic_aberration.red);
                             })
      .def_readonly("deinterlace", &Camera::deinterlace)
      .def_readonly("readout_s", &Camera::readout_s)
      .def_property_readonly(
          "sigma_response", [](const Camera& camera) { return camera.response.sigma; },
          "one standard deviation of the response that was measured, of the full value; None where it was not")
      .def(
          "ideal_from_raw",
          [](const Camera& camera, const Array<"raw_px", 2>& raw_px) { return camera.ideal_from_raw(raw_px.value); },
          py::arg("raw_px"), "float[2]; None where the distortion can't be inverted.")
      .def(
          "raw_from_ideal",
          [](const Camera& camera, const Array<"ideal_px", 2>& ideal_px) {
            return camera.raw_from_ideal(ideal_px.value);
          },
          py::arg("ideal_px"), "float[2] to float[2]")
      .def("__repr__", [](const Camera& camera) {
        return "<lapservo.Camera " + std::to_string(camera.width_px) + " x " + std::to_string(camera.height_px) + ">";
      });
}

Instrument make_instrument(const std::string& name, const Marker& marker,
                           const std::optional<Pose<"camera_from_rcm">>& camera_from_rcm,
                           const std::optional<Joints>& joints, std::optional<double> image_delay_s) {
  Instrument instrument;
  instrument.joints = joints;
  instrument.image_delay_s = image_delay_s;
  instrument.name = name;
  instrument.marker = marker;
  if (camera_from_rcm) instrument.camera_from_rcm = camera_from_rcm->value;
  return instrument;
}

void bind_instrument(py::module_& m) {
  py::class_<Joints> joints_type(m, "Joints", R"(The arm's joints behind theta, phi, rho, psi, in this order.

q = sign * joints + offset, rad and m.)");
  joints_type
      .def(py::init([](const std::array<std::string, 4>& names, const Array<"sign", 4>& sign,
                       const Array<"offset", 4>& offset) {
             for (const double s : sign.value)
               if (s != 1 && s != -1)
                 throw InputError("Joints", "sign", std::string(py::str(py::float_(s))), "1 or -1");
             return Joints{names, std_array(sign), std_array(offset)};
           }),
           py::arg("names"), py::kw_only(), py::arg("sign") = Joints{}.sign, py::arg("offset") = Joints{}.offset,
           "names: of the four columns of a recording; sign: 1 or -1 each; offset: rad, rad, m, rad.")
      .def_property_readonly("names", read_only<Joints>(&Joints::names))
      .def_property_readonly("sign", read_only<Joints>(&Joints::sign))
      .def_property_readonly("offset", read_only<Joints>(&Joints::offset), "rad, rad, m, rad")
      .def("__repr__",
           [](const Joints& joints) { return fmt::format("<lapservo.Joints {}>", fmt::join(joints.names, ", ")); });
  bind_state(joints_type);
  py::class_<Instrument> type(m, "Instrument", "An instrument with a marker, and the place where it enters the body.");
  bind_state(type);
  type.def(py::init(&make_instrument), py::arg("name"), py::arg("marker"), py::kw_only(),
           py::arg("camera_from_rcm") = py::none(), py::arg("joints") = py::none(),
           py::arg("image_delay_s") = py::none(), "camera_from_rcm: float[4, 4] or float[3, 4] in metres, or None.")
      .def_readonly("joints", &Instrument::joints, "Joints; None where the rig doesn't say")
      .def_readonly("name", &Instrument::name)
      .def_readonly("marker", &Instrument::marker)
      .def_property_readonly("camera_from_rcm", read_only<Instrument>([](const Instrument& instrument) {
                               return matrix_of(instrument.camera_from_rcm);
                             }),
                             "float[4, 4], metres; None where the rig doesn't say")
      .def_property_readonly(
          "image_delay_s", [](const Instrument& instrument) { return instrument.image_delay_s; },
          "a frame's stamp minus the joints' clock at its exposure, or None")
      .def_property_readonly(
          "wrist_joints",
          read_only<Instrument>([](const Instrument& instrument) { return internal::wrist_names(instrument.tool); }),
          "tuple[str]: the joints of the tool's wrist, in the order of Tracker.set_wrist; empty for a straight tool")
      .def("__repr__", [](const Instrument& instrument) { return "<lapservo.Instrument '" + instrument.name + "'>"; });
}

}  // namespace

Rig with_absolute_files(Rig rig) {
  internal::each_file(rig, [](auto& file) { file = std::filesystem::absolute(file); });
  return rig;
}

void bind_rig(py::module_& m) {
  bind_camera(m);
  // Used as an argument before its own file's turn.
  py::class_<Marker> marker(m, "Marker", R"(A printed three-colour marker, wrapped around a shaft.

The bands run from proximal to distal; tau is the azimuth on the marker from its seam, right-handed about the axis
towards the tip.)");
  bind_state(marker);
  py::class_<WristJoint> wrist_joint(m, "WristJoint", "A joint of a tool's wrist, as a rig's pickle holds it.");
  bind_state(wrist_joint);
  wrist_joint.def_readonly("name", &WristJoint::name);
  bind_instrument(m);
  py::class_<Rig, std::shared_ptr<Rig>> type(m, "Rig", R"(What stands before which camera.

`Rig.load("rig.yaml")`, `Rig.parse(text)`, or `Rig(camera, instruments)`. Everything is checked: errors are InputError
with the field, its value and what was expected. A rig and its parts can't be changed: another one is made of copies of
its arrays and tuples.)");
  bind_state(type);
  type.def(py::init([](const Camera& camera, const std::vector<Instrument>& instruments) {
             // The checks of files apply to values, too.
             return parse_rig(internal::rig_yaml({camera, instruments}), "Rig");
           }),
           py::arg("camera"), py::arg("instruments"))
      .def_static(
          "load", [](const std::filesystem::path& path) { return with_absolute_files(load_rig(path)); },
          py::arg("path"), "Reads a rig's YAML file.")
      .def_static(
          "parse",
          [](const std::string& yaml, const std::filesystem::path& folder) {
            return with_absolute_files(parse_rig(yaml, "rig", folder));
          },
          py::arg("yaml"), py::arg("folder") = ".",
          "The same from text; `folder` is where a camera file is looked for.")
      .def_readonly("camera", &Rig::camera)
      .def_property_readonly("instruments", read_only<Rig>(&Rig::instruments))
      .def(
          "save",
          [](const Rig& rig, const std::filesystem::path& path) {
            internal::refuse_rig_over_part(path);
            internal::write_file(path, internal::rig_yaml(rig));
          },
          py::arg("path"), "Writes to_yaml(), whole or not at all; never over the file of a camera or a tool.")
      .def(
          "to_yaml", [](const Rig& rig) { return internal::rig_yaml(rig); },
          "Text that Rig.parse reads back to the last bit, the camera and all sigmas included.")
      .def("__repr__", [](const Rig& rig) {
        std::string names;
        for (const Instrument& instrument : rig.instruments) names += (names.empty() ? "" : ", ") + instrument.name;
        return "<lapservo.Rig of " + names + ">";
      });
}

}  // namespace lapservo::python
