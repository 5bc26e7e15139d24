#pragma once

#include <string>
#include <utility>

#include <fmt/format.h>

#include "lapservo/experiments/statistics.h"
#include "lapservo/report/html_report.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::internal {

/// Makes rows of the report of the results of each method (anything with a `method`), said by `text_of`.
template <class Results>
auto comparing(const Results& results) {
  return [&results](std::string what, std::string paper, const auto& text_of) {
    Comparison row{std::move(what), std::move(paper), "", ""};
    for (const auto& result : results)
      (result.method == Method::centerline ? row.centerline : row.surface) = text_of(result);
    return row;
  };
}

/// "1.49 ± 1.2 px": three digits of the mean, two of the deviation.
inline std::string mean_and_deviation(const Spread& spread, const char* unit) {
  return fmt::format("{} \u00b1 {} {}", with_digits(spread.mean, 3), with_digits(spread.deviation, 2), unit);
}

}  // namespace lapservo::internal
