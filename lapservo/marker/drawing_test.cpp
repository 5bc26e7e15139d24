#include "lapservo/marker/drawing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <regex>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>
#include <zlib.h>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/csv.h"
#include "lapservo/testing/has.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/markers.h"
#include "lapservo/testing/seeded_random.h"
#include "lapservo/testing/temporary_folder.h"

// Fontconfig, which cairo draws text with, keeps its caches until the end: no leak of ours.
extern "C" const char* __lsan_default_suppressions() {  // NOLINT(bugprone-reserved-identifier)
  return "leak:libfontconfig\n";
}

namespace lapservo::internal::drawing_test {
using Eigen::Vector2d;
using Eigen::Vector3d;
using namespace testing;

const Marker example = marker_with({0.0035, 0.0035, 0.017}, {0.0095, 0.0095, 0.005});
// A unit of cairo's fixed-point coordinates.
constexpr double rounding_mm = 0.01;

// A filled polygon on a page, millimetres from its top left corner, y down.
struct Polygon {
  Vector3d colour;
  std::vector<Vector2d> points_mm;

  Eigen::AlignedBox2d box() const {
    Eigen::AlignedBox2d box;
    for (const Vector2d& p : points_mm) box.extend(p);
    return box;
  }
  // Where a horizontal line enters and leaves it.
  std::array<double, 2> across(double y_mm) const {
    std::array<double, 2> span{1e9, -1e9};
    for (std::size_t i = 0; i < points_mm.size(); ++i) {
      const Vector2d &a = points_mm[i], &b = points_mm[(i + 1) % points_mm.size()];
      if ((a.y() <= y_mm) == (b.y() <= y_mm)) continue;
      const double x = a.x() + (y_mm - a.y()) / (b.y() - a.y()) * (b.x() - a.x());
      span = {std::min(span[0], x), std::max(span[1], x)};
    }
    return span;
  }
};

struct Page {
  double width_mm, height_mm;
  std::vector<Polygon> polygons;
};

double number(const std::string& text) {
  const auto value = parse_finite(text);
  if (!value) throw std::runtime_error("not a number: " + text);
  return *value;
}

std::vector<std::smatch> matches(const std::string& text, const std::regex& pattern) {
  return {std::sregex_iterator(text.begin(), text.end(), pattern), std::sregex_iterator()};
}

Page read_svg(const std::filesystem::path& path) {
  const std::string text = testing::read_file(path);
  static const std::regex header(R"re(width="([\d.]+)mm" height="([\d.]+)mm" viewBox="0 0 ([\d.]+) ([\d.]+)")re");
  std::smatch size;
  if (!std::regex_search(text, size, header)) throw std::runtime_error("the SVG has no size in millimetres");
  Page page{number(size[1]), number(size[2]), {}};
  const Vector2d mm_per_unit(page.width_mm / number(size[3]), page.height_mm / number(size[4]));
  static const std::regex polygon(R"re(fill(?::|=")rgb\(([\d.]+)%, ?([\d.]+)%, ?([\d.]+)%\)[^>]* d="(M [^C"]*?) Z)re");
  static const std::regex point(R"re([ML] ([-\d.]+) ([-\d.]+))re");
  for (const auto& match : matches(text, polygon)) {
    page.polygons.push_back({Vector3d(number(match[1]), number(match[2]), number(match[3])) / 100, {}});
    const std::string outline = match[4];
    for (const auto& p : matches(outline, point))
      page.polygons.back().points_mm.push_back(Vector2d(number(p[1]), number(p[2])).cwiseProduct(mm_per_unit));
  }
  return page;
}

// In the order in which they were drawn.
std::vector<Polygon> polygons_of(const Page& page, const PrintColour& colour) {
  std::vector<Polygon> found;
  for (const Polygon& polygon : page.polygons)
    if ((polygon.colour - Vector3d(colour.r, colour.g, colour.b)).norm() < 1e-3) found.push_back(polygon);
  return found;
}

std::vector<Polygon> bands_of(const Page& page, double hue_deg) {
  return polygons_of(page, print_colour(hue_deg));
}

// Rolls the sheet, which lies before the reader (x right, y down, z away), around a cylinder behind it whose axis
// points right, the print outside. Height on the sheet, from its upper edge, of the point at an azimuth that grows
// right-handed about the axis from the upper edge on.
double height_on_sheet_mm(double radius_mm, double tau_rad) {
  const Vector3d axis = Vector3d::UnitX(), to_reader = -Vector3d::UnitZ(), down = Vector3d::UnitY();
  const Vector3d normal = Eigen::AngleAxisd(tau_rad, axis) * to_reader;
  return radius_mm * wrap_two_pi(std::atan2(normal.dot(down), normal.dot(to_reader)));
}

void expect_wraps_into(const Page& page, const Marker& marker, double mm_per_mm) {
  std::array<Polygon, 3> bands;
  for (std::size_t i = 0; i < 3; ++i) {
    ASSERT_FALSE(bands_of(page, marker.hues_deg.at(i)).empty()) << "band " << i;
    bands.at(i) = bands_of(page, marker.hues_deg.at(i)).front();
  }
  const Vector2d corner = bands[0].box().min();
  for (double tau_rad = 0.05; tau_rad < two_pi; tau_rad += 0.2) {
    const auto along_m = boundaries_m(marker, tau_rad);
    const double y_mm = corner.y() + mm_per_mm * height_on_sheet_mm(1e3 * marker.radius_m(), tau_rad);
    for (std::size_t i = 0; i < 3; ++i) {
      const auto [proximal, distal] = bands.at(i).across(y_mm);
      EXPECT_NEAR((proximal - corner.x()) / mm_per_mm, 1e3 * along_m.at(i), 2 * rounding_mm) << "tau " << tau_rad;
      EXPECT_NEAR((distal - corner.x()) / mm_per_mm, 1e3 * along_m.at(i + 1), 2 * rounding_mm) << "tau " << tau_rad;
    }
  }
}

Vector2d size_mm(Paper paper) {
  return paper == Paper::a4 ? Vector2d(210, 297) : Vector2d(215.9, 279.4);
}

// The sheet read back from an SVG, which has the paper's size.
Page sheet_of(const Marker& marker, Paper paper, int copies) {
  const TemporaryFolder folder;
  write_print_sheet(folder / "sheet.svg", "PSM1", marker, paper, copies);
  const Page page = read_svg(folder / "sheet.svg");
  EXPECT_LT((Vector2d(page.width_mm, page.height_mm) - size_mm(paper)).norm(), rounding_mm);
  return page;
}

TEST(PrintSheet, WrappedAroundTheShaftGivesTheBoundariesThatTheMarkerPredicts) {
  expect_wraps_into(sheet_of(example, Paper::a4, 1), example, 1);
  testing::SeededRandom random(53);
  for (int i = 0; i < 5; ++i) {
    Marker marker = testing::random_marker(random);
    marker.diameter_m = random.uniform(0.004, 0.02);
    marker.hues_deg = {30, 150, 270};
    expect_wraps_into(sheet_of(marker, Paper::letter, 1), marker, 1);
  }
}

// Drawn as an SVG is, in points of 1/72 inch, turned y down at its start: the first polygon, the page, fills the paper.
TEST(PrintSheet, IsAPdfOfTheSameSize) {
  const TemporaryFolder folder;
  for (const Paper paper : {Paper::a4, Paper::letter}) {
    write_print_sheet(folder / "sheet.pdf", "PSM1", example, paper, 1);
    const std::string file = testing::read_file(folder / "sheet.pdf");
    const std::size_t begin = file.find("stream\n") + 7, size = file.find("\nendstream") - begin;
    std::string content(1 << 20, '\0');
    uLongf length = content.size();
    ASSERT_EQ(::uncompress(reinterpret_cast<Bytef*>(content.data()), &length,
                           reinterpret_cast<const Bytef*>(file.data() + begin), size),
              Z_OK);
    content.resize(length);
    const auto box = matches(file, std::regex(R"re(MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \])re")),
               drawn = matches(content, std::regex(R"re(\b0 0 ([\d.]+) ([\d.]+) re\s+f\b)re"));
    ASSERT_TRUE(!box.empty() && !drawn.empty()) << content.substr(0, 200);
    EXPECT_TRUE(content.starts_with("1 0 0 -1 0 " + box[0][2].str() + " cm"));
    for (const std::smatch& page : {box[0], drawn[0]})
      EXPECT_LT((25.4 / 72 * Vector2d(number(page[1]), number(page[2])) - size_mm(paper)).norm(), rounding_mm);
  }
}

// Both ends of each line of an SVG page.
std::vector<std::array<Vector2d, 2>> lines_of(const std::string& svg) {
  std::vector<std::array<Vector2d, 2>> lines;
  for (const auto& m : matches(svg, std::regex(R"re(d="M ([\d.]+) ([\d.]+) L ([\d.]+) ([\d.]+) ?")re")))
    lines.push_back({Vector2d(number(m[1]), number(m[2])), Vector2d(number(m[3]), number(m[4]))});
  return lines;
}

TEST(PrintSheet, HasRulersOfOneHundredAndFiftyMillimetres) {
  const TemporaryFolder folder;
  write_print_sheet(folder / "sheet.svg", "PSM1", example, Paper::a4, 1);
  const auto lines = lines_of(testing::read_file(folder / "sheet.svg"));
  const auto drawn = [&](const Vector2d& way) {
    return std::any_of(lines.begin(), lines.end(),
                       [&](const auto& line) { return (line[1] - line[0] - way).norm() < rounding_mm; });
  };
  EXPECT_TRUE(drawn({100, 0}));
  EXPECT_TRUE(drawn({0, 50}));
}

TEST(PrintSheet, HoldsTheCopiesThatFitBesideOneAnother) {
  for (const auto& [asked, wanted] : {std::pair(1, 1U), std::pair(7, 7U), std::pair(1000, 25U)}) {
    const Page page = sheet_of(example, Paper::a4, asked);
    const auto first = bands_of(page, 90), last = bands_of(page, 270), tabs = polygons_of(page, {0.93, 0.93, 0.93});
    ASSERT_EQ(first.size(), wanted);
    ASSERT_EQ(last.size(), wanted);
    ASSERT_EQ(tabs.size(), wanted);
    std::vector<Eigen::AlignedBox2d> copies;
    for (std::size_t i = 0; i < wanted; ++i) {
      const Eigen::AlignedBox2d marker = first[i].box().merged(last[i].box());
      EXPECT_NEAR(tabs[i].box().min().y(), marker.max().y(), rounding_mm) << "the tab continues the print";
      const Eigen::AlignedBox2d copy = marker.merged(tabs[i].box());
      for (const Eigen::AlignedBox2d& other : copies) EXPECT_GT(copy.exteriorDistance(other), 10) << "room to cut";
      copies.push_back(copy);
    }
  }
}

// Where letters begin on an SVG page.
std::vector<Vector2d> letters(const std::string& svg) {
  std::vector<Vector2d> found;
  for (const auto& match : matches(svg, std::regex(R"re(<use xlink:href="#[^"]*" x="([-\d.]+)" y="([-\d.]+)"/>)re")))
    found.emplace_back(number(match[1]), number(match[2]));
  return found;
}

TEST(PrintSheet, KeepsAwayFromThePapersEdges) {
  const TemporaryFolder folder;
  for (const Paper paper : {Paper::a4, Paper::letter})
    for (const std::string& name : {std::string("PSM1"), std::string(120, 'W')}) {
      write_print_sheet(folder / "sheet.svg", name, example, paper, 1000);
      const Page page = read_svg(folder / "sheet.svg");
      const std::string text = testing::read_file(folder / "sheet.svg");
      std::vector<Vector2d> points = letters(text);
      for (const auto& line : lines_of(text)) points.insert(points.end(), line.begin(), line.end());
      for (const Polygon& polygon : page.polygons)
        if (polygon.colour != Vector3d::Ones())  // else the page itself
          points.insert(points.end(), polygon.points_mm.begin(), polygon.points_mm.end());
      for (const Vector2d& p : points)
        EXPECT_TRUE(p.x() > 10 && p.y() > 10 && p.x() < page.width_mm - 10 && p.y() < page.height_mm - 10)
            << p.transpose();
    }
}

// Each copy, once cut out, has its name and its direction; the bands stay clean.
TEST(PrintSheet, EveryCopysTabHasTheNameAndAnArrowToTheTip) {
  const TemporaryFolder folder;
  for (const std::string name : {"PSM1", "needle driver with a long name"}) {
    write_print_sheet(folder / "sheet.svg", name, example, Paper::a4, 3);
    const Page page = read_svg(folder / "sheet.svg");
    const auto tabs = polygons_of(page, {0.93, 0.93, 0.93}), heads = polygons_of(page, {0, 0, 0}),
               bands = bands_of(page, 180);
    const auto written = letters(testing::read_file(folder / "sheet.svg"));
    ASSERT_EQ(tabs.size(), 3U);
    for (std::size_t i = 0; i < tabs.size(); ++i) {
      const Eigen::AlignedBox2d tab = tabs[i].box();
      const auto on_tab =
          std::count_if(written.begin(), written.end(), [&](const Vector2d& p) { return tab.contains(p); });
      const auto spaces = std::count(name.begin(), name.end(), ' ');
      EXPECT_GE(on_tab, static_cast<std::ptrdiff_t>(name.size()) - spaces + 3) << name << ", tip";
      const auto points_to_tip = [&](const Polygon& head) {
        return tab.contains(head.box()) && head.points_mm.size() == 3 &&
               head.points_mm[0].x() > head.points_mm[1].x() && head.points_mm[0].x() > head.points_mm[2].x();
      };
      EXPECT_EQ(std::count_if(heads.begin(), heads.end(), points_to_tip), 1) << name;
      const Eigen::AlignedBox2d band(Vector2d(tab.min().x(), bands.at(i).box().min().y()),
                                     Vector2d(tab.max().x(), tab.min().y() - rounding_mm));
      EXPECT_FALSE(std::any_of(written.begin(), written.end(), [&](const Vector2d& p) { return band.contains(p); }));
    }
  }
}

TEST(PrintSheet, RefusesWhatDoesNotFitAndLeavesNothingBehind) {
  const TemporaryFolder folder;
  Marker huge = example;
  huge.diameter_m = 0.07;
  const auto refusal = [&](const std::string& name, const Marker& marker, int copies = 1) {
    return input_error([&] { write_print_sheet(folder / name, "PSM1", marker, Paper::a4, copies); });
  };
  for (const int copies : {0, -1}) EXPECT_TRUE(testing::has(refusal("sheet.svg", example, copies), "copies"));
  const std::string place = folder.path().string() + "/";
  EXPECT_EQ(refusal("sheet.svg", huge), place + "sheet.svg: the marker of 24 x 220 mm does not fit on the paper");
  EXPECT_EQ(refusal("sheet.doc", example),
            place + "sheet.doc: name: is .doc, expected one that ends in .svg, .pdf or .png");
  EXPECT_EQ(refusal("sheet", example),
            place + "sheet: name: is without an ending, expected one that ends in .svg, .pdf or .png");
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(MarkerPicture, ShowsTheMarkerAsItIsWrapped) {
  const TemporaryFolder folder;
  for (const Marker& marker : {example, marker_with({0.004, 0.012, 0.008}, {0.012, 0.004, 0.008})}) {
    write_marker_picture(folder / "marker.svg", "PSM1", marker, {});
    const Page page = read_svg(folder / "marker.svg");
    const double height = bands_of(page, 90).at(0).box().sizes().y();
    expect_wraps_into(page, marker, height / (1e3 * pi * marker.diameter_m));
  }
}

TEST(MarkerPicture, KeepsItsLettersOnThePage) {
  const TemporaryFolder folder;
  write_marker_picture(folder / "marker.svg", std::string(80, 'M'), example, {110000, 1.1, 12.34});
  constexpr double letter_mm = 3;
  const auto written = letters(testing::read_file(folder / "marker.svg"));
  ASSERT_GT(written.size(), 100U);
  for (const Vector2d& p : written)
    EXPECT_TRUE(Eigen::AlignedBox2d(Vector2d(0, 0), Vector2d(150 - letter_mm, 200)).contains(p)) << p.transpose();
}

TEST(MarkerPicture, IsAlsoAPng) {
  const TemporaryFolder folder;
  write_marker_picture(folder / "marker.png", "PSM1", example, {});
  const std::string bytes = testing::read_file(folder / "marker.png");
  const std::string head("\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\x04\xb0\0\0\x06\x40", 24);  // 1200 x 1600
  EXPECT_EQ(bytes.substr(0, head.size()), head);
  EXPECT_NE(bytes.find("IEND"), std::string::npos);
}

double hue_of_deg(const PrintColour& c) {
  return deg_from_rad(wrap_two_pi(std::atan2(std::sqrt(3.0) * (c.g - c.b), 2 * c.r - c.g - c.b)));
}

TEST(PrintColour, HasTheHueAndIsPrintable) {
  // The hexagon's hue and the circle's agree at multiples of 30 degrees.
  for (int hue_deg = 0; hue_deg < 360; hue_deg += 30) {
    const PrintColour colour = print_colour(hue_deg);
    EXPECT_NEAR(std::remainder(hue_of_deg(colour) - hue_deg, 360), 0, 1e-6) << hue_deg;
    for (const double value : {colour.r, colour.g, colour.b}) EXPECT_TRUE(value >= 0 && value <= 1) << hue_deg;
  }
}

}  // namespace lapservo::internal::drawing_test
