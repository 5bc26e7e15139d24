#pragma once

#include <cairo.h>
#include <filesystem>
#include <string>
#include <vector>

#include "lapservo/core/atomic_file.h"
#include "lapservo/marker/drawing.h"

namespace lapservo::internal {

struct PointMm {
  double x, y;
};

/// A page in millimetres, y down, written as SVG, PDF or PNG by the name's ending; appears when finish()ed (see
/// AtomicFile).
class Canvas {
 public:
  Canvas(const std::filesystem::path& path, double width_mm, double height_mm);
  ~Canvas();
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  void polygon(const std::vector<PointMm>& points, const PrintColour& fill);
  void line(const std::vector<PointMm>& points, const PrintColour& colour, double width_mm, bool dashed = false);
  enum class Anchor { left, middle, right };
  void text(const std::string& text, PointMm at, double height_mm, Anchor anchor = Anchor::left, double turn_deg = 0);
  /// How far a text of this height reaches.
  double text_width_mm(const std::string& text, double height_mm);
  void arrow(PointMm from, PointMm to);
  void finish();

 private:
  std::filesystem::path path_;
  AtomicFile file_;
  cairo_surface_t* surface_ = nullptr;
  cairo_t* cairo_ = nullptr;
  bool png_ = false;
};

}  // namespace lapservo::internal
