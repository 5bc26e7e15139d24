#include "lapservo/marker/drawing.h"

#include <algorithm>
#include <cairo-pdf.h>
#include <cairo-svg.h>
#include <cairo.h>
#include <cmath>
#include <cstddef>
#include <memory>
#include <ostream>
#include <type_traits>
#include <vector>

#include <fmt/format.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/atomic_file.h"
#include "lapservo/core/error.h"

namespace lapservo {
using namespace internal;
namespace {

const PrintColour black{0, 0, 0}, grey{0.55, 0.55, 0.55}, pale{0.93, 0.93, 0.93};

struct PointMm {
  double x, y;
};

constexpr double points_per_mm = 72 / 25.4, png_px_per_mm = 8;

cairo_status_t write_to_stream(void* stream, const unsigned char* bytes, unsigned int count) {
  static_cast<std::ostream*>(stream)->write(reinterpret_cast<const char*>(bytes), count);
  return CAIRO_STATUS_SUCCESS;  // the stream reports errors at the end
}

// An object of cairo, which `destroy` frees.
template <typename Made, void (*destroy)(Made*)>
using Owned = std::unique_ptr<Made, std::integral_constant<void (*)(Made*), destroy>>;

std::vector<PointMm> rectangle(PointMm from, PointMm to) {
  return {from, {to.x, from.y}, to, {from.x, to.y}};
}

// A page in millimetres, y down, written as SVG, PDF or PNG by the name's ending; appears when finish()ed (see
// AtomicFile).
class Canvas {
 public:
  Canvas(const std::filesystem::path& path, double width_mm, double height_mm) : path_(path), file_(path) {
    const std::string extension = path.extension().string();
    double unit = 1;
    if (extension == ".svg") {
      surface_.reset(cairo_svg_surface_create_for_stream(write_to_stream, &file_.stream(), width_mm, height_mm));
      cairo_svg_surface_set_document_unit(surface_.get(), CAIRO_SVG_UNIT_MM);
    } else if (extension == ".pdf") {
      unit = points_per_mm;
      surface_.reset(
          cairo_pdf_surface_create_for_stream(write_to_stream, &file_.stream(), width_mm * unit, height_mm * unit));
      cairo_pdf_surface_restrict_to_version(surface_.get(), CAIRO_PDF_VERSION_1_4);  // which every printer reads
      // Without a date the same marker gives the same bytes.
      cairo_pdf_surface_set_metadata(surface_.get(), CAIRO_PDF_METADATA_CREATE_DATE, nullptr);
    } else if (extension == ".png") {
      unit = png_px_per_mm;
      png_ = true;
      surface_.reset(cairo_image_surface_create(CAIRO_FORMAT_RGB24, static_cast<int>(width_mm * unit),
                                                static_cast<int>(height_mm * unit)));
    } else {
      throw InputError(path.string(), "name", extension.empty() ? "without an ending" : extension,
                       "one that ends in .svg, .pdf or .png");
    }
    cairo_.reset(cairo_create(surface_.get()));
    expect_success();
    cairo_scale(cairo_.get(), unit, unit);
    polygon(rectangle({0, 0}, {width_mm, height_mm}), {1, 1, 1});
  }

  void polygon(const std::vector<PointMm>& points, const PrintColour& fill) {
    cairo_new_path(cairo_.get());
    cairo_set_source_rgb(cairo_.get(), fill.r, fill.g, fill.b);
    for (const PointMm& p : points) cairo_line_to(cairo_.get(), p.x, p.y);
    cairo_close_path(cairo_.get());
    cairo_fill(cairo_.get());
  }

  void line(const std::vector<PointMm>& points, const PrintColour& colour, double width_mm, bool dashed = false) {
    cairo_new_path(cairo_.get());  // text leaves a current point behind
    cairo_set_source_rgb(cairo_.get(), colour.r, colour.g, colour.b);
    cairo_set_line_width(cairo_.get(), width_mm);
    const double dash[] = {1.0, 1.0};
    cairo_set_dash(cairo_.get(), dash, dashed ? 2 : 0, 0);
    for (const PointMm& p : points) cairo_line_to(cairo_.get(), p.x, p.y);
    cairo_stroke(cairo_.get());
  }

  void outline(std::vector<PointMm> corners, const PrintColour& colour, double width_mm, bool dashed) {
    corners.push_back(corners.front());
    line(corners, colour, width_mm, dashed);
  }

  // How far a text of this height reaches.
  double text_width_mm(const std::string& text, double height_mm) {
    cairo_select_font_face(cairo_.get(), "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(cairo_.get(), height_mm * 1.35);
    cairo_text_extents_t extents;
    cairo_text_extents(cairo_.get(), text.c_str(), &extents);
    return extents.x_advance;
  }

  enum class Anchor { left, middle, right };
  void text(const std::string& text, PointMm at, double height_mm, Anchor anchor = Anchor::left, double turn_deg = 0) {
    const double width_mm = text_width_mm(text, height_mm);
    cairo_set_source_rgb(cairo_.get(), 0, 0, 0);
    const double fraction = anchor == Anchor::left ? 0 : (anchor == Anchor::middle ? 0.5 : 1);
    cairo_save(cairo_.get());
    cairo_translate(cairo_.get(), at.x, at.y);
    cairo_rotate(cairo_.get(), rad_from_deg(turn_deg));
    cairo_move_to(cairo_.get(), -fraction * width_mm, 0);
    cairo_show_text(cairo_.get(), text.c_str());
    cairo_restore(cairo_.get());
  }

  void arrow(PointMm from, PointMm to) {
    const double length = std::hypot(to.x - from.x, to.y - from.y);
    const double ax = (to.x - from.x) / length, ay = (to.y - from.y) / length;
    line({from, {to.x - 1.5 * ax, to.y - 1.5 * ay}}, black, 0.3);
    polygon({to,
             {to.x - 2 * ax - 0.8 * ay, to.y - 2 * ay + 0.8 * ax},
             {to.x - 2 * ax + 0.8 * ay, to.y - 2 * ay - 0.8 * ax}},
            black);
  }

  void finish() {
    if (png_) cairo_surface_write_to_png_stream(surface_.get(), write_to_stream, &file_.stream());
    cairo_surface_finish(surface_.get());
    expect_success();
    file_.commit();
  }

 private:
  void expect_success() const {
    if (cairo_surface_status(surface_.get()) != CAIRO_STATUS_SUCCESS)
      throw InputError(path_.string(), "can't be drawn");
  }

  std::filesystem::path path_;
  AtomicFile file_;
  Owned<cairo_surface_t, cairo_surface_destroy> surface_;
  Owned<cairo_t, cairo_destroy> cairo_;
  bool png_ = false;
};

using Anchor = Canvas::Anchor;
constexpr double tab_mm = 4, gap_mm = 12, edge_mm = 10;  // the last: nearer to the paper's edge printers cut off

double width_mm(const Marker& marker) {
  return 1e3 * pi * marker.diameter_m;
}
double length_mm(const Marker& marker) {
  return 1e3 * marker.length_m();
}

// The three bands with their proximal upper corner at a point: x along the shaft, y from tau = 0 down to 2 pi.
void draw_bands(Canvas& canvas, const Marker& marker, PointMm corner, double height_mm, double mm_per_m) {
  double upper = 0, lower = 0;
  for (std::size_t band = 0; band < 3; ++band) {
    const double next_upper = upper + mm_per_m * marker.bands_upper_m[band],
                 next_lower = lower + mm_per_m * marker.bands_lower_m[band];
    canvas.polygon({{corner.x + upper, corner.y},
                    {corner.x + next_upper, corner.y},
                    {corner.x + next_lower, corner.y + height_mm},
                    {corner.x + lower, corner.y + height_mm}},
                   print_colour(marker.hues_deg[band]));
    upper = next_upper, lower = next_lower;
  }
}

void draw_ruler(Canvas& canvas, PointMm from, int length, bool vertical) {
  const auto at = [&](double along, double across) {
    return vertical ? PointMm{from.x - across, from.y + along} : PointMm{from.x + along, from.y - across};
  };
  canvas.line({at(0, 0), at(length, 0)}, black, 0.2);
  for (int mm = 0; mm <= length; ++mm)
    canvas.line({at(mm, 0), at(mm, mm % 10 == 0 ? 4 : (mm % 5 == 0 ? 3 : 2))}, black, 0.15);
  for (int mm = 0; mm <= length; mm += 10) {
    const PointMm place = at(mm, 5);
    canvas.text(std::to_string(mm), vertical ? PointMm{place.x - 1, place.y + 0.8} : place, 2,
                vertical ? Anchor::right : Anchor::middle);
  }
}

// Smaller where it would not fit otherwise.
void fitting_text(Canvas& canvas, const std::string& text, PointMm at, double height_mm, double room_mm) {
  canvas.text(text, at, height_mm * std::min(1.0, room_mm / canvas.text_width_mm(text, height_mm)));
}

// On the tab, which the glued edge covers: whose marker it is and which way it goes on, out of the tracker's sight.
void label_tab(Canvas& canvas, const std::string& instrument, PointMm corner, double length) {
  constexpr double margin = 0.7, height = 1.3, arrow = 3;
  const double right = corner.x + length - margin, line = corner.y + 3.3;
  fitting_text(canvas, instrument, {corner.x + margin, corner.y + 1.7}, height, length - 2 * margin);
  canvas.arrow({right - arrow, line - 0.5}, {right, line - 0.5});
  canvas.text("tip", {right - arrow - 0.4, line}, height, Anchor::right);
  const double room = length - 2 * margin - arrow - 0.8 - canvas.text_width_mm("tip", height);
  if (room > canvas.text_width_mm("glue", height)) canvas.text("glue", {corner.x + margin, line}, height);
}

void draw_copy(Canvas& canvas, const std::string& instrument, const Marker& marker, PointMm corner) {
  const double length = length_mm(marker), width = width_mm(marker);
  const PointMm tab{corner.x, corner.y + width}, end{corner.x + length, tab.y + tab_mm};
  canvas.polygon(rectangle(tab, end), pale);
  draw_bands(canvas, marker, corner, width, 1e3);
  canvas.outline(rectangle(corner, end), grey, 0.1, true);
  label_tab(canvas, instrument, tab, length);
}

void draw_curve(Canvas& canvas, PointMm corner, double width, double height, const std::vector<double>& values,
                const std::string& title, const std::string& label, const std::string& format, double low) {
  const double high = *std::max_element(values.begin(), values.end());
  const double room = std::max(0.08 * (high - low), 1e-9 + 1e-3 * std::abs(high)), bottom = low - room,
               top = high + room;
  canvas.line({corner, {corner.x, corner.y + height}, {corner.x + width, corner.y + height}}, black, 0.2);
  std::vector<PointMm> curve;
  for (std::size_t i = 0; i < values.size(); ++i)
    curve.push_back({corner.x + width * static_cast<double>(i) / static_cast<double>(values.size() - 1),
                     corner.y + height * (top - values[i]) / (top - bottom)});
  canvas.line(curve, {0.1, 0.3, 0.7}, 0.4);
  fitting_text(canvas, title, {corner.x, corner.y - 1.5}, 2.4, width);
  canvas.text(label, {corner.x - 16, corner.y + height / 2}, 2.2, Anchor::middle, -90);
  for (const double value : {low, high})
    canvas.text(fmt::format(fmt::runtime(format), value),
                {corner.x - 1, corner.y + height * (top - value) / (top - bottom) + 0.8}, 2, Anchor::right);
  for (int quarter = 0; quarter <= 4; ++quarter)
    canvas.text(fmt::format("{} deg", 90 * quarter), {corner.x + width * quarter / 4, corner.y + height + 4}, 2,
                Anchor::middle);
  canvas.text("tau", {corner.x + width / 2, corner.y + height + 7.5}, 2.2, Anchor::middle);
}

}  // namespace

PrintColour print_colour(double hue_deg) {
  constexpr double saturation = 0.97, value = 0.85;
  const auto channel = [&](double n) {
    const double k = std::fmod(n + hue_deg / 60, 6.0);
    return value - value * saturation * std::clamp(std::min(k, 4 - k), 0.0, 1.0);
  };
  return {channel(5), channel(3), channel(1)};
}

void write_print_sheet(const std::filesystem::path& path, const std::string& instrument, const Marker& marker,
                       Paper paper, int copies) {
  if (copies < 1) throw InputError(path.string(), "copies", fmt::format("{}", copies), "1 or more");
  const double page_width = paper == Paper::a4 ? 210 : 215.9, page_height = paper == Paper::a4 ? 297 : 279.4;
  const double length = length_mm(marker), width = width_mm(marker);
  const double left = 25, top = 78, room = page_width - left - edge_mm;
  const int columns = static_cast<int>((room - 5 + gap_mm) / (length + gap_mm));
  const int rows = static_cast<int>((page_height - top - 15 + gap_mm) / (width + tab_mm + gap_mm));
  if (columns < 1 || rows < 1)
    throw InputError(path.string(),
                     fmt::format("the marker of {:.0f} x {:.0f} mm does not fit on the paper", length, width));
  Canvas canvas(path, page_width, page_height);
  fitting_text(canvas, fmt::format("lapservo marker for {}", instrument), {left, 18}, 4.5, room);
  fitting_text(
      canvas,
      fmt::format(
          "outer diameter {:.2f} mm, circumference {:.2f} mm, length {:.2f} mm; hues {:.0f}, {:.0f}, {:.0f} degrees",
          1e3 * marker.diameter_m, width, length, marker.hues_deg[0], marker.hues_deg[1], marker.hues_deg[2]),
      {left, 24}, 2.4, room);
  const char* const steps[] = {
      "1. Print at 100 % on matte paper or film. Measure both rulers: they must show 100 mm and 50 mm.",
      "2. Cut along the dashed line. Wrap it around the shaft, print outside, arrow towards the tip.",
      "3. Glue the upper edge onto the tab, edge on edge. Measure the outer diameter; put it into the rig."};
  for (std::size_t i = 0; i < 3; ++i)
    fitting_text(canvas, steps[i], {left, 31 + 5 * static_cast<double>(i)}, 2.4, room);
  draw_ruler(canvas, {left, 57}, 100, false);
  draw_ruler(canvas, {left - 5, top}, 50, true);
  canvas.arrow({left, 66}, {left + 25, 66});
  canvas.text("towards the tip", {left + 27, 67}, 2.4);
  canvas.arrow({left + 75, 61}, {left + 75, 71});
  canvas.text("tau grows this way (right-handed about the axis to the tip)", {left + 78, 67}, 2.4);
  const int count = std::min(copies, columns * rows);
  for (int i = 0; i < count; ++i)
    draw_copy(canvas, instrument, marker,
              {left + (i % columns) * (length + gap_mm), top + (i / columns) * (width + tab_mm + gap_mm)});
  canvas.finish();
}

void write_marker_picture(const std::filesystem::path& path, const std::string& instrument, const Marker& marker,
                          const Viewing& viewing) {
  constexpr double page_width = 150, page_height = 200, left = 25, plot_width = 110, plot_height = 40;
  Canvas canvas(path, page_width, page_height);
  const double scale = 1e3 * std::min(plot_width / length_mm(marker), 70 / width_mm(marker));
  const double length = scale * marker.length_m(), height = scale * pi * marker.diameter_m;
  fitting_text(canvas, fmt::format("{}: the marker unrolled, print towards you, tip on the right", instrument),
               {left, 10}, 2.6, plot_width);
  draw_bands(canvas, marker, {left, 16}, height, scale);
  canvas.outline(rectangle({left, 16}, {left + length, 16 + height}), black, 0.2, false);
  for (int quarter = 0; quarter <= 4; ++quarter)
    canvas.text(fmt::format("{} deg", 90 * quarter), {left - 1.5, 16 + height * quarter / 4 + 0.8}, 2, Anchor::right);
  canvas.text("tau", {left - 16, 16 + height / 2}, 2.4, Anchor::middle, -90);
  for (int mm = 0; mm <= static_cast<int>(length_mm(marker) + 0.01); mm += 5)
    canvas.text(fmt::format("{}", mm), {left + 1e-3 * scale * mm, 16 + height + 3.5}, 2, Anchor::middle);
  canvas.text("mm from the proximal end", {left + length / 2, 16 + height + 7}, 2.2, Anchor::middle);
  std::vector<double> ratio, sigma;
  for (int i = 0; i <= 180; ++i) {
    const double tau_rad = two_pi * std::min(i / 180.0, 0.99999);
    ratio.push_back(cross_ratio_at(marker, tau_rad));
    sigma.push_back(1e3 * predicted_sigma_surface_rad(marker, tau_rad, viewing));
  }
  draw_curve(canvas, {left, 108}, plot_width, plot_height - 8, ratio, "cross-ratio over tau (eq. 17)", "cross-ratio",
             "{:.3f}", *std::min_element(ratio.begin(), ratio.end()));
  draw_curve(canvas, {left, 156}, plot_width, plot_height - 8, sigma,
             fmt::format("predicted sigma of psi, all visible lines: {:.2f} px a boundary, f {:.0f} px, {:.0f} mm away",
                         viewing.sigma_edge_px, viewing.focal_px, 1e3 * viewing.distance_m),
             "sigma [mrad]", "{:.2f}", 0);
  canvas.finish();
}

}  // namespace lapservo
