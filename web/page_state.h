#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "lapservo/vision/observation.h"

namespace lapservo::internal {

struct PageLoop;

// As the page reads them; what is not known is null.

nlohmann::json json_of(const std::vector<Observation>& observations);
nlohmann::json json_of(const PageLoop& loop);
/// Never throws for its text: what is no UTF-8 is replaced.
std::string text_of(const nlohmann::json& json);

}  // namespace lapservo::internal
