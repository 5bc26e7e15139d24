#pragma once

#include <optional>
#include <string>
#include <vector>

#include "lapservo/vision/observation.h"

namespace lapservo::internal {

/// The header line of an observation CSV (docs/output.md), without the line's end: see RowFile.
extern const char* const observation_csv_header;

/// A number of a row, where it is known; of `decimals` digits after the point, or as a sigma below 0.
struct ObservationNumber {
  std::optional<double> value;
  int decimals = 0;
};
/// Those of the columns after `status`.
std::vector<ObservationNumber> observation_numbers(const Observation& observation);

/// One row of it, without the line's end. Unknown values are empty fields.
std::string observation_csv_row(int frame, double time_s, const std::string& file, const Observation& observation);

}  // namespace lapservo::internal
