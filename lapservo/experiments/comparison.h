#pragma once

#include <string>
#include <utility>

#include "lapservo/experiments/html_report.h"
#include "lapservo/vision/tracker.h"

namespace lapservo {

/// A row of the report for the results of each method (anything with a `method`), said by `text_of`.
template <class Results, class TextOf>
Comparison compared(std::string what, std::string paper, const Results& results, const TextOf& text_of) {
  Comparison row{std::move(what), std::move(paper), "", ""};
  for (const auto& result : results)
    (result.method == Method::centerline ? row.centerline : row.surface) = text_of(result);
  return row;
}

}  // namespace lapservo
