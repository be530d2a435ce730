#include "model/inference/report/discovery_pictures.h"

#include <algorithm>

#include "model/inference/report/empirical_picture.h"
#include "model/inference/report/picture_axis.h"
#include "recordings/reports/html_page.h"
#include "recordings/reports/plot.h"

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

}  // namespace

std::string pictures(const Discovery& d) {
  std::vector<recordings::Figure> figures;
  for (const auto& signal : d.signals) figures.push_back(picture_of(signal));
  for (const auto& t : d.traces) {
    const auto axis = picture_axis(t.channel);
    recordings::Figure f;
    f.square = true;  // two beside each other
    f.title = t.recording + (t.held_out ? ", locked away" : "") + ": " + t.segment;
    f.x_label = "time [s]";
    f.y_label = axis.label;
    // What was measured is grey, and a model has one colour in both pictures.
    const auto series = [&](const std::string& label, const std::vector<double>& values) {
      recordings::Series s{.label = label, .points = {}};
      s.quiet = label == "measured";
      s.value = label == "after" ? 1 : 0;
      for (std::size_t i = 0; i < values.size(); ++i) s.points.push_back({t.time[i], axis.scale * values[i]});
      f.series.push_back(std::move(s));
    };
    series("measured", t.measured);
    series("before", t.before);
    const bool repaired = !d.added.empty();
    if (repaired) series("after", t.after);
    // The miss itself, which the curves hide where they are close.
    recordings::Figure miss{.title = f.title + ": measured less model",
                            .x_label = f.x_label,
                            .y_label = f.y_label,
                            .log_x = false,
                            .square = true,
                            .series = {}};
    figures.push_back(std::move(f));
    std::swap(f, miss);
    const auto missed = [&](const std::string& label, const std::vector<double>& values) {
      auto difference = t.measured;
      for (std::size_t i = 0; i < difference.size(); ++i) difference[i] -= values[i];
      series(label, difference);
    };
    missed("before", t.before);
    if (repaired) missed("after", t.after);
    figures.push_back(std::move(f));
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
