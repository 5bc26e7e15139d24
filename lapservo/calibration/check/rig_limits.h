#pragma once

namespace lapservo::internal {

/// From when on a rig is not good enough. One number each, below which the loop's own errors (docs/notes/accuracy.md)
/// or its limits are larger.
struct RigLimits {
  double found = 0.95;                       ///< fraction of the frames
  double dark_value = 70, dark_chroma = 45;  ///< of 255
  double clipped = 0.1;                      ///< fraction of the pixels
  double hue_deg = 12;                       ///< between a band and the rig's hue
  double response_px = 0.05;                 ///< between edges of channels that rise and fall at one place
  double print_rad = 5e-3;                   ///< rms of psi, by a print that is not the rig's
  double focal = 5e-3;                       ///< relative
  double drift_m = 1e-3, drift_rad = 5e-3;
  double delay_s = 15e-3;
  double noise = 3;  ///< times what the images' noise leaves between joints and images
  double place_m = 1e-3, axis_rad = 7e-3, roll_rad = 10e-3;  ///< by the registration
  double width_px = 40;                                      ///< of the shaft
  double sigma_rad = 5e-3;                                   ///< of psi over the work space
  double work_space = 0.9;                                   ///< fraction of it that has to keep sigma_rad
};
inline constexpr RigLimits rig_limits;

}  // namespace lapservo::internal
