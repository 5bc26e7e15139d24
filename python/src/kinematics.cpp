#include <optional>
#include <string>
#include <vector>

#include "lapservo/control/controller_config.h"
#include "lapservo/control/newton_inverse.h"
#include "lapservo/core/error.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rcm/distinct_lines.h"
#include "lapservo/rcm/projected_rcm.h"
#include "lapservo/servo/image_features.h"
#include "python/src/bindings.h"
#include "python/src/conversions.h"
#include "python/src/observed.h"

namespace lapservo::python {
namespace {
using namespace internal;

// q to image features of a rig's first instrument.
class Kinematics {
 public:
  explicit Kinematics(const Rig& rig) : model_(feature_model(rig)) {
    if (!model_) throw InputError("Kinematics", "camera_from_rcm", "missing", "a rig whose first instrument has one");
  }
  std::optional<Eigen::Vector4d> features(const Array<"q", 4>& q) const {
    const auto state = model_(q.value);
    return state ? std::optional(state->features) : std::nullopt;
  }
  std::optional<Eigen::Matrix4d> jacobian(const Array<"q", 4>& q) const {
    const auto state = model_(q.value);
    return state ? std::optional(state->jacobian) : std::nullopt;
  }
  std::optional<Eigen::Vector4d> inverse(const Array<"features", 4>& features, const Array<"guess", 4>& guess) const {
    const auto found = newton_inverse(model_, features.value, guess.value, Scales{});
    return found && found->converged ? std::optional(found->q) : std::nullopt;
  }

 private:
  FeatureModel model_;
};

RcmEstimate estimate_rcm(const std::vector<Observed>& observations, double common_px) {
  std::vector<LineObservation> lines;
  for (const Observed& seen : observations) {
    const std::string &name = seen.observation.instrument, &first = observations.front().observation.instrument;
    if (name != first)
      throw InputError("estimate_rcm", "observations", "of " + first + " and " + name,
                       "those of one instrument: each has an RCM of its own");
    if (seen.observation.status == Status::ok)
      lines.push_back(line_between(seen.observation.edges_ideal_px[0], seen.observation.edges_ideal_px[3], 1));
  }
  return estimate_projected_rcm(distinct_lines(lines), {NoiseScale::estimated, common_px});
}

std::optional<Eigen::Vector2d> point_of(const RcmEstimate& estimate) {
  return estimate.status == RcmStatus::ok ? std::optional(estimate.point_px) : std::nullopt;
}

}  // namespace

void bind_kinematics(py::module_& m) {
  py::class_<Kinematics>(m, "Kinematics", R"(How the first instrument of a rig appears in the image.

q is float[4]: theta, phi [rad], rho [m], psi [rad]; features are float[4]: s [rad], r, l, d [px], on ideal pixels.)")
      .def(py::init<const Rig&>(), py::arg("rig"))
      .def("features", &Kinematics::features, py::arg("q"), "Eq. 12 to 15; None where the camera sees none.")
      .def("jacobian", &Kinematics::jacobian, py::arg("q"),
           "float[4, 4], d features / d q (eq. 20); None where the camera sees none.")
      .def("inverse", &Kinematics::inverse, py::arg("features"), py::arg("guess"),
           "The q near `guess` that shows these features; None when none is found.");
  m.def(
      "camera_from_marker",
      [](const Instrument& instrument, const Array<"q", 4>& q) {
        if (!instrument.camera_from_rcm)
          throw InputError("camera_from_marker", "camera_from_rcm", "missing", "an instrument that has one");
        const JointVector joints = JointVector::from_vector(q.value);
        return matrix_of(camera_from_marker(instrument.marker, *instrument.camera_from_rcm, joints));
      },
      py::arg("instrument"), py::arg("q"), "float[4, 4], metres: the marker's pose at a configuration.");

  py::class_<RcmEstimate>(m, "RcmEstimate", "Where the lines along an instrument meet: the RCM's image.")
      .def_property_readonly(
          "status", [](const RcmEstimate& e) { return std::string(to_string(e.status)); }, "'ok', or why there is none")
      .def_property_readonly("point_px", read_only<RcmEstimate>(&point_of),
                             "float[2], ideal pixels; None unless status is 'ok'")
      .def_property_readonly("covariance_px2", read_only<RcmEstimate>([](const RcmEstimate& e) {
                               return e.status == RcmStatus::ok ? e.covariance_px2 : std::nullopt;
                             }),
                             "float[2, 2]; None when there are too few lines")
      .def_readonly("lines", &RcmEstimate::lines, "positions that differ")
      .def_readonly("outliers", &RcmEstimate::outliers, "of them")
      .def_readonly("near_parallel", &RcmEstimate::near_parallel, "the estimate is poor along the lines")
      .def_property_readonly("faults", read_only<RcmEstimate>(&RcmEstimate::faults),
                             "tuple[str]: what shows beyond the noise and the covariance counts");
  m.def(
      "estimate_rcm", &estimate_rcm, py::arg("observations"), py::kw_only(), py::arg("common_px") = 0.01,
      "RcmEstimate from one instrument's observations; those that are not ok don't count; InputError for several "
      "instruments'. They must come from a rig without camera_from_rcm, or they show where it has the RCM. common_px: "
      "an error that all share.");
}

}  // namespace lapservo::python
