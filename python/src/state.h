#pragma once
#include <concepts>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>

#include "lapservo/io/frame_source.h"
#include "lapservo/rig/rig.h"
#include "lapservo/vision/observation.h"
#include "python/src/conversions.h"

// Copies, pickles and comparisons of values, by their members.
namespace lapservo::python {

struct Members {
  static auto of(Rigid3& v) { return std::tie(v.rotation.coeffs(), v.translation); }
  static auto of(JointVector& v) { return std::tie(v.theta_rad, v.phi_rad, v.rho_m, v.psi_rad); }
  static auto of(CameraSigmas& v) { return std::tie(v.fx_px, v.fy_px, v.cx_px, v.cy_px, v.distortion, v.blue, v.red); }
  static auto of(ChromaticAberration& v) { return std::tie(v.blue, v.red); }
  static auto of(Response& v) {
    return std::tie(v.kind, v.gamma, v.table_light, v.table_value, v.sigma, v.sigma_light, v.sigma_value);
  }
  static auto of(Camera& v) {
    return std::tie(v.width_px, v.height_px, v.fx_px, v.fy_px, v.cx_px, v.cy_px, v.distortion, v.response,
                    v.deinterlace, v.readout_s, v.chromatic_aberration, v.sigmas, v.covariance);
  }
  static auto of(MarkerSigmas& v) {
    return std::tie(v.diameter_m, v.hues_deg, v.bands_upper_m, v.bands_lower_m, v.seam_rad, v.wrap_m, v.skew_m,
                    v.gap_rad, v.tolerance_m);
  }
  static auto of(Marker& v) {
    return std::tie(v.diameter_m, v.hues_deg, v.bands_upper_m, v.bands_lower_m, v.seam_rad, v.tolerance_m, v.wrap_m,
                    v.skew_m, v.gap_rad, v.sigmas);
  }
  static auto of(Joints& v) { return std::tie(v.names, v.sign, v.offset, v.sigma_offset); }
  static auto of(WristJoint& v) {
    return std::tie(v.name, v.alpha_rad, v.a_m, v.theta_rad, v.d_m, v.offset_rad, v.sigma_reading_rad);
  }
  static auto of(Tool::Place& v) { return std::tie(v.base_in_marker_m, v.azimuth_rad, v.covariance); }
  static auto of(Tool& v) { return std::tie(v.wrist, v.last_from_tip, v.snake_like, v.place, v.file); }
  static auto of(Instrument& v) {
    return std::tie(v.name, v.marker, v.camera_from_rcm, v.joints, v.image_delay_s, v.sigma_translation_m,
                    v.sigma_quaternion_xyzw, v.registration_covariance, v.sigma_image_delay_s, v.tool);
  }
  static auto of(Rig& v) { return std::tie(v.camera, v.instruments, v.camera_file); }
  static auto of(Observation::Rcm& v) { return std::tie(v.q, v.covariance); }
  static auto of(Observation::MarkerPose& v) {
    return std::tie(v.camera_from_marker, v.sigma_xy_m, v.sigma_z_m, v.sigma_axis_rad, v.sigma_roll_rad, v.covariance);
  }
  static auto of(Observation::Tip& v) {
    return std::tie(v.camera_from_tip, v.covariance, v.sigma_shaft_m, v.sigma_place_m, v.sigma_readings_m);
  }
  static auto of(Observation::Refused& v) {
    return std::tie(v.what, v.camera_from_unrolled, v.psi_rad, v.edges_raw_px);
  }
  static auto of(Features& v) { return std::tie(v.s_rad, v.r_px, v.l_px, v.d_px, v.cross_ratio); }
  static auto of(Observation& v) {
    return std::tie(v.status, v.instrument, v.rcm, v.marker, v.tau_rad, v.sigma_tau_rad, v.edges_ideal_px,
                    v.edges_raw_px, v.edges_covariance_px2, v.features, v.camera_from_unrolled, v.psi_rad, v.p_false,
                    v.refused, v.tip);
  }
  static auto of(Frame& v) { return std::tie(v.bgr, v.index, v.time_s, v.file, v.flaw, v.deinterlaced, v.is_srgb); }
};

template <typename T>
concept HasMembers = requires(T& value) {
  Members::of(value);
};
template <typename T>
constexpr bool is_optional = false;
template <typename T>
constexpr bool is_optional<std::optional<T>> = true;

/// The state in types that pickle knows: tuples, numbers, texts, arrays.
template <typename T>
py::object state_of(T value) {
  if constexpr (HasMembers<T>) {
    return std::apply([](const auto&... all) { return py::make_tuple(state_of(all)...); }, Members::of(value));
  } else if constexpr (is_optional<T>) {
    return value ? state_of(*value) : py::none();
  } else if constexpr (std::is_enum_v<T>) {
    return py::int_(static_cast<int>(value));
  } else if constexpr (std::same_as<T, cv::Mat>) {
    return array_of(value);
  } else if constexpr (std::same_as<T, std::filesystem::path>) {
    return py::str(value.string());  // Python's empty path is "."
  } else {
    return py::cast(std::move(value));
  }
}

template <typename T>
void set_state(const py::handle& state, T& value) {
  if constexpr (HasMembers<T>) {
    const auto all = py::reinterpret_borrow<py::tuple>(state);
    std::size_t i = 0;
    std::apply([&](auto&... each) { (set_state(all[i++], each), ...); }, Members::of(value));
  } else if constexpr (is_optional<T>) {
    if (state.is_none()) return;
    typename T::value_type held{};
    set_state(state, held);
    value = std::move(held);
  } else if constexpr (std::is_enum_v<T>) {
    value = static_cast<T>(state.cast<int>());
  } else if constexpr (std::same_as<T, cv::Mat>) {
    value = view_of(state, "state").clone();
  } else if constexpr (std::same_as<T, std::filesystem::path>) {
    value = state.cast<std::string>();
  } else {
    value = state.cast<T>();
  }
}

template <typename T>
bool equal(T a, T b) {
  if constexpr (std::equality_comparable<T>) {
    return a == b;
  } else if constexpr (is_optional<T>) {
    return a && b ? equal(*a, *b) : !a && !b;
  } else if constexpr (std::same_as<T, cv::Mat>) {
    return a.size() == b.size() && cv::norm(a, b, cv::NORM_INF) == 0;
  } else {
    return std::apply(
        [&](const auto&... of_a) {
          return std::apply([&](const auto&... of_b) { return (equal(of_a, of_b) && ...); }, Members::of(b));
        },
        Members::of(a));
  }
}

/// Equal for values that are ==.
inline py::ssize_t hash_of(const py::object& self) {
  return py::hash(py::repr(self));
}

/// Pickles, which make copies too, and ==.
template <typename T, typename... Options>
void bind_state(py::class_<T, Options...>& type) {
  type.def(py::pickle([](const T& value) { return py::tuple(state_of(value)); },
                      [](const py::tuple& state) {
                        T value;
                        set_state(state, value);
                        return value;
                      }))
      .def(
          "__eq__", [](const T& a, const T& b) { return equal(a, b); }, py::is_operator())
      .def("__hash__", &hash_of);
}

}  // namespace lapservo::python
