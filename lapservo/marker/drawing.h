#pragma once

#include <filesystem>
#include <string>

#include "lapservo/marker/marker.h"
#include "lapservo/marker/sensitivity.h"

namespace lapservo {

/// Printed colour of a hue, sRGB values in [0, 1].
struct PrintColour {
  double r, g, b;
};
PrintColour print_colour(double hue_deg);

enum class Paper { a4, letter };

/// A sheet with `copies` of the unrolled marker at true scale (width pi x outer diameter across the shaft), cut lines,
/// a tab for the glue, rulers to check the printer, arrows for tip and turn, and what to do with it, all of it 10 mm
/// and more from the paper's edges. SVG or PDF by the name's ending. Throws InputError when a marker does not fit on
/// the paper, for less than one copy, or when the file can't be written.
///
/// The printed side faces the reader, the tip is on the right, tau grows downwards: with the print outside, the axis to
/// the right and the normal towards the reader, right-handed rotation about the axis moves the surface down.
void write_print_sheet(const std::filesystem::path& path, const std::string& instrument, const Marker& marker,
                       Paper paper, int copies);

/// A drawing of the marker unrolled, with its axes and the cross-ratio and the predicted sigma over tau. SVG, PDF or
/// PNG.
void write_marker_picture(const std::filesystem::path& path, const std::string& instrument, const Marker& marker,
                          const Viewing& viewing);

}  // namespace lapservo
