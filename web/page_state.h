#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/vision/observation.h"

namespace lapservo::internal {

struct PageLoop;

// As the page reads them; what is not known is null.

/// `silent_s`: for so long no image has come, and what they were says nothing of now.
nlohmann::ordered_json json_of(const std::vector<Observation>& observations, std::optional<double> silent_s);
nlohmann::ordered_json json_of(const PageLoop& loop);
/// Never throws for its text: what is no UTF-8 is replaced.
std::string text_of(const nlohmann::ordered_json& json);

}  // namespace lapservo::internal
