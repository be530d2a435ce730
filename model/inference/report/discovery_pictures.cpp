#include "model/inference/report/discovery_pictures.h"

#include <algorithm>

#include "model/inference/report/empirical_picture.h"
#include "model/inference/report/picture_axis.h"
#include "model/inference/report/picture_curves.h"
#include "recordings/reports/html_page.h"

namespace ferrobench::model {
namespace {

using recordings::escape_html;

recordings::Figure picture_of(const MissingSignal& signal) {
  const auto axis = picture_axis(signal.channel);
  recordings::Series s{.label = "would have to be added", .points = {}};
  for (std::size_t i = 0; i < signal.time.size(); ++i)
    s.points.push_back({signal.time[i], axis.scale * signal.value[i]});
  return {.title = signal.recording + ": what is missing acts like this",
          .x_label = "time [s]",
          .y_label = axis.label,
          .log_x = false,
          .square = true,
          .series = {std::move(s)}};
}

recordings::Figure empty_figure(const Trace& t, const std::string& shown) {
  return {.title = t.recording + (t.held_out ? ", locked away" : "") + ": " + t.segment + shown,
          .x_label = "time [s]",
          .y_label = picture_axis(t.channel).label,
          .log_x = false,
          .square = true,  // two beside each other
          .series = {}};
}

// Adds `series` with the points `value(row)`, in SI.
template <class Value>
void add_series(recordings::Figure& figure, const Trace& t, recordings::Series series, const Value& value) {
  const double scale = picture_axis(t.channel).scale;
  for (std::size_t i = 0; i < t.time.size(); ++i) series.points.push_back({t.time[i], scale * value(i)});
  figure.series.push_back(std::move(series));
}

recordings::Figure picture_of(const Trace& t, bool repaired) {
  auto out = empty_figure(t, "");
  add_series(out, t, measured_curve(), [&](std::size_t i) { return t.measured[i]; });
  add_series(out, t, curve_before(), [&](std::size_t i) { return t.before[i]; });
  if (repaired) add_series(out, t, curve_after(), [&](std::size_t i) { return t.after[i]; });
  return out;
}

// The miss itself, which the curves hide where they are close.
recordings::Figure miss_of(const Trace& t, bool repaired) {
  auto out = empty_figure(t, ": measured less model");
  add_series(out, t, curve_before(), [&](std::size_t i) { return t.measured[i] - t.before[i]; });
  if (repaired) add_series(out, t, curve_after(), [&](std::size_t i) { return t.measured[i] - t.after[i]; });
  return out;
}

}  // namespace

std::string pictures(const Discovery& d) {
  std::vector<recordings::Figure> figures;
  for (const auto& signal : d.signals) figures.push_back(picture_of(signal));
  const bool repaired = !d.added.empty();
  for (const auto& t : d.traces) {
    figures.push_back(picture_of(t, repaired));
    figures.push_back(miss_of(t, repaired));
  }
  for (const auto& effect : d.improved.effects)
    if (std::ranges::any_of(d.added, [&](const AddedTerm& a) {
          return find_effect(a.term.id).table && a.term.id == effect.id;
        }))
      figures.push_back(picture_of_empirical(effect));
  if (figures.empty()) return "";
  const auto drawing = recordings::draw(figures);
  std::string out = "<h2>Where it matters most</h2>\n<div class=\"pair\">\n";
  for (std::size_t i = 0; i < figures.size(); ++i)
    out += "<figure><figcaption>" + escape_html(figures[i].title) + "</figcaption>" +
           (drawing.problem.empty()
                ? drawing.svg[i]
                : "<p class=\"note\">No picture: " + escape_html(drawing.problem) + ".</p>") +
           "</figure>\n";
  return out + "</div>\n";
}

}  // namespace ferrobench::model
