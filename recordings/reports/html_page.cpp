#include "recordings/reports/html_page.h"

#include "recordings/format/version.h"
#include "recordings/reports/figures.h"

namespace ferrobench::recordings {
namespace {

// The browser's own text and background, so that the page is light or dark as its reader is.
constexpr std::string_view style = R"(
:root { color-scheme: light dark; }
body { max-width: 62rem; margin: 2rem auto; padding: 0 1rem; font: 15px/1.5 system-ui, sans-serif;
       background: Canvas; color: CanvasText; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.1rem; margin: 2rem 0 .5rem; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .1rem 1rem; margin: 0; }
dt { opacity: .7; } dd { margin: 0; overflow-wrap: anywhere; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .15rem .6rem; text-align: right; border-bottom: 1px solid #8885; white-space: nowrap; }
th { font-weight: 600; vertical-align: bottom; white-space: normal; } th small { font-weight: 400; opacity: .7; }
td.clipped { color: #b00020; }
@media screen and (prefers-color-scheme: dark) { td.clipped { color: #ff8e8e; } }
td.text { text-align: left; } td.long { white-space: normal; }
.note { opacity: .7; font-size: .9rem; margin: .3rem 0; }
.pair { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 26rem), 1fr)); gap: 1rem; }
figure { margin: .5rem 0; } figcaption { font-weight: 600; } svg { width: 100%; height: auto; }
@media screen and (max-width: 40rem) { .time { overflow-x: auto; } .time svg { width: 40rem; } }
footer { margin-top: 3rem; opacity: .7; font-size: .85rem; }
@page { size: A4; margin: 14mm; }
@media print {
  :root { color-scheme: light; }
  body { max-width: none; margin: 0; padding: 0; font-size: 9pt; }
  h1 { font-size: 14pt; margin-top: 0; } h2 { font-size: 11pt; margin: 6mm 0 1mm; break-after: avoid; }
  figure, tr, dl { break-inside: avoid; }
  .pair { display: grid; grid-template-columns: 1fr 1fr; gap: 4mm; }
  .wide { overflow: visible; } table { width: 100%; font-size: 6.5pt; } thead { display: table-header-group; }
  th, td { padding: .4mm .6mm; } .note, footer, small { font-size: 7.5pt; } th small { font-size: 6pt; }
}
)";

std::string figures_html(const Analysis& analysis) {
  const auto figures = make_figures(analysis);
  if (figures.empty()) return "";
  const auto drawing = draw(figures);
  std::string wide, pairs;
  for (std::size_t i = 0; i < figures.size(); ++i) {
    const auto picture = drawing.problem.empty()
                             ? drawing.svg[i]
                             : "<p class=\"note\">No picture: " + escape_html(drawing.problem) + ".</p>";
    // Where a screen is narrow, what is wide is moved through rather than made too small to read.
    (figures[i].square ? pairs : wide) +=
        std::string(figures[i].square ? "<figure>" : "<figure class=\"time\" tabindex=\"0\">") +
        "<figcaption>" + escape_html(figures[i].title) +
        (figures[i].note.empty() ? "" : " <small>(" + escape_html(figures[i].note) + ")</small>") +
        "</figcaption>" + picture + "</figure>\n";
  }
  return wide + "<div class=\"pair\">" + pairs + "</div>\n";
}

}  // namespace

std::string html_frame(const std::string& title, const std::string& body) {
  return "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
         "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src "
         "'unsafe-inline'\">\n"
         "<meta name=\"viewport\" content=\"width=device-width\">\n<title>" +
         escape_html(title) + "</title>\n<style>" + std::string(style) + "</style>\n</head>\n<body>\n<h1>" +
         escape_html(title) + "</h1>\n" + body + "<footer>ferrobench " + std::string(software_version()) +
         "</footer>\n</body>\n</html>\n";
}

std::string html_page(const Report& report) {
  std::string body = "<dl>\n";
  for (const auto& [name, value] : report.facts)
    body += "<dt>" + escape_html(name) + "</dt><dd>" + escape_html(value) + "</dd>\n";
  body += "</dl>\n" + figures_html(*report.analysis);
  for (const auto& table : report.tables) body += to_html(table);
  return html_frame(report.title, body);
}

}  // namespace ferrobench::recordings
