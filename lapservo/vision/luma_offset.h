#pragma once

#include "lapservo/vision/processed_edge.h"

namespace lapservo::internal {

/// How far an edge lies along its normal from where `model` has it, by the luma of what was `measured` alone [px]:
/// compressed video leaves luma as it is to a level where it spreads colour differences widely and raggedly, so those
/// say what luma to expect, and luma says where. The luma may be blurred after the response, lifted and stretched, and
/// light's gradient another. Looks at samples up to `clear_px` from the middle. Luma without contrast tells nothing: 0.
double offset_by_luma_px(const ProcessedEdge::Linearised& model, const EdgeSamples& measured, int clear_px);

}  // namespace lapservo::internal
