#include "lapservo/report/html_report.h"

#include <algorithm>
#include <cstdint>
#include <regex>
#include <span>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lapservo/core/atomic_file.h"
#include "lapservo/io/pictures/jpeg_picture.h"

namespace lapservo::internal {
namespace {

constexpr const char* page_css = R"(
*{box-sizing:border-box}
body{margin:0;background:var(--page);color:var(--ink);font:16px/1.5 system-ui,sans-serif;overflow-wrap:break-word}
main{max-width:1120px;margin:auto;padding:16px}
h1{font-size:1.6rem;line-height:1.2}h2{margin-top:3rem;border-bottom:2px solid var(--edge)}h3{margin:1.5rem 0 .5rem}
p,li{max-width:72ch}a{color:var(--c0)}nav a{display:inline-block;margin-right:1rem;padding:.3rem 0}
.scroll{overflow-x:auto}
table{border-collapse:collapse;font-variant-numeric:tabular-nums}
caption{text-align:left;color:var(--soft);padding:.3rem 0}
th,td{border-bottom:1px solid var(--edge);padding:.35rem .7rem;text-align:right;vertical-align:top}
td{white-space:nowrap}.words td{white-space:normal}.words td:first-child{min-width:14em}
.words tr.part td{font-weight:600;padding-top:1rem}
.good{color:var(--c2)}.bad{color:var(--c1)}
.warning{border:2px solid var(--c1);border-radius:6px;padding:.6rem;font-weight:600}
th:first-child,td:first-child{text-align:left}.words td,.words th{text-align:left}
thead th{border-bottom:2px solid var(--grey)}
.figures{display:grid;gap:16px;grid-template-columns:repeat(auto-fit,minmax(min(100%,420px),1fr));align-items:start}
figure{margin:0;background:var(--card);border:1px solid var(--edge);border-radius:8px;padding:8px}
figcaption{font-size:.9rem;color:var(--soft);padding:.2rem .4rem}
figure button{display:block;width:100%;border:0;padding:0;background:none;cursor:zoom-in;font:inherit;color:inherit;
text-align:inherit}
img{display:block;max-width:100%;height:auto;border-radius:4px}
pre{background:var(--card);border:1px solid var(--edge);border-radius:6px;padding:.6rem;white-space:pre-wrap;
overflow-wrap:anywhere}
dialog{border:0;padding:0;width:100vw;height:100vh;max-width:none;max-height:none;background:var(--card);overflow:auto}
dialog>div{width:100%;min-height:100%;display:flex;align-items:center;cursor:zoom-in}
dialog.near>div{width:300%;cursor:zoom-out}
dialog .plot{max-height:98vh}dialog.near .plot,dialog.near img{max-height:none}dialog img{width:100%}
dialog button{position:fixed;top:8px;right:8px;width:44px;height:44px;border-radius:22px;border:1px solid var(--edge);
background:var(--card);color:var(--ink);font-size:20px}
@media(max-width:600px){body{font-size:15px}main{padding:10px}th,td{padding:.3rem .45rem;font-size:.9rem}
.words,.words tbody,.words tr,.words td{display:block}.words thead{display:none}
.words tr{border-bottom:1px solid var(--edge);padding:.4rem 0}.words tr.part{border-color:var(--grey)}
.words td{border:0;padding:.1rem 0}.words td:first-child{font-weight:600}
.words td:not(:first-child){display:flex;gap:.6rem}
.words td:not(:first-child)::before{content:attr(data-of);flex:0 0 8.5em;color:var(--soft)}}
@media print{nav,dialog{display:none}figure{break-inside:avoid}}
)";

// Free of < and &, so that the page is XML as well.
constexpr const char* page_script = R"(
var dialog = document.querySelector('dialog'), place = dialog.querySelector('div');
document.querySelectorAll('figure button').forEach(function (button) {
  button.addEventListener('click', function () {
    place.replaceChildren(button.firstElementChild.cloneNode(true));
    dialog.classList.remove('near');
    dialog.showModal();
  });
});
place.addEventListener('click', function (event) {
  var x = event.clientX / dialog.clientWidth, y = event.clientY / dialog.clientHeight;
  var near = dialog.classList.toggle('near');
  if (near) dialog.scrollTo(x * (dialog.scrollWidth - dialog.clientWidth), y * (dialog.scrollHeight - dialog.clientHeight));
});
dialog.querySelector('button').addEventListener('click', function () { dialog.close(); });
)";

std::string base64(std::span<const std::uint8_t> bytes) {
  static constexpr char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t there = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) group = group << 8 | (k < there ? bytes[i + k] : 0U);
    for (std::size_t k = 0; k < 4; ++k) text += k <= there ? digits[group >> (18 - 6 * k) & 63U] : '=';
  }
  return text;
}

// JPEG: a frame with the sensor's noise takes ten times the room as PNG.
std::string html_from(const Picture& picture) {
  constexpr int quality = 88;
  const auto bytes = encode_jpeg(picture.bgr, quality);
  if (bytes.empty()) throw std::runtime_error("an image of the report could not be encoded");
  return fmt::format("<img alt=\"{}\" width=\"{}\" height=\"{}\" src=\"data:image/jpeg;base64,{}\"/>",
                     escaped(picture.title), picture.bgr.cols, picture.bgr.rows, base64(bytes));
}

std::string html_from(const Figure& figure) {
  const auto* plot = std::get_if<Plot>(&figure.content);
  const std::string content = plot ? svg_from(*plot) : html_from(std::get<Picture>(figure.content));
  const std::string& title = plot ? plot->title : std::get<Picture>(figure.content).title;
  return fmt::format(
      "<figure><button type=\"button\" aria-label=\"Enlarge: {}\">{}</button><figcaption>{}</figcaption></figure>\n",
      escaped(title), content, escaped(figure.caption));
}

// A value stays on one line with its name of one letter and its unit, and so do the two sides of a plus-minus: their
// spaces do not break.
std::string unbroken(std::string text) {
  static const std::regex before_unit("([0-9]) (px|mrad|rad|mm|ms|s|%|/s)(?![a-z])"),
      after_name("\\b([A-Za-z]|[A-Za-z] =|eq\\.) (?=[0-9])"), about("( ?)\u00b1 ");
  text = std::regex_replace(text, before_unit, "$1\u00a0$2");
  text = std::regex_replace(text, after_name, "$1\u00a0");
  return std::regex_replace(text, about, "\u00a0\u00b1\u00a0");
}

std::string row_of(const std::vector<std::string>& cells, const char* tag) {
  std::string text = "<tr>";
  for (const std::string& cell : cells) text += fmt::format("<{0}>{1}</{0}>", tag, escaped(cell));
  return text + "</tr>\n";
}

// `rows`: as HTML, beside those of the table.
std::string html_from(const Table& table, std::string rows = "") {
  std::string text =
      table.words ? "<div class=\"scroll\"><table class=\"words\">\n" : "<div class=\"scroll\"><table>\n";
  if (!table.caption.empty()) text += fmt::format("<caption>{}</caption>\n", escaped(table.caption));
  for (const auto& row : table.rows) rows += row_of(row, "td");
  return text + "<thead>" + row_of(table.header, "th") + "</thead>\n<tbody>\n" + rows + "</tbody></table></div>\n";
}

std::string or_dash(const std::string& text) {
  return text.empty() ? "\u2013" : text;
}

std::string rows_of(const std::vector<Comparison>& comparisons) {
  std::string text;
  for (const Comparison& c : comparisons) {
    text += "<tr><td>" + escaped(unbroken(c.what)) + "</td>";
    for (const auto& [name, value] :
         {std::pair{"the paper", c.paper}, {"its method here", c.centerline}, {"the default here", c.surface}})
      text += fmt::format("<td data-of=\"{}\"><span>{}</span></td>", name, escaped(unbroken(or_dash(value))));
    text += "</tr>\n";
  }
  return text;
}

std::string comparison_table(const std::string& rows) {
  return html_from(
      Table{"",
            {"", "the paper (a real robot)", "the paper\u2019s method here (rendered)", "the default here (rendered)"},
            {},
            true},
      rows);
}

std::string warning(const std::string& text) {
  return text.empty() ? "" : "<p class=\"warning\">" + escaped(text) + "</p>\n";
}

std::string paragraphs(const std::vector<std::string>& text) {
  std::string html;
  for (const std::string& paragraph : text) html += "<p>" + escaped(paragraph) + "</p>\n";
  return html;
}

const char* colour_of(Verdict verdict) {
  if (verdict == Verdict::none) return "";
  return verdict == Verdict::good ? " class=\"good\"" : " class=\"bad\"";
}

std::string html_from(const ReportSection& section) {
  std::string html = fmt::format("<section id=\"{}\">\n<h2{}>{}</h2>\n", escaped(section.id),
                                 colour_of(section.verdict), escaped(section.title));
  html += warning(section.unfinished) + paragraphs(section.text);
  if (!section.comparisons.empty()) html += comparison_table(rows_of(section.comparisons));
  if (!section.figures.empty()) {
    html += "<h3>Figures</h3>\n<div class=\"figures\">\n";
    for (const Figure& figure : section.figures) html += html_from(figure);
    html += "</div>\n";
  }
  for (const Table& table : section.tables) html += html_from(table);
  if (!section.notes.empty()) {
    html += "<h3>Notes</h3>\n<ul>\n";
    for (const std::string& note : section.notes) html += "<li>" + escaped(note) + "</li>\n";
    html += "</ul>\n";
  }
  if (!section.command.empty()) html += "<h3>To make it again</h3>\n<pre>" + escaped(section.command) + "</pre>\n";
  if (const std::string files = fmt::format("{}", fmt::join(section.files, ", ")); !files.empty())
    html += "<p>The data behind it, beside this file: " + escaped(files) + "</p>\n";
  return html + "</section>\n";
}

// "Figure 5", "Table I": what the titles and captions say before a colon.
std::vector<std::string> papers_pictures(const ReportSection& section) {
  std::vector<std::string> names;
  const auto add = [&names](const std::string& text, const char* kind) {
    const std::string name = text.substr(0, text.find(':'));
    if (text.starts_with(kind) && std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  };
  for (const Figure& figure : section.figures) {
    if (const auto* plot = std::get_if<Plot>(&figure.content)) add(plot->title, "Figure ");
    add(figure.caption, "Figure ");
  }
  for (const Table& table : section.tables) add(table.caption, "Table ");
  return names;
}

// Every figure of the paper's, section by section; nothing where none is compared.
std::string summary(const Report& report) {
  std::string rows, links;
  if (std::ranges::all_of(report.sections, [](const ReportSection& section) { return section.comparisons.empty(); }))
    return {};
  for (const ReportSection& section : report.sections) {
    rows += fmt::format("<tr class=\"part\"><td colspan=\"4\"><a href=\"#{}\">{}</a></td></tr>\n", escaped(section.id),
                        escaped(section.title));
    rows += rows_of(with_paper(section));
    for (const std::string& name : papers_pictures(section))
      links += fmt::format("<a href=\"#{}\">{}</a>\n", escaped(section.id), escaped(name));
  }
  return comparison_table(rows) + (links.empty() ? "" : "<nav>\n" + links + "</nav>\n");
}

}  // namespace

std::vector<Comparison> with_paper(const ReportSection& section) {
  std::vector<Comparison> rows;
  for (const Comparison& comparison : section.comparisons)
    if (!comparison.paper.empty()) rows.push_back(comparison);
  return rows;
}

std::string html_from(const Report& report) {
  std::string html =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n"
      "<meta name=\"color-scheme\" content=\"light dark\"/>\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src &#39;none&#39;; img-src data:; "
      "style-src &#39;unsafe-inline&#39;; script-src &#39;unsafe-inline&#39;\"/>\n";
  html += "<title>" + escaped(report.title) + "</title>\n<style>\n" + plot_css() + page_css + "</style>\n</head>\n";
  html += "<body>\n<main>\n<h1>" + escaped(report.title) + "</h1>\n" + warning(report.unfinished);
  html += paragraphs(report.text) + summary(report);
  for (const ReportSection& section : report.sections) html += html_from(section);
  html += "</main>\n<dialog aria-label=\"Figure\"><div></div>";
  html += "<button type=\"button\" aria-label=\"Close\">\u00d7</button></dialog>\n";
  return html + "<script>" + page_script + "</script>\n</body>\n</html>\n";
}

void write_report(const std::filesystem::path& path, const Report& report) {
  write_file(path, html_from(report));
}

}  // namespace lapservo::internal
