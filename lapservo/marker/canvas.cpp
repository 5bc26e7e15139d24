#include "lapservo/marker/canvas.h"

#include <cairo-pdf.h>
#include <cairo-svg.h>
#include <cmath>
#include <ostream>

#include "lapservo/core/angles.h"
#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace {

constexpr double points_per_mm = 72 / 25.4, png_px_per_mm = 8;

cairo_status_t write_to_stream(void* stream, const unsigned char* bytes, unsigned int count) {
  static_cast<std::ostream*>(stream)->write(reinterpret_cast<const char*>(bytes), count);
  return CAIRO_STATUS_SUCCESS;  // the stream reports errors at the end
}

}  // namespace

Canvas::Canvas(const std::filesystem::path& path, double width_mm, double height_mm) : path_(path), file_(path) {
  const std::string extension = path.extension().string();
  double unit = 1;
  if (extension == ".svg") {
    surface_ = cairo_svg_surface_create_for_stream(write_to_stream, &file_.stream(), width_mm, height_mm);
    cairo_svg_surface_set_document_unit(surface_, CAIRO_SVG_UNIT_MM);
  } else if (extension == ".pdf") {
    unit = points_per_mm;
    surface_ = cairo_pdf_surface_create_for_stream(write_to_stream, &file_.stream(), width_mm * unit, height_mm * unit);
    cairo_pdf_surface_restrict_to_version(surface_, CAIRO_PDF_VERSION_1_4);  // which every printer reads
    // Without a date the same marker gives the same bytes.
    cairo_pdf_surface_set_metadata(surface_, CAIRO_PDF_METADATA_CREATE_DATE, nullptr);
  } else if (extension == ".png") {
    unit = png_px_per_mm;
    png_ = true;
    surface_ = cairo_image_surface_create(CAIRO_FORMAT_RGB24, static_cast<int>(width_mm * unit),
                                          static_cast<int>(height_mm * unit));
  } else {
    throw InputError(path.string(), "name", extension.empty() ? "without an ending" : extension,
                     "one that ends in .svg, .pdf or .png");
  }
  cairo_ = cairo_create(surface_);
  if (cairo_surface_status(surface_) != CAIRO_STATUS_SUCCESS) {
    cairo_destroy(cairo_);
    cairo_surface_destroy(surface_);
    throw InputError(path.string(), "can't be drawn");
  }
  cairo_scale(cairo_, unit, unit);
  polygon({{0, 0}, {width_mm, 0}, {width_mm, height_mm}, {0, height_mm}}, {1, 1, 1});
}

Canvas::~Canvas() {
  if (cairo_) cairo_destroy(cairo_);
  if (surface_) cairo_surface_destroy(surface_);
}

void Canvas::polygon(const std::vector<PointMm>& points, const PrintColour& fill) {
  cairo_new_path(cairo_);
  cairo_set_source_rgb(cairo_, fill.r, fill.g, fill.b);
  for (const PointMm& p : points) cairo_line_to(cairo_, p.x, p.y);
  cairo_close_path(cairo_);
  cairo_fill(cairo_);
}

void Canvas::line(const std::vector<PointMm>& points, const PrintColour& colour, double width_mm, bool dashed) {
  cairo_new_path(cairo_);  // text leaves a current point behind
  cairo_set_source_rgb(cairo_, colour.r, colour.g, colour.b);
  cairo_set_line_width(cairo_, width_mm);
  const double dash[] = {1.0, 1.0};
  cairo_set_dash(cairo_, dash, dashed ? 2 : 0, 0);
  for (const PointMm& p : points) cairo_line_to(cairo_, p.x, p.y);
  cairo_stroke(cairo_);
}

double Canvas::text_width_mm(const std::string& text, double height_mm) {
  cairo_select_font_face(cairo_, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(cairo_, height_mm * 1.35);
  cairo_text_extents_t extents;
  cairo_text_extents(cairo_, text.c_str(), &extents);
  return extents.x_advance;
}

void Canvas::text(const std::string& text, PointMm at, double height_mm, Anchor anchor, double turn_deg) {
  const double width_mm = text_width_mm(text, height_mm);
  cairo_set_source_rgb(cairo_, 0, 0, 0);
  const double fraction = anchor == Anchor::left ? 0 : (anchor == Anchor::middle ? 0.5 : 1);
  cairo_save(cairo_);
  cairo_translate(cairo_, at.x, at.y);
  cairo_rotate(cairo_, rad_from_deg(turn_deg));
  cairo_move_to(cairo_, -fraction * width_mm, 0);
  cairo_show_text(cairo_, text.c_str());
  cairo_restore(cairo_);
}

void Canvas::arrow(PointMm from, PointMm to) {
  const PrintColour black{0, 0, 0};
  const double length = std::hypot(to.x - from.x, to.y - from.y);
  const double ax = (to.x - from.x) / length, ay = (to.y - from.y) / length;
  line({from, {to.x - 1.5 * ax, to.y - 1.5 * ay}}, black, 0.3);
  polygon(
      {to, {to.x - 2 * ax - 0.8 * ay, to.y - 2 * ay + 0.8 * ax}, {to.x - 2 * ax + 0.8 * ay, to.y - 2 * ay - 0.8 * ax}},
      black);
}

void Canvas::finish() {
  if (png_) cairo_surface_write_to_png_stream(surface_, write_to_stream, &file_.stream());
  cairo_surface_finish(surface_);
  if (cairo_surface_status(surface_) != CAIRO_STATUS_SUCCESS) throw InputError(path_.string(), "can't be drawn");
  file_.commit();
}

}  // namespace lapservo::internal
