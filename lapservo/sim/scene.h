#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "lapservo/geometry/rigid3.h"
#include "lapservo/marker/marker.h"
#include "lapservo/tool/tool.h"

namespace lapservo {

/// Linear light, b g r as in images.
using Light = Eigen::Vector3f;

/// Light beside the camera: two lamps, an even ambient part, and a glossy film. The defaults are fitted to the
/// ray-traced sample frames: 4 % rms over the marker, from 70 to 130 mm.
struct Lighting {
  std::array<Eigen::Vector3d, 2> lamps_in_camera_m{Eigen::Vector3d(-0.003, -0.001, 0),
                                                   Eigen::Vector3d(0.003, -0.001, 0)};
  float diffuse = 0.92F;  ///< of both lamps together, facing them at `reference_m`
  float ambient = 0;
  float specular = 0.23F;
  float specular_exponent = 33;  ///< Blinn-Phong
  double reference_m = 0.1;      ///< lamps fade with the distance x as 2 / (1 + (x / reference)^2)
};

/// Blood on the marker: discs on its surface.
struct Blotch {
  double azimuth_rad, along_m, radius_m;  ///< azimuth on the marker (tau)
};

/// A print on the film in the place of the bands: cells, dark or bright, row by row. Rows go round from tau = 0,
/// columns along from the proximal end, all of one size.
struct PrintedCells {
  int rows = 0, columns = 0;
  std::vector<std::uint8_t> dark;  ///< rows * columns; 0: bright
  static constexpr float bright_reflectance = 0.6F, dark_reflectance = 0.03F;
};

/// A shaft with its marker as a physical thing: the print on a film around a thinner grey shaft with a rounded tip.
struct ShaftModel {
  Marker marker;
  double film_m = 0.1e-3;
  float shaft_reflectance = 0.023F;
  double shaft_before_m = 0.3;    ///< length of shaft shown on the proximal side
  double shaft_beyond_m = 0.012;  ///< and on the distal side, before the tip
  std::vector<Blotch> blotches;
  PrintedCells cells{};        ///< none: the marker's bands
  std::optional<Tool> tool{};  ///< with its place: links, of a wrist with a closed jaw, from the shaft's end to the tip

  double tip_radius_m() const { return 1.05 * marker.radius_m(); }
};

/// Where one instrument is.
struct ShaftPlacement {
  Rigid3 camera_from_unrolled;  ///< z along the axis, origin at the marker's proximal end
  double psi_rad = 0;
  bool covered = false;             ///< something dark lies over the whole marker
  std::vector<double> wrist_rad{};  ///< readings of the tool's wrist; empty: all 0
};

/// The noise of the camera's sensor, in linear light with 1 at white.
struct Sensor {
  double blur_px = 0.8;
  double read_noise = 0.0036;
  double shot_noise = 4.8e-5;    ///< variance per light
  Light gains = Light(1, 1, 1);  ///< exposure and white balance
};

}  // namespace lapservo
