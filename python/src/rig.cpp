#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "lapservo/core/atomic_file.h"
#include "lapservo/core/error.h"
#include "lapservo/rig/rig_writer.h"
#include "python/src/bindings.h"
#include "python/src/conversions.h"

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
  return py::make_tuple(response.table_light, response.table_value);
}

Camera make_camera(int width_px, int height_px, const Eigen::Matrix3d& matrix, const std::array<double, 5>& distortion,
                   const py::object& response, const std::pair<double, double>& chromatic_aberration, bool deinterlace,
                   std::optional<double> sigma_response) {
  Camera camera;
  if (sigma_response && *sigma_response < 0)
    throw InputError("Camera", "sigma_response", fmt::format("{}", *sigma_response), "a standard deviation or None");
  camera.width_px = width_px;
  camera.height_px = height_px;
  if (matrix(0, 1) != 0 || matrix.row(1)(0) != 0 || matrix.row(2) != Eigen::RowVector3d(0, 0, 1))
    throw InputError("Camera", "matrix", "has other entries", "fx 0 cx; 0 fy cy; 0 0 1");
  camera.fx_px = matrix(0, 0), camera.fy_px = matrix(1, 1);
  camera.cx_px = matrix(0, 2), camera.cy_px = matrix(1, 2);
  camera.distortion = distortion;
  camera.response = response_of(response);
  camera.response.sigma = sigma_response;
  camera.chromatic_aberration = {chromatic_aberration.first, chromatic_aberration.second};
  camera.deinterlace = deinterlace;
  return camera;
}

Eigen::Matrix3d matrix_of_camera(const Camera& camera) {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  matrix(0, 0) = camera.fx_px, matrix(1, 1) = camera.fy_px;
  matrix(0, 2) = camera.cx_px, matrix(1, 2) = camera.cy_px;
  return matrix;
}

py::tuple sigmas_to_python(const CameraSigmas& s) {
  return py::make_tuple(s.fx_px, s.fy_px, s.cx_px, s.cy_px, s.distortion, s.blue, s.red);
}

CameraSigmas sigmas_of(const py::tuple& state) {
  const auto number = [&](std::size_t i) { return state[i].cast<double>(); };
  return {number(0), number(1), number(2), number(3), state[4].cast<std::array<double, 5>>(), number(5), number(6)};
}

void bind_camera(py::module_& m) {
  py::class_<Camera>(m, "Camera", R"(A pinhole camera with plumb_bob distortion, as in a ROS camera_info.

Pixel centres lie at integer coordinates. Raw pixels are those of the image; ideal pixels are undistorted with the same
matrix.)")
      .def(py::init(&make_camera), py::arg("width_px"), py::arg("height_px"), py::arg("matrix"), py::kw_only(),
           py::arg("distortion") = std::array<double, 5>{}, py::arg("response") = py::str("srgb"),
           py::arg("chromatic_aberration") = std::pair(1.0, 1.0), py::arg("deinterlace") = false,
           py::arg("sigma_response") = py::none(),
           "matrix: float[3, 3] in px; distortion: k1 k2 p1 p2 k3; response: 'srgb', 'rec709', 'linear', a power, or "
           "(light, value); chromatic_aberration: magnification of blue and of red beside green's; "
           "sigma_response: of a response that was measured.")
      .def_readonly("width_px", &Camera::width_px)
      .def_readonly("height_px", &Camera::height_px)
      .def_property_readonly("matrix", &matrix_of_camera, "float[3, 3], px")
      .def_readonly("distortion", &Camera::distortion, "k1 k2 p1 p2 k3")
      .def_property_readonly("response", [](const Camera& camera) { return response_to_python(camera.response); })
      .def_property_readonly("chromatic_aberration",
                             [](const Camera& camera) {
                               return std::pair(camera.chromatic_aberration.blue, camera.chromatic_aberration.red);
                             })
      .def_readonly("deinterlace", &Camera::deinterlace)
      .def_property_readonly(
          "sigma_response", [](const Camera& camera) { return camera.response.sigma; },
          "one standard deviation of the response that was measured, of the full value; None where it was not")
      .def(
          "ideal_from_raw",
          [](const Camera& camera, const Eigen::Vector2d& raw_px) { return camera.ideal_from_raw(raw_px); },
          py::arg("raw_px"), "float[2]; None where the distortion can't be inverted.")
      .def(
          "raw_from_ideal",
          [](const Camera& camera, const Eigen::Vector2d& ideal_px) { return camera.raw_from_ideal(ideal_px); },
          py::arg("ideal_px"), "float[2] to float[2]")
      .def(py::pickle(
          [](const Camera& camera) {
            const auto& [blue, red] = camera.chromatic_aberration;
            return py::make_tuple(camera.width_px, camera.height_px, matrix_of_camera(camera), camera.distortion,
                                  response_to_python(camera.response), py::make_tuple(blue, red), camera.deinterlace,
                                  camera.response.sigma, camera.response.sigma_light, camera.response.sigma_value,
                                  sigmas_to_python(camera.sigmas));
          },
          [](const py::tuple& state) {
            Camera camera = make_camera(state[0].cast<int>(), state[1].cast<int>(), state[2].cast<Eigen::Matrix3d>(),
                                        state[3].cast<std::array<double, 5>>(), state[4],
                                        state[5].cast<std::pair<double, double>>(), state[6].cast<bool>(),
                                        state[7].cast<std::optional<double>>());
            camera.response.sigma_light = state[8].cast<std::vector<double>>();
            camera.response.sigma_value = state[9].cast<std::vector<double>>();
            camera.sigmas = sigmas_of(state[10]);
            return camera;
          }))
      .def("__repr__", [](const Camera& camera) {
        return "<lapservo.Camera " + std::to_string(camera.width_px) + " x " + std::to_string(camera.height_px) + ">";
      });
}

Instrument make_instrument(const std::string& name, const Marker& marker,
                           const std::optional<Eigen::Matrix4d>& camera_from_rcm, const std::optional<Joints>& joints,
                           std::optional<double> image_delay_s) {
  Instrument instrument;
  instrument.joints = joints;
  instrument.image_delay_s = image_delay_s;
  instrument.name = name;
  instrument.marker = marker;
  if (camera_from_rcm) instrument.camera_from_rcm = rigid_of(*camera_from_rcm, "camera_from_rcm");
  return instrument;
}

void bind_instrument(py::module_& m) {
  py::class_<Joints>(m, "Joints", R"(The arm's joints behind theta, phi, rho, psi, in this order.

q = sign * joints + offset, rad and m.)")
      .def(py::init([](const std::array<std::string, 4>& names, const std::array<double, 4>& sign,
                       const std::array<double, 4>& offset) {
             for (const double s : sign)
               if (s != 1 && s != -1)
                 throw InputError("Joints", "sign", std::string(py::str(py::float_(s))), "1 or -1");
             return Joints{names, sign, offset};
           }),
           py::arg("names"), py::kw_only(), py::arg("sign") = Joints{}.sign, py::arg("offset") = Joints{}.offset,
           "names: of the four columns of a recording; sign: 1 or -1 each; offset: rad, rad, m, rad.")
      .def_readonly("names", &Joints::names)
      .def_readonly("sign", &Joints::sign)
      .def_readonly("offset", &Joints::offset, "rad, rad, m, rad")
      .def(py::pickle(
          [](const Joints& joints) {
            return py::make_tuple(joints.names, joints.sign, joints.offset, joints.sigma_offset);
          },
          [](const py::tuple& state) {
            return Joints{state[0].cast<std::array<std::string, 4>>(), state[1].cast<std::array<double, 4>>(),
                          state[2].cast<std::array<double, 4>>(),
                          state[3].cast<std::optional<std::array<double, 4>>>()};
          }));
  py::class_<Instrument>(m, "Instrument", "What wears a marker, and where it enters the body.")
      .def(py::init(&make_instrument), py::arg("name"), py::arg("marker"), py::kw_only(),
           py::arg("camera_from_rcm") = py::none(), py::arg("joints") = py::none(),
           py::arg("image_delay_s") = py::none(), "camera_from_rcm: float[4, 4] in metres, or None.")
      .def_readonly("joints", &Instrument::joints, "Joints; None where the rig doesn't say")
      .def_readonly("name", &Instrument::name)
      .def_readonly("marker", &Instrument::marker)
      .def_property_readonly(
          "camera_from_rcm", [](const Instrument& instrument) { return matrix_of(instrument.camera_from_rcm); },
          "float[4, 4], metres; None where the rig doesn't say")
      .def_property_readonly(
          "image_delay_s", [](const Instrument& instrument) { return instrument.image_delay_s; },
          "a frame's stamp minus the joints' clock at its exposure, or None")
      .def("__repr__", [](const Instrument& instrument) { return "<lapservo.Instrument '" + instrument.name + "'>"; });
}

// Who uses it may stand in another folder by then.
Rig with_absolute_camera_file(Rig rig) {
  if (!rig.camera_file.empty()) rig.camera_file = std::filesystem::absolute(rig.camera_file);
  return rig;
}

}  // namespace

void bind_rig(py::module_& m) {
  bind_camera(m);
  // Used as an argument before its own file's turn.
  py::class_<Marker>(m, "Marker", R"(A printed three-colour marker, wrapped around a shaft.

The bands run from proximal to distal; tau is the azimuth on the marker from its seam, right-handed about the axis
towards the tip.)");
  bind_instrument(m);
  py::class_<Rig, std::shared_ptr<Rig>>(m, "Rig", R"(What stands before which camera.

`Rig.load("rig.yaml")`, `Rig.parse(text)`, or `Rig(camera, instruments)`. Everything is checked: errors are InputError
with the field, its value and what was expected.)")
      .def(py::init([](const Camera& camera, const std::vector<Instrument>& instruments) {
             // What can't be said by a type is checked where files are checked.
             return parse_rig(internal::rig_yaml({camera, instruments}), "Rig");
           }),
           py::arg("camera"), py::arg("instruments"))
      .def_static(
          "load", [](const std::filesystem::path& path) { return with_absolute_camera_file(load_rig(path)); },
          py::arg("path"), "Reads a rig's YAML file.")
      .def_static(
          "parse",
          [](const std::string& yaml, const std::filesystem::path& folder) {
            return with_absolute_camera_file(parse_rig(yaml, "rig", folder));
          },
          py::arg("yaml"), py::arg("folder") = ".",
          "The same from text; `folder` is where a camera file is looked for.")
      .def_readonly("camera", &Rig::camera)
      .def_readonly("instruments", &Rig::instruments)
      .def(
          "save",
          [](const Rig& rig, const std::filesystem::path& path) {
            internal::write_file(path, internal::rig_yaml(rig));
          },
          py::arg("path"), "Writes to_yaml(), whole or not at all.")
      .def(
          "to_yaml", [](const Rig& rig) { return internal::rig_yaml(rig); },
          "Text that Rig.parse reads back to the last bit, the camera and all sigmas included.")
      .def(py::pickle([](const Rig& rig) { return py::make_tuple(internal::rig_yaml(rig), rig.camera_file.string()); },
                      [](const py::tuple& state) {
                        Rig rig = parse_rig(state[0].cast<std::string>(), "pickled rig");
                        rig.camera_file = state[1].cast<std::string>();
                        return rig;
                      }))
      .def("__repr__", [](const Rig& rig) {
        std::string names;
        for (const Instrument& instrument : rig.instruments) names += (names.empty() ? "" : ", ") + instrument.name;
        return "<lapservo.Rig of " + names + ">";
      });
}

}  // namespace lapservo::python
