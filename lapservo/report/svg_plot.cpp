#include "lapservo/report/svg_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "lapservo/core/statistics.h"

namespace lapservo::internal {
namespace {

constexpr double width_px = 480, height_px = 320, font_px = 14, character_px = 7.9;
constexpr double right_px = 14, bottom_px = 46, legend_row_px = 20;
constexpr std::size_t max_hover_points = 150;

struct Range {
  double low, high;
};

// From axis values to the drawing.
struct Scale {
  Range range;
  bool logarithmic;
  double at_low_px, at_high_px;

  double value(double v) const { return logarithmic ? std::log10(v) : v; }
  double operator()(double v) const {
    const double low = value(range.low), fraction = (value(v) - low) / (value(range.high) - low);
    return at_low_px + fraction * (at_high_px - at_low_px);
  }
  bool drawable(double v) const { return std::isfinite(v) && (!logarithmic || v > 0); }
};

struct LegendEntry {
  const Series* series;  // null for a reference line
  std::string name;
  double x_px, y_px;
};

// Where everything goes.
struct Layout {
  std::vector<LegendEntry> legend;
  double height_px, left_px, top_px, bottom_edge_px;
  Scale x, y;
};

void extend(Range& range, double value, bool logarithmic) {
  if (!std::isfinite(value) || (logarithmic && value <= 0)) return;
  range.low = std::min(range.low, value);
  range.high = std::max(range.high, value);
}

// With some room about the data; never empty.
Range padded(Range range, const Axis& axis) {
  if (range.low > range.high) range = axis.logarithmic ? Range{0.1, 10} : Range{0, 1};
  if (axis.logarithmic) {
    const double room = std::pow(10, std::max(0.15, 0.05 * std::log10(range.high / range.low)));
    range = {range.low / room, range.high * room};
  } else {
    const double span = range.high - range.low, size = std::max(std::abs(range.low), std::abs(range.high));
    const double room = span > 1e-9 * size ? 0.05 * span : size > 0 ? 0.5 * size : 1;
    range = {range.low - room, range.high + room};
  }
  return {axis.low.value_or(range.low), axis.high.value_or(range.high)};
}

Range range_of(const Plot& plot, const Axis& axis, std::vector<double> Series::*values,
               const std::vector<ReferenceLine>& references) {
  Range range{HUGE_VAL, -HUGE_VAL};
  for (const Series& series : plot.series)
    for (const double value : series.*values) extend(range, value, axis.logarithmic);
  for (const ReferenceLine& line : references) extend(range, line.y, axis.logarithmic);
  return padded(range, axis);
}

std::vector<double> ticks_of(const Scale& scale, int most) {
  return scale.logarithmic ? nice_logarithmic_ticks(scale.range.low, scale.range.high)
                           : nice_ticks(scale.range.low, scale.range.high, most);
}

// Characters, not bytes.
std::size_t length_of(const std::string& text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
}

std::string with_unit(const Axis& axis) {
  return axis.unit.empty() ? axis.label : axis.label + " [" + axis.unit + "]";
}

std::string number(double value) {
  return fmt::format("{:.4g}", value);
}

std::string colour_class(int colour) {
  return colour < 0 ? "grey" : fmt::format("c{}", colour % 5);
}

// A point's mark, of about the same area for every shape.
std::string mark(const char* css_class, int colour, double x, double y, double size) {
  static constexpr std::array shapes{"M-1 0a1 1 0 1 0 2 0a1 1 0 1 0-2 0z", "M-.9-.9h1.8v1.8h-1.8z",
                                     "M0-1.2l1.2 2.1h-2.4z", "M0-1.3l1.3 1.3-1.3 1.3-1.3-1.3z", "M0 1.2l1.2-2.1h-2.4z"};
  return fmt::format("<path class=\"{}{}\" transform=\"translate({:.1f} {:.1f}) scale({:.1f})\" d=\"{}\"", css_class,
                     colour_class(colour), x, y, size, shapes[colour < 0 ? 0 : static_cast<std::size_t>(colour % 5)]);
}

bool has_line(Draw draw) {
  return draw != Draw::points && draw != Draw::rings && draw != Draw::boxes;
}
bool has_points(Draw draw) {
  return draw == Draw::points || draw == Draw::rings || draw == Draw::line_and_points;
}

bool drawable(const Layout& layout, const Series& series, std::size_t i) {
  return layout.x.drawable(series.x[i]) && layout.y.drawable(series.y[i]);
}

std::string line_path(const Layout& layout, const Series& series) {
  std::string path;
  bool down = false;
  for (std::size_t i = 0; i < series.x.size(); ++i) {
    const bool here = drawable(layout, series, i);
    if (here) path += fmt::format("{}{:.1f} {:.1f}", down ? 'L' : 'M', layout.x(series.x[i]), layout.y(series.y[i]));
    down = here;
  }
  return path;
}

std::string hover_text(const Plot& plot, const Series& series, std::size_t i) {
  const auto part = [](const Axis& axis, double value) {
    return fmt::format("{} {}{}{}", axis.label, number(value), axis.unit.empty() ? "" : " ", axis.unit);
  };
  std::string text = series.name.empty() ? "" : series.name + ": ";
  return escaped(text + part(plot.x, series.x[i]) + ", " + part(plot.y, series.y[i]));
}

const char* point_class(Draw draw) {
  return draw == Draw::rings ? "ring s-" : "point f-";
}

std::string points_of(const Plot& plot, const Layout& layout, const Series& series) {
  const double point = series.x.size() > 300 ? 2 : series.x.size() > 100 ? 2.6 : 3.6;
  const double size = series.draw == Draw::rings ? 1.8 * point : point;
  std::string text;
  for (std::size_t i = 0; i < series.x.size(); ++i) {
    if (!drawable(layout, series, i)) continue;
    text += mark(point_class(series.draw), series.colour, layout.x(series.x[i]), layout.y(series.y[i]), size) +
            "><title>" + hover_text(plot, series, i) + "</title></path>\n";
  }
  return text;
}

// The statistics that a box shows.
struct Box {
  double low_whisker, low, median, high, high_whisker;
};

Box box_of(const std::vector<double>& values) {
  const double low = quantile_of(values, 0.25), high = quantile_of(values, 0.75), reach = 1.5 * (high - low);
  Box box{low, low, quantile_of(values, 0.5), high, high};
  for (const double value : values) {
    if (value >= low - reach) box.low_whisker = std::min(box.low_whisker, value);
    if (value <= high + reach) box.high_whisker = std::max(box.high_whisker, value);
  }
  return box;
}

std::string box_at(const Layout& layout, double x_px, double half_px, const Box& box, const std::string& colour) {
  const double low = layout.y(box.low), high = layout.y(box.high), middle = layout.y(box.median);
  return fmt::format("<path class=\"bar s-{0}\" d=\"M{1:.1f} {2:.1f}V{3:.1f}M{1:.1f} {4:.1f}V{5:.1f}\"/>", colour, x_px,
                     layout.y(box.low_whisker), low, high, layout.y(box.high_whisker)) +
         fmt::format("<path class=\"box s-{0} f-{0}\" d=\"M{1:.1f} {2:.1f}h{3:.1f}V{4:.1f}h{5:.1f}z\"/>", colour,
                     x_px - half_px, low, 2 * half_px, high, -2 * half_px) +
         fmt::format("<path class=\"line s-{0}\" d=\"M{1:.1f} {2:.1f}h{3:.1f}\"/>\n", colour, x_px - half_px, middle,
                     2 * half_px);
}

std::string boxes_of(const Plot& plot, const Layout& layout, const Series& series) {
  std::map<double, std::vector<double>> by_x;
  for (std::size_t i = 0; i < series.x.size(); ++i)
    if (drawable(layout, series, i)) by_x[series.x[i]].push_back(series.y[i]);
  const double room_px = std::abs(layout.x.at_high_px - layout.x.at_low_px) / (static_cast<double>(by_x.size()) + 1);
  Series beyond{series.name, {}, {}, Draw::points, series.colour};
  std::string text;
  for (const auto& [x, values] : by_x) {
    const Box box = box_of(values);
    text += box_at(layout, layout.x(x), std::min(12.0, 0.3 * room_px), box, colour_class(series.colour));
    for (const double value : values)
      if (value < box.low_whisker || value > box.high_whisker) beyond.x.push_back(x), beyond.y.push_back(value);
  }
  return text + points_of(plot, layout, beyond);
}

// A line's points have no marks, but show their numbers all the same.
std::string hover_points_of(const Plot& plot, const Layout& layout, const Series& series) {
  std::string text;
  const std::size_t step = std::max<std::size_t>(1, (series.x.size() + max_hover_points - 1) / max_hover_points);
  for (std::size_t i = 0; i < series.x.size(); i += step)
    if (drawable(layout, series, i))
      text += fmt::format("<circle class=\"hover\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"7\"><title>{}</title></circle>\n",
                          layout.x(series.x[i]), layout.y(series.y[i]), hover_text(plot, series, i));
  return text;
}

std::string drawn(const Plot& plot, const Layout& layout, const Series& series) {
  if (series.draw == Draw::boxes) return boxes_of(plot, layout, series);
  std::string text;
  if (has_line(series.draw))
    text += fmt::format("<path class=\"line s-{}{}\" d=\"{}\"/>\n", colour_class(series.colour),
                        series.draw == Draw::dashed ? " dashed" : "", line_path(layout, series));
  return text + (has_points(series.draw) ? points_of(plot, layout, series) : hover_points_of(plot, layout, series));
}

// In rows above the plot.
std::vector<LegendEntry> legend_of(const Plot& plot) {
  std::vector<LegendEntry> entries;
  double x = 8, y = 40;
  const auto add = [&](const Series* series, const std::string& name) {
    const double needed = 38 + character_px * static_cast<double>(length_of(name));
    if (x > 8 && x + needed > width_px) x = 8, y += legend_row_px;
    entries.push_back({series, name, x, y});
    x += needed;
  };
  for (const Series& series : plot.series)
    if (!series.name.empty()) add(&series, series.name);
  for (const ReferenceLine& line : plot.references) add(nullptr, line.name);
  return entries;
}

std::string drawn(const LegendEntry& entry) {
  std::string text;
  const double middle = entry.y_px - 4.5;
  const int colour = entry.series ? entry.series->colour : -1;
  if (!entry.series || has_line(entry.series->draw) || !has_points(entry.series->draw))
    text += fmt::format("<path class=\"line s-{}{}\" d=\"M{:.1f} {:.1f}h22\"/>", colour_class(colour),
                        !entry.series || entry.series->draw == Draw::dashed ? " dashed" : "", entry.x_px, middle);
  if (entry.series && has_points(entry.series->draw))
    text += mark(point_class(entry.series->draw), colour, entry.x_px + 11, middle, 4) + "/>";
  return text +
         fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\">{}</text>\n", entry.x_px + 28, entry.y_px, escaped(entry.name));
}

// Widens the axis that has more room than one common scale needs.
void make_isotropic(Layout& layout) {
  const auto px_per_unit = [](const Scale& s) {
    return std::abs(s.at_high_px - s.at_low_px) / (s.range.high - s.range.low);
  };
  const double common = std::min(px_per_unit(layout.x), px_per_unit(layout.y));
  for (Scale* scale : {&layout.x, &layout.y}) {
    const double middle = (scale->range.low + scale->range.high) / 2;
    const double half = std::abs(scale->at_high_px - scale->at_low_px) / common / 2;
    scale->range = {middle - half, middle + half};
  }
}

Layout layout_of(const Plot& plot) {
  std::vector<LegendEntry> legend = legend_of(plot);
  const double top = legend.empty() ? 32 : legend.back().y_px + 14;
  const double total = height_px + (plot.image_plane ? 40 : 0) + std::max(0.0, top - 54);
  const double bottom_edge = total - bottom_px;
  Layout layout{std::move(legend),
                total,
                0,
                top,
                bottom_edge,
                {range_of(plot, plot.x, &Series::x, {}), plot.x.logarithmic, 0, width_px - right_px},
                {range_of(plot, plot.y, &Series::y, plot.references), plot.y.logarithmic, bottom_edge, top}};
  if (plot.image_plane) std::swap(layout.y.at_low_px, layout.y.at_high_px);
  const auto place_left = [&layout] {
    std::size_t widest = 1;
    for (const std::string& label : tick_labels(ticks_of(layout.y, 6))) widest = std::max(widest, length_of(label));
    layout.left_px = 30 + character_px * static_cast<double>(widest);
    layout.x.at_low_px = layout.left_px;
  };
  place_left();
  if (plot.image_plane) {
    make_isotropic(layout);
    place_left();
    make_isotropic(layout);
  }
  return layout;
}

std::string axes(const Plot& plot, const Layout& layout) {
  const double bottom_edge_px = layout.bottom_edge_px;
  std::string text;
  const auto x_ticks = ticks_of(layout.x, 7), y_ticks = ticks_of(layout.y, 6);
  const auto x_labels = tick_labels(x_ticks), y_labels = tick_labels(y_ticks);
  for (std::size_t i = 0; i < x_ticks.size(); ++i) {
    const double x = layout.x(x_ticks[i]);
    text += fmt::format("<path class=\"grid\" d=\"M{:.1f} {:.1f}V{:.1f}\"/>", x, layout.top_px, bottom_edge_px);
    text += fmt::format("<text class=\"middle\" x=\"{:.1f}\" y=\"{:.1f}\">{}</text>\n", x, bottom_edge_px + 17,
                        x_labels[i]);
  }
  for (std::size_t i = 0; i < y_ticks.size(); ++i) {
    const double y = layout.y(y_ticks[i]);
    text += fmt::format("<path class=\"grid\" d=\"M{:.1f} {:.1f}H{:.1f}\"/>", layout.left_px, y, width_px - right_px);
    text += fmt::format("<text class=\"end\" x=\"{:.1f}\" y=\"{:.1f}\">{}</text>\n", layout.left_px - 5, y + 5,
                        y_labels[i]);
  }
  text += fmt::format("<path class=\"frame\" d=\"M{:.1f} {:.1f}V{:.1f}H{:.1f}\"/>\n", layout.left_px, layout.top_px,
                      bottom_edge_px, width_px - right_px);
  text += fmt::format("<text class=\"middle\" x=\"{:.1f}\" y=\"{:.1f}\">{}</text>\n",
                      (layout.left_px + width_px - right_px) / 2, bottom_edge_px + 38, escaped(with_unit(plot.x)));
  const double middle = (layout.top_px + bottom_edge_px) / 2;
  text += fmt::format("<text class=\"middle\" transform=\"translate(15 {:.1f}) rotate(-90)\">{}</text>\n", middle,
                      escaped(with_unit(plot.y)));
  return text;
}

// The same plot always has the same name, and different ones differ: clip paths are shared by the whole page.
std::string clip_name(const std::string& content) {
  std::uint64_t hash = 0xcbf29ce484222325ULL;  // FNV-1a
  for (const char c : content) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3ULL;
  return fmt::format("clip-{:016x}", hash);
}

}  // namespace

std::vector<double> nice_ticks(double low, double high, int most) {
  const double rough = (high - low) / most;
  double power = std::pow(10, std::floor(std::log10(rough)));
  for (;; power *= 10)
    for (const double factor : {1.0, 2.0, 5.0}) {
      const double step = factor * power, slack = 1e-9;
      const double first = std::ceil(low / step - slack), last = std::floor(high / step + slack);
      if (last - first + 1 > most) continue;
      std::vector<double> ticks;
      for (double i = first; i <= last; ++i) ticks.push_back(i == 0 ? 0.0 : i * step);
      return ticks;
    }
}

std::vector<double> nice_logarithmic_ticks(double low, double high) {
  const auto ticks_with = [&](const std::vector<double>& factors, int every) {
    std::vector<double> ticks;
    for (int power = static_cast<int>(std::floor(std::log10(low))); power <= std::ceil(std::log10(high)); ++power) {
      if (power % every != 0) continue;
      for (const double factor : factors) {
        const double tick = factor * std::pow(10, power);
        if (tick >= low * (1 - 1e-9) && tick <= high * (1 + 1e-9)) ticks.push_back(tick);
      }
    }
    return ticks;
  };
  const double decades = std::log10(high / low);
  if (decades < 1) return nice_ticks(low, high, 6);
  if (decades < 2.5) return ticks_with({1, 2, 5}, 1);
  return ticks_with({1}, std::max(1, static_cast<int>(std::ceil(decades / 7))));
}

std::vector<std::string> tick_labels(const std::vector<double>& ticks) {
  std::vector<std::string> labels;
  double least = HUGE_VAL, most = 0;
  for (std::size_t i = 0; i < ticks.size(); ++i) {
    if (i > 0) least = std::min(least, std::abs(ticks[i] - ticks[i - 1]));
    most = std::max(most, std::abs(ticks[i]));
  }
  const double wanted = std::isfinite(least) && least > 0 ? -std::floor(std::log10(least) + 1e-9) : 3;
  const bool plain = wanted <= 6 && most < 1e6;
  const bool even = ticks.size() < 3 || ticks.back() - ticks[ticks.size() - 2] < 1.5 * (ticks[1] - ticks[0]);
  for (const double tick : ticks) {
    if (plain && even) {
      labels.push_back(fmt::format("{:.{}f}", tick, static_cast<int>(std::max(0.0, wanted))));
    } else {
      const int digits = even ? static_cast<int>(std::max(1.0, std::floor(std::log10(most)) + wanted + 1)) : 6;
      labels.push_back(fmt::format("{:.{}g}", tick, digits));
    }
  }
  return labels;
}

std::string escaped(const std::string& text) {
  static const std::map<char, std::string> entities{
      {'&', "&amp;"}, {'<', "&lt;"}, {'>', "&gt;"}, {'"', "&quot;"}, {'\'', "&#39;"}};
  std::string safe;
  for (const char c : text) {
    const auto entity = entities.find(c);
    if (entity != entities.end())
      safe += entity->second;
    else if (static_cast<unsigned char>(c) >= 0x20 || c == '\n' || c == '\t')
      safe += c;  // others are not HTML
  }
  return safe;
}

Plot time_plot(std::string title, std::string label, std::string unit, std::vector<Series> series) {
  return {std::move(title), {"time", "s"}, {std::move(label), std::move(unit)}, std::move(series)};
}

std::string svg_from(const Plot& plot) {
  const Layout layout = layout_of(plot);
  std::string content;
  for (const ReferenceLine& line : plot.references)
    content +=
        fmt::format("<path class=\"line s-grey dashed\" d=\"M{:.1f} {:.1f}H{:.1f}\"><title>{}: {}</title></path>\n",
                    layout.left_px, layout.y(line.y), width_px - right_px, escaped(line.name), number(line.y));
  for (const Series& series : plot.series) content += drawn(plot, layout, series);
  std::string text = fmt::format("<svg class=\"plot\" viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" aria-label=\"{}\">\n",
                                 width_px, layout.height_px, escaped(plot.title));
  text += fmt::format("<text class=\"title\" x=\"8\" y=\"{:.0f}\">{}</text>\n", font_px + 4, escaped(plot.title));
  for (const LegendEntry& entry : layout.legend) text += drawn(entry);
  text += axes(plot, layout);
  const std::string clip = clip_name(text + content);
  text += fmt::format(
      "<clipPath id=\"{}\"><rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\"/></clipPath>\n", clip,
      layout.left_px, layout.top_px, width_px - right_px - layout.left_px, layout.bottom_edge_px - layout.top_px);
  return text + fmt::format("<g clip-path=\"url(#{})\">\n", clip) + content + "</g>\n</svg>\n";
}

std::size_t points_outside(const Plot& plot) {
  const Layout layout = layout_of(plot);
  const auto inside = [](const Range& range, double value) { return value >= range.low && value <= range.high; };
  std::size_t count = 0;
  for (const Series& series : plot.series)
    for (std::size_t i = 0; i < series.x.size(); ++i)
      if (drawable(layout, series, i) && !(inside(layout.x.range, series.x[i]) && inside(layout.y.range, series.y[i])))
        ++count;
  return count;
}

void limit_to_most(Plot& plot, double room) {
  std::vector<double> distances;
  for (const Series& series : plot.series)
    for (std::size_t i = 0; i < series.x.size(); ++i)
      if (const double distance = std::hypot(series.x[i], series.y[i]); std::isfinite(distance))
        distances.push_back(distance);
  const double limit = room * quantile_of(distances, 0.9);
  if (!(limit > 0) || *std::max_element(distances.begin(), distances.end()) < limit) return;
  for (Axis* axis : {&plot.x, &plot.y}) axis->low = -limit, axis->high = limit;
}

std::string plot_css() {
  std::string css =
      ":root{--c0:#0072b2;--c1:#d55e00;--c2:#00855f;--c3:#b0478a;--c4:#a67200;--grey:#6b7280;--grid:#e3e6ea;"
      "--ink:#1c2127;--page:#fbfbfa;--card:#fff;--edge:#d9dde3;--soft:#4d5661}\n"
      "@media(prefers-color-scheme:dark){:root{--c0:#56b4e9;--c1:#f0883e;--c2:#3fc99b;--c3:#e29ac6;--c4:#e6b422;"
      "--grey:#9aa4b0;--grid:#2d333b;--ink:#e8eaed;--page:#14171b;--card:#1c2026;--edge:#343b44;--soft:#b3bcc6}}\n"
      ".plot{display:block;width:100%;height:auto;font:14px system-ui,sans-serif;fill:var(--ink)}\n"
      ".plot .title{font-weight:600}.plot .middle{text-anchor:middle}.plot .end{text-anchor:end}\n"
      ".plot .grid{stroke:var(--grid);fill:none}.plot .frame{stroke:var(--grey);fill:none}\n"
      ".plot .line{fill:none;stroke-width:1.8;stroke-linejoin:round}.plot .dashed{stroke-dasharray:6 4}\n"
      ".plot .box{fill-opacity:.25;stroke-width:1.4}.plot "
      ".bar{stroke-width:1.4;opacity:.6}.plot .hover{fill:transparent}\n"
      ".plot .ring{fill:none;stroke-width:1.4}.plot .ring,.plot .point{vector-effect:non-scaling-stroke}\n"
      ".plot .point{fill-opacity:.8}.plot .point:hover,.plot .hover:hover{stroke:var(--ink);stroke-width:1.5}\n";
  for (const char* name : {"c0", "c1", "c2", "c3", "c4", "grey"})
    css += fmt::format(".s-{0}{{stroke:var(--{0})}}.f-{0}{{fill:var(--{0})}}\n", name);
  return css;
}

}  // namespace lapservo::internal
