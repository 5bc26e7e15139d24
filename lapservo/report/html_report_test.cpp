#include "lapservo/report/html_report.h"

#include <gtest/gtest.h>

#include "lapservo/io/image_file.h"
#include "lapservo/report/test_markup.h"

namespace lapservo::internal::html_report_test {

Report sample_report(const std::string& word = "word") {
  ReportSection section;
  section.id = "one";
  section.title = word;
  section.text = {word, word};
  section.comparisons = {{word, "1.49 px", "0.2 px", ""}, {word, "", "", "1"}};
  Plot plot{word, {"time", "s", {}, {}}, {word, "px", {}, {}}, {}, {}, false};
  plot.series.push_back({word, {0, 1, 2}, {1, 3, 2}, Draw::line_and_points, 0});
  section.figures.push_back({plot, word});
  cv::Mat image(40, 60, CV_8UC3, cv::Scalar(200, 40, 20));
  section.figures.push_back({Picture{word, image}, word});
  section.tables = {{word, {word, "b"}, {{"1", word}, {"2", "3"}}}};
  section.notes = {word};
  section.command = "lapservo experiment " + word;
  section.files = {"one.csv"};
  return {word, {word}, {section}};
}

// Style and script are not markup.
std::string without(std::string html, const std::string& tag) {
  const std::size_t begin = html.find("<" + tag + ">"), end = html.find("</" + tag + ">");
  EXPECT_NE(begin, std::string::npos);
  return html.erase(begin, end + tag.size() + 3 - begin);
}

TEST(HtmlReport, IsWellFormedWhateverTheTexts) {
  const std::string html = html_from(sample_report("<b>\"quoted\" & 'single'</b><script>alert(1)</script>"));
  EXPECT_EQ(testing::markup_problem(without(without(html, "style"), "script")), "");
  EXPECT_EQ(html.find("alert(1)</script>"), std::string::npos);
  EXPECT_EQ(html.find("<b>"), std::string::npos);
  // As XML too: the script and the style have no markup of their own.
  EXPECT_EQ(testing::markup_problem(html), "");
}

TEST(HtmlReport, NeedsNothingButItself) {
  const std::string html = html_from(sample_report());
  for (const char* elsewhere :
       {"http:", "https:", "src=\"/", "<link", "@import", "<iframe", "url(h", "url(/", "url(\""})
    EXPECT_EQ(html.find(elsewhere), std::string::npos) << elsewhere;
  EXPECT_EQ(testing::count_of(html, "src="), testing::count_of(html, "src=\"data:"));
  EXPECT_EQ(testing::count_of(html, "href="), testing::count_of(html, "href=\"#"));
}

TEST(HtmlReport, SaysEverythingOnceAndThePapersFiguresInTheSummaryToo) {
  Report report = sample_report();
  report.sections[0].comparisons[0].paper = "the-papers-figure";
  report.sections[0].comparisons[1].surface = "our-figure";
  report.sections[0].notes = {"a-note"};
  const std::string html = html_from(report);
  EXPECT_EQ(testing::count_of(html, "the-papers-figure"), 2U);
  EXPECT_EQ(testing::count_of(html, "our-figure"), 1U);
  EXPECT_EQ(testing::count_of(html, "a-note"), 1U);
  EXPECT_EQ(testing::count_of(html, "one.csv"), 1U);
  EXPECT_EQ(html, html_from(report)) << "the same report, the same bytes";
}

// The image decodes from the page.
TEST(HtmlReport, EmbedsPictures) {
  const std::string html = html_from(sample_report()), start = "data:image/jpeg;base64,";
  const std::size_t begin = html.find(start) + start.size(), end = html.find('"', begin);
  const std::string text = html.substr(begin, end - begin);
  ASSERT_EQ(text.size() % 4, 0U);
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::vector<std::uint8_t> bytes;
  std::uint32_t bits = 0;
  int held = 0;
  for (const char c : text) {
    if (c == '=') break;
    ASSERT_NE(digits.find(c), std::string::npos);
    bits = bits << 6 | static_cast<std::uint32_t>(digits.find(c));
    if ((held += 6) >= 8) bytes.push_back(static_cast<std::uint8_t>(bits >> (held -= 8)));
  }
  const cv::Mat image = decode_image(bytes, "the report's image");
  ASSERT_EQ(image.size(), cv::Size(60, 40));
  EXPECT_NEAR(image.at<cv::Vec3b>(20, 30)[0], 200, 6);
  EXPECT_NEAR(image.at<cv::Vec3b>(20, 30)[2], 20, 6);
}

TEST(HtmlReport, SaysAtTheTopThatItIsNotWhole) {
  Report report = sample_report();
  EXPECT_EQ(html_from(report).find("class=\"warning\""), std::string::npos);
  report.unfinished = "stopped in the middle";
  const std::string html = html_from(report);
  EXPECT_LT(html.find("stopped in the middle"), html.find("class=\"words\"")) << "before the first figure";
}

}  // namespace lapservo::internal::html_report_test
