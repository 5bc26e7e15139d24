#include <algorithm>
#include <cstdio>
#include <optional>
#include <string>
#include <unistd.h>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "apps/lapservo/cli/subcommands.h"
#include "apps/lapservo/inputs/input_files.h"
#include "lapservo/calibration/check/frame_diagnosis.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/atomic_file.h"
#include "lapservo/core/csv.h"
#include "lapservo/core/error.h"
#include "lapservo/marker/decoder.h"
#include "lapservo/marker/design.h"
#include "lapservo/marker/drawing.h"
#include "lapservo/rig/instruments.h"
#include "lapservo/rig/rig.h"
#include "lapservo/rig/rig_writer.h"

namespace lapservo::app {
using namespace internal;
namespace {

struct ViewingOptions {
  std::optional<double> focal_px;
  double distance_mm = 110, sigma_px = 0.1;
  Viewing viewing(double usual_focal_px) const {
    return {focal_px.value_or(usual_focal_px), 1e-3 * distance_mm, sigma_px};
  }
};

void add_viewing(Command command, ViewingOptions& options, const std::string& usual_focal) {
  command.add_option("--focal-px", options.focal_px, between(10.0, 1e5),
                     "Focal length of the camera, else " + usual_focal);
  command.add_option("--distance-mm", options.distance_mm, between(5.0, 2000.0), "From the camera to the marker");
  command.add_option("--sigma-px", options.sigma_px, between(1e-4, 100.0), "Noise of one boundary on one line");
}

struct DesignOptions {
  double diameter_mm = 8.4;
  std::optional<double> length_mm, min_band_mm, print_error_mm;
  std::vector<double> hues_deg{90, 180, 270}, upper_mm, lower_mm;
  std::string out;
  ViewingOptions viewing;
};

Marker given_marker(const DesignOptions& options) {
  if (options.upper_mm.size() != 3 || options.lower_mm.size() != 3)
    throw InputError("--bands-upper-mm, --bands-lower-mm", "need three lengths each, like 3.5,3.5,17");
  Marker marker;
  marker.diameter_m = 1e-3 * options.diameter_mm;
  for (std::size_t i = 0; i < 3; ++i) {
    marker.hues_deg[i] = options.hues_deg[i];
    marker.bands_upper_m[i] = 1e-3 * options.upper_mm[i];
    marker.bands_lower_m[i] = 1e-3 * options.lower_mm[i];
  }
  return decodable(marker, "marker");
}

// To eight digits, as it is written down.
std::string yaml_of(Marker marker) {
  const auto round = [](double& value) { value = parse_finite(fmt::format("{:.8g}", value)).value(); };
  for (auto* bands : {&marker.bands_upper_m, &marker.bands_lower_m})
    for (double& length_m : *bands) round(length_m);
  round(marker.diameter_m), round(marker.seam_rad);
  return "marker:\n" + marker_yaml(marker, 2);
}

constexpr double usual_print_error_m = 0.1e-3, usual_focal_px = 1100;

void print_sigmas(const Marker& marker, const Viewing& viewing, double print_error_m) {
  std::printf("\n  tau [deg]   cross-ratio   sigma [mrad]: centre line   whole surface   print off by %.2f mm\n",
              1e3 * print_error_m);
  for (int i = 0; i <= 8; ++i) {
    const double tau_rad = two_pi * std::min(i / 8.0, 0.99999);
    std::printf("  %9.0f   %11.4f   %25.1f   %13.2f   %20.0f\n", deg_from_rad(two_pi * i / 8),
                cross_ratio_at(marker, tau_rad), 1e3 * predicted_sigma_centre_line_rad(marker, tau_rad, viewing),
                1e3 * predicted_sigma_surface_rad(marker, tau_rad, viewing),
                1e3 * predicted_print_error_rad(marker, tau_rad, print_error_m));
  }
  std::printf(
      "\nThe print's error (one standard deviation of each boundary) does not average out: `lapservo calibrate "
      "marker`\n"
      "measures the print as it is.\n");
}

void warn_of_tissue_hue(const Marker& marker) {
  if (const std::string text = tissue_hue_text(marker); !text.empty())
    std::fprintf(stderr, "lapservo: warning: %s\n", text.c_str());
}

int run_design(const DesignOptions& options) {
  if (options.hues_deg.size() != 3) throw InputError("--hues", "needs three hues, like 90,180,270");
  const Viewing viewing = options.viewing.viewing(usual_focal_px);
  std::optional<AtomicFile> file;
  refuse_other_kind(options.out, ".yaml"), refuse_part_over_rig(options.out, "marker");
  if (!options.out.empty()) file.emplace(options.out);
  const bool given = !options.upper_mm.empty() || !options.lower_mm.empty();
  Marker marker;
  if (given) {
    marker = given_marker(options);
  } else {
    DesignSpec spec{
        1e-3 * options.diameter_mm, {}, {}, {options.hues_deg[0], options.hues_deg[1], options.hues_deg[2]}, viewing};
    spec.print_error_m = 1e-3 * options.print_error_mm.value_or(0);
    if (options.length_mm) spec.length_m = 1e-3 * *options.length_mm;
    if (options.min_band_mm) spec.min_band_m = 1e-3 * *options.min_band_mm;
    marker = design_marker(spec);
  }
  warn_of_tissue_hue(marker);
  std::printf(
      "diameter %.2f mm, length %.2f mm, seen from %.0f mm with a focal length of %.0f px, %.2f px a boundary\n\n",
      1e3 * marker.diameter_m, 1e3 * marker.length_m(), 1e3 * viewing.distance_m, viewing.focal_px,
      viewing.sigma_edge_px);
  std::printf("  band   hue [deg]   upper edge [mm]   lower edge [mm]\n");
  for (std::size_t i = 0; i < 3; ++i)
    std::printf("  %4zu   %9.0f   %15.2f   %15.2f\n", i, marker.hues_deg[i], 1e3 * marker.bands_upper_m[i],
                1e3 * marker.bands_lower_m[i]);
  print_sigmas(marker, viewing, options.print_error_mm ? 1e-3 * *options.print_error_mm : usual_print_error_m);
  std::printf(
      "\nThe cross-ratio is monotonic over the turn%s.\n",
      in_linear_family(marker) ? ", and linear: eq. (18) is exact" : " (not linear: decoded by the rational inverse)");
  std::puts("");
  std::fputs(yaml_of(marker).c_str(), stdout);
  if (file) {
    file->stream() << yaml_of(marker);
    file->commit();
    std::printf("\nwritten: %s\n", options.out.c_str());
  }
  return 0;
}

struct RigOptions {
  std::string rig, instrument, out, paper = "a4";
  int copies = 4;
  ViewingOptions viewing;
};

Instrument chosen(const RigOptions& options, const Rig& rig) {
  InputFiles inputs;
  inputs.add_rig(options.rig, rig);
  inputs.refuse_as_output(options.out);
  const Instrument& instrument =
      options.instrument.empty()
          ? rig.instruments.front()
          : rig.instruments[named_instrument(rig, options.instrument, options.rig, "--instrument")];
  warn_of_tissue_hue(instrument.marker);
  return instrument;
}

// A sheet that is drawn by what was measured on a print repeats that print's errors, and the camera's hues as inks.
void warn_of_measured(const Marker& marker) {
  const MarkerSigmas& sigmas = marker.sigmas;
  if (sigmas.bands_upper_m || sigmas.hues_deg || marker.gap_rad > 0)
    std::fprintf(
        stderr,
        "lapservo: warning: the rig's bands or hues are measured ones: print the marker as it was designed, from "
        "the rig of before the calibration\n");
}

int run_print(const RigOptions& options) {
  const Instrument instrument = chosen(options, load_rig(options.rig));
  warn_of_measured(instrument.marker);
  if (!options.out.ends_with(".svg") && !options.out.ends_with(".pdf"))
    throw InputError("--out", "name", options.out, "one that ends in .pdf or .svg");
  write_print_sheet(options.out, instrument.name, instrument.marker, options.paper == "a4" ? Paper::a4 : Paper::letter,
                    options.copies);
  std::printf("print at 100 %% and measure the rulers: %s\n", options.out.c_str());
  return 0;
}

// Rows of tau, columns along the shaft; colours on a terminal, else the band's number.
void show_in_terminal(const Marker& marker) {
  constexpr int rows = 16, columns = 48;
  const bool colours = ::isatty(STDOUT_FILENO) != 0;
  for (int row = 0; row < rows; ++row) {
    const double tau_rad = two_pi * (row + 0.5) / rows;
    const auto e = boundaries_m(marker, tau_rad);
    std::string line = fmt::format("{:5.0f} deg  ", deg_from_rad(tau_rad));
    for (int column = 0; column < columns; ++column) {
      const double along_m = marker.length_m() * (column + 0.5) / columns;
      const std::size_t band = along_m < e[1] ? 0 : (along_m < e[2] ? 1 : 2);
      const PrintColour c = print_colour(marker.hues_deg[band]);
      line += colours ? fmt::format("\033[48;2;{:.0f};{:.0f};{:.0f}m \033[0m", 255 * c.r, 255 * c.g, 255 * c.b)
                      : std::to_string(band);
    }
    std::puts(line.c_str());
  }
  std::printf("  tau      proximal %s tip\n", std::string(columns - 14, '-').append(">").c_str());
}

int run_show(const RigOptions& options) {
  const Rig rig = load_rig(options.rig);
  const Instrument instrument = chosen(options, rig);
  std::printf("%s: %.2f mm outer diameter, %.2f mm long\n", instrument.name.c_str(), 1e3 * instrument.marker.diameter_m,
              1e3 * instrument.marker.length_m());
  show_in_terminal(instrument.marker);
  const Viewing viewing = options.viewing.viewing(rig.camera.fx_px);
  double surface_rad = 0, print_rad = 0;
  for (int i = 0; i < 16; ++i) {
    const double part = (i + 0.5) / 16, printed_rad = part * instrument.marker.covered_rad();
    surface_rad = std::max(surface_rad, predicted_sigma_surface_rad(instrument.marker, two_pi * part, viewing));
    print_rad = std::max(print_rad, predicted_print_error_rad(instrument.marker, printed_rad, usual_print_error_m));
  }
  std::printf(
      "seen from %.0f mm with a focal length of %.0f px; worst sigma of psi by noise (%.2f px a boundary): %.2f mrad, "
      "as lapservo measures it, by all visible lines; %.1f mrad by the centre line alone\n"
      "worst error of psi by boundaries that are printed %.1f mm off: %.0f mrad until `lapservo calibrate marker` has "
      "measured them\n",
      1e3 * viewing.distance_m, viewing.focal_px, viewing.sigma_edge_px, 1e3 * surface_rad,
      1e3 * worst_sigma_centre_line_rad(instrument.marker, viewing), 1e3 * usual_print_error_m, 1e3 * print_rad);
  if (options.out.empty()) return 0;
  write_marker_picture(options.out, instrument.name, instrument.marker, viewing);
  std::printf("image: %s\n", options.out.c_str());
  return 0;
}

void add_design(Command parent) {
  auto [command, options] = parent.add_subcommand<DesignOptions>(
      "design", "Choose the bands of a marker, or evaluate given ones.", run_design);
  command.add_option("--diameter-mm", options.diameter_mm, between(0.5, 100.0), "Outer diameter, film included");
  command.add_option("--length-mm", options.length_mm, between(1.0, 500.0),
                     "Length of the marker; default three diameters");
  command.add_option("--smallest-band-mm", options.min_band_mm, between(0.1, 200.0),
                     "No band is shorter; default 3 mm or 12 px");
  command.add_option("--print-error-mm", options.print_error_mm, between(0.001, 10.0),
                     "Standard deviation of where each boundary is printed and cut: minimise what it does to the "
                     "rotation, together with the noise; else noise alone, and what 0.1 mm does is said");
  command.add_option("--hues", options.hues_deg, finite_numbers(), "Three hues in degrees, proximal to distal");
  command.add_option("--bands-upper-mm", options.upper_mm, finite_numbers(),
                     "Evaluate this design: lengths at the upper edge");
  command.add_option("--bands-lower-mm", options.lower_mm, finite_numbers(), "and at the lower edge");
  command.add_option("--out", options.out, "Write the marker: block of a rig; a file of that name is replaced");
  add_viewing(command, options.viewing, fmt::format("{:g}", usual_focal_px));
  command.footer(
      "Example:\n  lapservo marker design --diameter-mm 8.4 --distance-mm 110 --out marker.yaml\n"
      "  lapservo marker design --bands-upper-mm 3.5,3.5,17 --bands-lower-mm 9.5,9.5,5");
}

std::pair<Command, RigOptions&> add_for_rig(Command parent, const std::string& name, const std::string& about,
                                            int (*job)(const RigOptions&)) {
  auto [command, options] = parent.add_subcommand<RigOptions>(name, about, job);
  command.add_option("--rig", options.rig, required(), "The rig whose marker it is");
  command.add_option("--instrument", options.instrument, "Its name; default the first");
  return {command, options};
}

}  // namespace

void add_marker(Command app) {
  Command marker = app.add_subcommand("marker", "Design, print and look at markers.");
  marker.require_subcommand();
  marker.footer("Example:\n  lapservo marker print --rig configs/example.yaml --out sheet.pdf");
  add_design(marker);

  auto [print, printing] = add_for_rig(marker, "print", "Write a sheet to print at true scale.", run_print);
  print.add_option("--out", printing.out, required(), "sheet.pdf or sheet.svg; a file of that name is replaced");
  print.add_option("--paper", printing.paper, one_of({"a4", "letter"}), "a4 or letter");
  print.add_option("--copies", printing.copies, whole_between(1, 100), "Markers on the sheet, as many as fit");
  print.footer("Example:\n  lapservo marker print --rig configs/example.yaml --out sheet.pdf");

  auto [show, showing] = add_for_rig(marker, "show", "Show what a rig's marker looks like unrolled.", run_show);
  show.add_option("--out", showing.out, "Write an image too: .svg, .pdf or .png; a file of that name is replaced");
  add_viewing(show, showing.viewing, "the rig's");
  show.footer("Example:\n  lapservo marker show --rig configs/example.yaml --out marker.svg");
}

}  // namespace lapservo::app
