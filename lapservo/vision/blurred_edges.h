#pragma once

namespace lapservo {

/// Edges as a Gaussian blur of one pixel sigma leaves them, at a distance u from the edge in sigmas (inside: u > 0):
/// the convolution of the normal density with the step, the square root and the 3/2 power of max(0, u). The last two
/// make the limb of a shaded cylinder. Tabulated; errors below 1e-4.
struct BlurredEdge {
  float density, step, root, three_halves;
};
BlurredEdge blurred_edge(float u);

}  // namespace lapservo
