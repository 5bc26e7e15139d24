#pragma once

#include <cstddef>
#include <string>

#include "lapservo/marker/marker.h"
#include "lapservo/marker/sensitivity.h"

namespace lapservo::internal {

/// tau from the length of one band along the shaft (eq. 16). Exact for every band whose edges slope, but the length
/// must be known in metres, and an image tells lengths only as well as depth and inclination are known. The
/// cross-ratio (CrossRatioDecoder) needs neither.
class LengthDecoder {
 public:
  /// Band 0, 1 or 2. Throws std::invalid_argument with length_decoding_problem's text when its length tells nothing.
  LengthDecoder(const Marker& marker, std::size_t band);

  /// tau in [0, covered_rad()]; a length beyond the band's range gives the nearer end, a non-finite one gives NaN.
  double tau_rad(double length_m) const;

 private:
  double upper_m_, lower_m_, covered_rad_;
};

/// Empty when the band's length changes over tau; else why it can't be decoded.
std::string length_decoding_problem(const Marker& marker, std::size_t band);

/// The band whose length changes most over the turn.
std::size_t most_telling_band(const Marker& marker);

/// Standard deviation of tau by eq. (16) when depth is known exactly and the shaft is seen head on: what the band's two
/// boundaries leave, on one line.
double predicted_sigma_length_rad(const Marker& marker, std::size_t band, const Viewing& viewing);

/// What a picture does not tell when there is but one length.
struct ViewingError {
  double depth_fraction = 0;   ///< believed depth of the proximal end = true depth * (1 + depth_fraction)
  double inclination_rad = 0;  ///< of the shaft, tip away from the camera, believed to be square to the view
};
struct CodeErrors {
  double by_length_rad = 0, by_cross_ratio_rad = 0;  ///< decoded minus true tau; clamped at the ends of the turn
};
/// Errors of both codes on a noiseless pinhole image of the boundaries on one line through the optical axis, the
/// proximal end at `viewing.distance_m`. The cross-ratio's is zero but for rounding, and NaN for markers that it does
/// not decode.
CodeErrors perspective_errors(const Marker& marker, std::size_t band, double tau_rad, const Viewing& viewing,
                              const ViewingError& viewing_error);

}  // namespace lapservo::internal
