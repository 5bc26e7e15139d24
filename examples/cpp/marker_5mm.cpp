// marker_5mm SHEET.pdf: a marker for a 5 mm instrument, as a sheet to print, and what to expect of it.
#include <algorithm>
#include <cstdio>
#include <lapservo/marker/design.h>
#include <lapservo/marker/drawing.h>

int main(int argc, char** argv) {
  if (argc != 2) return std::puts("marker_5mm SHEET.pdf"), 2;
  lapservo::DesignSpec spec;
  spec.diameter_m = 0.005;
  spec.viewing = {.focal_px = 1100, .distance_m = 0.08};
  const lapservo::Marker marker = lapservo::design_marker(spec);
  lapservo::write_print_sheet(argv[1], "5 mm grasper", marker, lapservo::Paper::a4, 6);
  double largest_rad = 0;
  for (double tau_rad = 0.1; tau_rad < 6.2; tau_rad += 0.1)
    largest_rad = std::max(largest_rad, lapservo::predicted_sigma_surface_rad(marker, tau_rad, spec.viewing));
  std::printf("%.1f mm long; sigma of the rotation at most %.2f mrad\n", 1000 * marker.length_m(), 1000 * largest_rad);
}
