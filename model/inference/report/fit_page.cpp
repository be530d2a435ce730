#include "model/inference/report/fit_page.h"

#include <fmt/format.h>

#include <cmath>

#include "base/number_text.h"
#include "model/inference/report/picture_axis.h"
#include "model/inference/report/picture_curves.h"
#include "recordings/reports/html_page.h"
#include "recordings/reports/plot.h"
#include "recordings/reports/table.h"

namespace ferrobench::model {
namespace {

using recordings::Channel;
using recordings::escape_html;
using recordings::Table;

std::string number(double value) {
  return fmt::format("{:.4g}", value);
}

Table misfit_table(const FitPage& page) {
  Table out{.key = "misfit",
            .title = "Root mean square of measurement less model",
            .columns = {},
            .rows = {},
            .notes = {}};
  out.columns = {{"of", "of", ""}, {"before", "before", ""}, {"after", "after", ""}};
  for (std::size_t i = 0; i < page.after.size(); ++i)
    out.rows.push_back({page.after[i].first, number(page.before[i].second), number(page.after[i].second)});
  return out;
}

std::string remark(const FittedParameter& p) {
  if (p.at_bound) return fmt::format("at its bound ({:.3g} to {:.3g})", p.free.low, p.free.high);
  return p.determined ? "" : "not determined by these data";
}

Table parameter_table(const FitResult& result) {
  Table out{.key = "parameters", .title = "Parameters", .columns = {}, .rows = {}, .notes = {}};
  out.columns = {
      {"parameter", "parameter", ""}, {"unit", "unit", ""},   {"from", "from", ""}, {"to", "to", ""},
      {"low", "from", "95 %"},        {"high", "to", "95 %"}, {"remark", "", ""}};
  for (const auto& p : result.parameters) {
    const auto unit = parameter_unit(p.free.path);
    const auto [low, high] = interval_text(p.low, p.high);
    out.rows.push_back(
        {p.free.path, unit == "1" ? "" : unit, number(p.from), number(p.to), low, high, remark(p)});
  }
  out.notes = {
      "The interval allows for errors that stay the same over many samples, as those of a model do that is "
      "not exactly "
      "true. Not determined: it covers more than half of the range that the fit may use."};
  return out;
}

// Pairs whose errors go together so closely that the data hardly tell them apart.
Table correlation_table(const FitResult& result) {
  constexpr double close = 0.9;
  Table out{
      .key = "correlations", .title = "Parameters that go together", .columns = {}, .rows = {}, .notes = {}};
  out.columns = {{"parameter", "parameter", ""}, {"with", "with", ""}, {"correlation", "correlation", ""}};
  for (std::size_t i = 0; i < result.correlations.size(); ++i)
    for (std::size_t k = i + 1; k < result.correlations.size(); ++k)
      if (const double r = result.correlations[i][k]; std::abs(r) >= close)
        out.rows.push_back(
            {result.parameters[i].free.path, result.parameters[k].free.path, fmt::format("{:.3f}", r)});
  return out;
}

Table recording_table(std::span<const RecordingData> recordings) {
  Table out{.key = "recordings", .title = "Recordings", .columns = {}, .rows = {}, .notes = {}};
  out.columns = {{"title", "title", ""}, {"start_time", "begun", ""}, {"identifier", "identifier", ""}};
  for (const auto& r : recordings)
    out.rows.push_back({r.header.title, r.header.start_time, r.header.entry_identifier});
  return out;
}

recordings::Series with_points(recordings::Series curve, const std::vector<double>& x, double x_scale,
                               const std::vector<double>& y, double y_scale) {
  for (std::size_t i = 0; i < x.size(); ++i) curve.points.push_back({x_scale * x[i], y_scale * y[i]});
  return curve;
}

std::vector<double> difference(const std::vector<double>& a, const std::vector<double>& b) {
  auto out = a;
  for (std::size_t i = 0; i < out.size(); ++i) out[i] -= b[i];
  return out;
}

std::string title_of(const ComparedCurve& curve) {
  return curve.recording + ", " + std::string(recordings::channel_name(curve.channel));
}

recordings::Figure loop_of(const ComparedCurve& before, const ComparedCurve& after) {
  const auto axis = picture_axis(after.channel), field = picture_axis(Channel::field);
  return {.title = title_of(after),
          .x_label = field.label,
          .y_label = axis.label,
          .log_x = false,
          .square = true,
          .series = {with_points(measured_curve(), after.field, field.scale, after.measured, axis.scale),
                     with_points(curve_before(), before.field, field.scale, before.simulated, axis.scale),
                     with_points(curve_after(), after.field, field.scale, after.simulated, axis.scale)}};
}

recordings::Figure residual_of(const ComparedCurve& before, const ComparedCurve& after) {
  const auto axis = picture_axis(after.channel);
  return {.title = title_of(after) + ": measured less model",
          .x_label = "time [s]",
          .y_label = axis.label,
          .log_x = false,
          .square = false,
          .series = {with_points(curve_before(), before.time, 1,
                                 difference(before.measured, before.simulated), axis.scale),
                     with_points(curve_after(), after.time, 1, difference(after.measured, after.simulated),
                                 axis.scale)}};
}

std::string drawn(const std::vector<recordings::Figure>& figures, const std::string& container) {
  const auto drawing = recordings::draw(figures);
  if (!drawing.problem.empty())
    return "<p class=\"note\">There are no pictures: " + escape_html(drawing.problem) + ".</p>\n";
  std::string out = "<div class=\"" + container + "\">\n";
  for (std::size_t i = 0; i < figures.size(); ++i)
    out += "<figure><figcaption>" + escape_html(figures[i].title) + "</figcaption>" + drawing.svg[i] +
           "</figure>\n";
  return out + "</div>\n";
}

std::string pictures(const FitPage& page) {
  const Fidelity fidelity{.simulation = page.options.simulation};
  const auto before = page.residuals.curves(page.start, fidelity),
             after = page.residuals.curves(page.result.model, fidelity);
  std::vector<recordings::Figure> loops, residuals;
  for (std::size_t i = 0; i < after.size(); ++i) {
    loops.push_back(loop_of(before[i], after[i]));
    residuals.push_back(residual_of(before[i], after[i]));
  }
  if (after.empty()) return "";
  return "<p class=\"note\">Values are shown less their mean, as a sensor's zero is unknown.</p>\n" +
         drawn(loops, "pair") + drawn(residuals, "wide");
}

}  // namespace

std::string html_report(const FitPage& page) {
  const auto& r = page.result;
  std::string body;
  if (page.verdict) body = "<p><strong>" + escape_html(page.verdict->text()) + "</strong></p>\n";
  body += fmt::format(
      "<p>Started from the model {}; {} start{}, seed {}, {} simulations. The sum of squares went from {} to "
      "{}{}.</p>\n",
      escape_html(page.start.name), page.options.starts, page.options.starts == 1 ? "" : "s",
      page.options.seed, r.simulations, number(r.cost_before), number(r.cost_after),
      r.stopped ? "; the fit was stopped, and this is the best so far" : "");
  if (const auto recordings = page.residuals.recordings(); !recordings.empty())
    body += to_html(recording_table(recordings));
  for (const auto& sentence : page.residuals.unused())
    body += "<p>Not used: " + escape_html(sentence) + ".</p>\n";
  for (const auto& past : r.pasts)
    if (past.chosen)
      body += "<p>" +
              escape_html("Before " + past.recording + " the specimen was likeliest " +
                          protocols::in_words(past.past)) +
              ".</p>\n";
  if (!page.after.empty()) body += to_html(misfit_table(page));
  if (!r.stopped) {
    body += pictures(page) + to_html(parameter_table(r));
    if (const auto table = correlation_table(r); !table.rows.empty()) body += to_html(table);
  }
  return recordings::html_frame("Fit of " + page.start.name, body);
}

}  // namespace ferrobench::model
