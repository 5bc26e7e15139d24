#include "lapservo/marker/marker.h"

#include <string>

#include "lapservo/core/error.h"
#include "lapservo/marker/decoder.h"
#include "lapservo/marker/design.h"
#include "lapservo/marker/drawing.h"
#include "lapservo/marker/sensitivity.h"
#include "python/src/bindings.h"
#include "python/src/conversions.h"

namespace lapservo::python {
namespace {
using namespace internal;

Marker make_marker(double diameter_m, const Array<"bands_upper_m", 3>& bands_upper_m,
                   const Array<"bands_lower_m", 3>& bands_lower_m, const Array<"hues_deg", 3>& hues_deg,
                   double seam_rad, double tolerance_m, double wrap_m, double skew_m, double gap_rad) {
  Marker marker;
  marker.diameter_m = diameter_m;
  marker.bands_upper_m = std_array(bands_upper_m), marker.bands_lower_m = std_array(bands_lower_m);
  marker.hues_deg = std_array(hues_deg);
  marker.seam_rad = seam_rad;
  marker.tolerance_m = tolerance_m;
  marker.wrap_m = wrap_m, marker.skew_m = skew_m, marker.gap_rad = gap_rad;
  return decodable(marker, "Marker");
}

Paper paper_of(const std::string& word) {
  if (word == "a4") return Paper::a4;
  if (word == "letter") return Paper::letter;
  throw InputError("print_marker", "paper", word, "a4 or letter");
}

py::object sigmas_of(const Marker& marker) {
  py::dict sigmas;
  const auto add = [&](const char* name, const auto& sigma) {
    if (sigma) sigmas[name] = py::cast(*sigma);
  };
  const MarkerSigmas& s = marker.sigmas;
  add("diameter_m", s.diameter_m), add("hues_deg", s.hues_deg);
  add("bands_upper_m", s.bands_upper_m), add("bands_lower_m", s.bands_lower_m);
  add("seam_rad", s.seam_rad), add("wrap_m", s.wrap_m), add("skew_m", s.skew_m), add("gap_rad", s.gap_rad);
  add("tolerance_m", s.tolerance_m);
  return read_only(sigmas);
}

}  // namespace

void bind_marker(py::module_& m) {
  auto type = py::reinterpret_borrow<py::class_<Marker>>(m.attr("Marker"));
  const Marker usual;
  type.def(py::init(&make_marker), py::kw_only(), py::arg("diameter_m"), py::arg("bands_upper_m"),
           py::arg("bands_lower_m"), py::arg("hues_deg") = usual.hues_deg, py::arg("seam_rad") = 0.0,
           py::arg("tolerance_m") = 0.0, py::arg("wrap_m") = 0.0, py::arg("skew_m") = 0.0, py::arg("gap_rad") = 0.0,
           "Lengths in metres: of the bands at tau = 0 and at the print's other end. InputError for what is no marker "
           "or can't be decoded.")
      .def_readonly("diameter_m", &Marker::diameter_m)
      .def_property_readonly("hues_deg", read_only<Marker>(&Marker::hues_deg))
      .def_property_readonly("bands_upper_m", read_only<Marker>(&Marker::bands_upper_m))
      .def_property_readonly("bands_lower_m", read_only<Marker>(&Marker::bands_lower_m))
      .def_readonly("seam_rad", &Marker::seam_rad)
      .def_readonly("tolerance_m", &Marker::tolerance_m)
      .def_readonly("wrap_m", &Marker::wrap_m)
      .def_readonly("skew_m", &Marker::skew_m)
      .def_readonly("gap_rad", &Marker::gap_rad)
      .def_property_readonly("sigmas", &sigmas_of,
                             "mapping of one standard deviation each, of those of its numbers that were measured")
      .def_property_readonly("length_m", &Marker::length_m)
      .def("boundaries_m", &boundaries_m, py::arg("tau_rad"),
           "e0 to e3 along the axis from the proximal end at tau = 0")
      .def("cross_ratio", &cross_ratio_at, py::arg("tau_rad"), "of the boundaries at an azimuth (eq. 17)")
      .def(
          "decode", [](const Marker& self, double cross_ratio) { return CrossRatioDecoder(self).tau_rad(cross_ratio); },
          py::arg("cross_ratio"), "tau from a cross-ratio (eq. 18)")
      .def(
          "predicted_sigma_rad",
          [](const Marker& self, double tau_rad, double focal_px, double distance_m, double sigma_edge_px) {
            return predicted_sigma_surface_rad(self, tau_rad, {focal_px, distance_m, sigma_edge_px});
          },
          py::arg("tau_rad"), py::arg("focal_px") = Viewing{}.focal_px, py::arg("distance_m") = Viewing{}.distance_m,
          py::arg("sigma_edge_px") = Viewing{}.sigma_edge_px,
          "of tau, from all that is visible head on: the Cramer-Rao bound")
      .def("__repr__", [](const Marker& self) {
        return "<lapservo.Marker of " + std::to_string(1e3 * self.diameter_m).substr(0, 5) + " mm, " +
               std::to_string(1e3 * self.length_m()).substr(0, 5) + " mm long>";
      });
  m.def("_marker_picture", [](const std::filesystem::path& path, const Marker& marker) {
    write_marker_picture(path, "marker", marker, Viewing{});
  });
  m.def(
      "design_marker",
      [](double diameter_m, std::optional<double> length_m, std::optional<double> min_band_m,
         const Array<"hues_deg", 3>& hues_deg, double focal_px, double distance_m, double print_error_m) {
        DesignSpec spec;
        spec.diameter_m = diameter_m;
        spec.length_m = length_m, spec.min_band_m = min_band_m;
        spec.hues_deg = std_array(hues_deg);
        spec.viewing.focal_px = focal_px, spec.viewing.distance_m = distance_m;
        spec.print_error_m = print_error_m;
        return unlocked([&] { return design_marker(spec); });
      },
      py::arg("diameter_m"), py::kw_only(), py::arg("length_m") = py::none(), py::arg("min_band_m") = py::none(),
      py::arg("hues_deg") = usual.hues_deg, py::arg("focal_px") = Viewing{}.focal_px,
      py::arg("distance_m") = Viewing{}.distance_m, py::arg("print_error_m") = 0.0,
      "The marker with the smallest worst-case sigma of the roll, for a shaft and a camera. Default length: three "
      "diameters; InputError when none fits.");
  m.def(
      "print_marker",
      [](const std::filesystem::path& path, const Marker& marker, const std::string& instrument,
         const std::string& paper,
         int copies) { write_print_sheet(path, instrument, marker, paper_of(paper), copies); },
      py::arg("path"), py::arg("marker"), py::kw_only(), py::arg("instrument") = "instrument", py::arg("paper") = "a4",
      py::arg("copies") = 4, "A sheet at true scale with cut lines and rulers: SVG or PDF by the name's ending.");
}

}  // namespace lapservo::python
