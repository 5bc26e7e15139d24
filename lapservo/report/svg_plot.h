#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace lapservo::internal {

/// How a series is drawn. Its colour and the shape of its points follow from `Series::colour`. `rings`: points as
/// larger outlines, which show around points of another series at the same places. `boxes`: the points of equal x as
/// one box from quartile to quartile with its median; whiskers to the farthest point within 1.5 times the box's height,
/// the points beyond as points.
enum class Draw { line, dashed, points, rings, line_and_points, boxes };

/// A run of points, in the units of the axes. Points that are not finite leave a gap.
struct Series {
  std::string name;
  std::vector<double> x, y;
  Draw draw = Draw::line;
  int colour = 0;  ///< 0 to 4, of the report's palette; -1 grey
};

using PlotPoint = std::optional<std::pair<double, double>>;

/// A point for each item that has one: `point_of` gives a PlotPoint.
template <typename Items, typename PointOf>
Series series_of(std::string name, const Items& items, PointOf point_of, Draw draw, int colour) {
  Series series{std::move(name), {}, {}, draw, colour};
  for (const auto& item : items)
    if (const PlotPoint point = point_of(item)) series.x.push_back(point->first), series.y.push_back(point->second);
  return series;
}

struct Axis {
  std::string label, unit;
  std::optional<double> low = {}, high = {};  ///< else from the data
  bool logarithmic = false;                   ///< then values of 0 and below are not drawn
};

/// A horizontal line to compare with.
struct ReferenceLine {
  std::string name;
  double y;
};

struct Plot {
  std::string title;
  Axis x, y;
  std::vector<Series> series = {};
  std::vector<ReferenceLine> references = {};
  bool image_plane = false;  ///< one scale for both axes, y down
};

/// Over time: the x axis is "time [s]".
Plot time_plot(std::string title, std::string label, std::string unit, std::vector<Series> series);

/// The plot as an <svg> element for an HTML page that has plot_css(). Readable at 340 px of width; every point shows
/// its numbers under the pointer.
std::string svg_from(const Plot& plot);

/// How many points the axes of svg_from() leave out, because a limit is nearer than the data.
std::size_t points_outside(const Plot& plot);

/// Limits an image-plane plot to where most points are, when single ones would ruin its scale: to `room` times the
/// distance from (0, 0) that nine tenths of all points keep, if any lies beyond that.
void limit_to_most(Plot& plot, double room = 1.5);

/// The style rules that the elements of svg_from() need, and the palette for light and dark (Okabe and Ito's, which the
/// colour-blind can distinguish).
std::string plot_css();

/// Round numbers (1, 2 or 5 times a power of ten apart) in [low, high], at most `most` (5 or more) and at least two.
/// Needs finite low < high.
std::vector<double> nice_ticks(double low, double high, int most);

/// The same for a logarithmic axis, low > 0: powers of ten, with 2 and 5 times them where few powers fit.
std::vector<double> nice_logarithmic_ticks(double low, double high);

/// Labels of ticks, as short as they stay distinct.
std::vector<std::string> tick_labels(const std::vector<double>& ticks);

/// Text for HTML and SVG, in elements and in quoted attributes.
std::string escaped(const std::string& text);

}  // namespace lapservo::internal
