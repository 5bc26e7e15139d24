// figure MEDIANS: the milliseconds of each detector over the size of the image, as an SVG on standard output. MEDIANS
// is report.sh's: name, width, height, instruments, milliseconds, fraction found, separated by tabs.
#include <array>
#include <fstream>
#include <iostream>
#include <map>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "lapservo/report/svg_plot.h"

namespace {
using namespace lapservo::internal;

struct Shown {
  std::string_view name, instruments, title;
  Draw draw;
  int colour;
};
constexpr std::array<Shown, 9> shown{{{"apriltag/decimate_1", "-", "AprilTag, decimate 1", Draw::dashed, 1},
                                      {"apriltag/decimate_2", "-", "AprilTag, decimate 2", Draw::line_and_points, 1},
                                      {"textbook", "-", "HSV, ranges, components", Draw::line_and_points, 4},
                                      {"aruco", "-", "aruco", Draw::line_and_points, 3},
                                      {"hsv_of_frame", "-", "BGR to HSV", Draw::dashed, 3},
                                      {"copy_frame", "-", "memcpy of the frame", Draw::line_and_points, -1},
                                      {"cold", "1", "lapservo, cold", Draw::line_and_points, 0},
                                      {"tracked", "1", "lapservo, tracked", Draw::line_and_points, 2},
                                      {"search_without_marker", "-", "lapservo, no marker", Draw::dashed, 0}}};

// Megapixels and milliseconds by name and number of instruments.
using Medians = std::map<std::pair<std::string, std::string>, std::map<double, double>>;

Medians read_medians(const std::string& path) {
  Medians medians;
  std::ifstream file(path);
  std::string line;
  while (std::getline(file, line)) {
    std::istringstream fields(line);
    std::string name, width, height, instruments, milliseconds;
    for (std::string* field : {&name, &width, &height, &instruments, &milliseconds}) std::getline(fields, *field, '\t');
    if (width != "-")
      medians[{name, instruments}][1e-6 * std::stod(width) * std::stod(height)] = std::stod(milliseconds);
  }
  return medians;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return std::cerr << "figure MEDIANS > FIGURE.svg\n", 2;
  Medians medians = read_medians(argv[1]);
  Plot plot;
  plot.title = "CPU time a frame, one core";
  plot.x = {"image", "megapixels", {}, {}, true};
  plot.y = {"time", "ms", {}, {}, true};
  for (const Shown& one : shown) {
    Series series{std::string(one.title), {}, {}, one.draw, one.colour};
    for (const auto& [megapixels, milliseconds] : medians[{std::string(one.name), std::string(one.instruments)}])
      series.x.push_back(megapixels), series.y.push_back(milliseconds);
    if (!series.x.empty()) plot.series.push_back(series);
  }
  if (plot.series.empty()) return std::cerr << "figure: " << argv[1] << " holds no medians\n", 2;
  // A stand-alone image needs its rules, a name space, and a page behind it.
  std::string svg = svg_from(plot);
  svg.insert(svg.find(' '), " xmlns=\"http://www.w3.org/2000/svg\"");
  svg.insert(svg.find('>') + 1,
             "<style>" + plot_css() + "</style><rect width=\"100%\" height=\"100%\" style=\"fill:var(--card)\"/>");
  std::cout << svg;
}
