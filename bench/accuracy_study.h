#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "acceptance/frame_sets.h"
#include "acceptance/random_print.h"

namespace lapservo::bench {

/// A row of a table of docs/notes/accuracy.md: the errors on so many frames that the seed draws.
struct Row {
  std::string name;
  std::function<acceptance::Score(int frames, std::uint64_t seed)> measure;
};

/// Rendered frames through what cameras do to them, of a strength drawn anew for every frame, by a rig as calibration
/// would have it and, "_uncalibrated", as if nobody had calibrated. LAPSERVO_OFF=1: each frame's print is off in its
/// bands, 2: in an ink that lies aside (random_print.h). LAPSERVO_BLOOD: so much of the marker is hidden [%]. h264 and
/// x265 are a marker in motion, tracked, as recorders keep it; blended is 0.6 of a frame and 0.4 of the one before.
std::vector<Row> camera_rows();
/// The same of the ray-traced samples of rotation, illumination and tilt, where they are there.
std::vector<Row> samples_rows();
/// Markers of which blood hides 40 %, each its own.
std::vector<Row> blood_rows();
/// Instruments that move or turn while the shutter is open, psi's truth being that in the middle of the exposure.
std::vector<Row> motion_rows();

/// The frames of one of these rows.
std::vector<acceptance::TrueFrame> motion_frames(const std::string& name, int frames, std::uint64_t seed);

/// Prints how far boundaries and sides are located from where the true pose has them: of UsualErrors and EdgeLimits.
void print_edge_errors(int frames, std::uint64_t seed);

/// Prints how many hostile frames are ok and wrong by 0.1 rad about the shaft. Each has one to three hardships: a
/// misprint, blood, a camera's processing, another instrument across, a small marker, motion, soft and dim images, a
/// wrong rig. And how often psi is wrong by what p_false says of it.
void print_false_accepts(int frames, std::uint64_t seed);

/// Prints how often hostile frames with blood show a marker's colours amid its bands, on the shaft beyond them and
/// beside it: the table of lapservo/vision/colour/colour_evidence.h.
void print_colour_frequencies(int frames, std::uint64_t seed);

/// The truth for a tracker whose rig has this print. The seam's displacement shows in no image and counts for no error.
void take_print_for(acceptance::TrueFrame& frame, const Marker& marker);

/// The frame's one instrument looked at on its own.
void score_alone(const acceptance::TrueFrame& frame, acceptance::Score& score);

}  // namespace lapservo::bench
