#pragma once

#include <filesystem>
#include <string>
#include <variant>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/report/svg_plot.h"

namespace lapservo::internal {

/// A figure of the paper's beside ours.
struct Comparison {
  std::string what, paper, centerline, surface;  ///< with units; empty where there is none
};

struct Table {
  std::string caption;
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows = {};  ///< each as long as the header
  bool words = false;                               ///< sentences, which may break, not numbers
};

/// 8-bit BGR.
struct Picture {
  std::string title;
  cv::Mat bgr;
};

struct Figure {
  std::variant<Plot, Picture> content;
  std::string caption;
};

/// The colour of a title that says whether something is good enough.
enum class Verdict { none, good, bad };

/// One experiment. All text is plain.
struct ReportSection {
  std::string id;  ///< a word: the link to it
  std::string title;
  Verdict verdict = Verdict::none;
  std::vector<std::string> text = {};
  std::vector<Comparison> comparisons = {};  ///< those that have a figure of the paper's stand in the summary too
  std::vector<Figure> figures = {};
  std::vector<Table> tables = {};
  std::vector<std::string> notes = {};  ///< how to read it, what departs from the paper
  std::string command = {};             ///< that makes it again
  std::vector<std::string> files = {};  ///< CSVs beside the report
  std::string unfinished = {};          ///< what is missing, when it was stopped before its end
};

struct Report {
  std::string title;
  std::vector<std::string> text;
  std::vector<ReportSection> sections;
  std::string unfinished = {};  ///< what is missing, when it was stopped before its end: stands at the top
};

/// The comparisons that have a figure of the paper's.
std::vector<Comparison> with_paper(const ReportSection& section);

/// One HTML file without external resources: no network, figures as SVG, images embedded. Well-formed as XML too. The
/// same report gives the same bytes.
std::string html_from(const Report& report);

/// Appears whole or not at all. Throws InputError when it can't be written.
void write_report(const std::filesystem::path& path, const Report& report);

}  // namespace lapservo::internal
