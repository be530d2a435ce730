#include "server/queue/summary.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include "recordings/file/reader.h"
#include "recordings/reports/html_page.h"
#include "recordings/reports/plot.h"
#include "recordings/reports/report.h"

namespace ferrobench::server {

using nlohmann::json;
using recordings::Table;

namespace {

constexpr double most_bytes = 1 << 30;  // of a recording, as for any view of it
const std::set<std::string> usual_tables{"stroke", "hysteresis"};
const std::set<std::string> counters{"cycle", "start_s", "time_s", "hold", "reversal", "pulse"};

std::optional<double> number_of(const recordings::Cell& cell) {
  if (const auto* real = std::get_if<double>(&cell)) return *real;
  if (const auto* whole = std::get_if<std::int64_t>(&cell)) return static_cast<double>(*whole);
  return std::nullopt;
}

json figure_of(const Table& table, std::size_t column) {
  std::vector<double> values;
  for (const auto& row : table.rows)
    if (const auto value = column < row.size() ? number_of(row[column]) : std::nullopt;
        value && std::isfinite(*value))
      values.push_back(*value);
  if (values.empty()) return nullptr;
  double sum = 0;
  for (const double value : values) sum += value;
  const auto [low, high] = std::ranges::minmax(values);
  return {{"title", table.columns[column].title},
          {"unit", table.columns[column].unit},
          {"rows", values.size()},
          {"mean", sum / static_cast<double>(values.size())},
          {"first", values.front()},
          {"last", values.back()},
          {"min", low},
          {"max", high}};
}

struct Done {
  Ledger::Entry entry;
  json figures;
};

std::vector<Done> all_of(std::int64_t plan, Ledger& ledger, const Store& store) {
  std::vector<Done> out;
  for (auto& entry : ledger.entries(plan)) {
    json figures;
    if (entry.item.state == ItemState::complete && !entry.item.recording.empty()) {
      const auto runs = ledger.runs(entry.item.item);
      if (!runs.empty()) figures = runs.back().figures;
      if (figures.is_null()) try {
          figures = figures_of(store.recording(entry.item.recording).string());
          ledger.set_figures(entry.item.run, figures);
        } catch (const Error&) {  // it was deleted, or is too long: its cells stay empty
        }
    }
    out.push_back({std::move(entry), std::move(figures)});
  }
  return out;
}

recordings::Cell cell_of(const json& value) {
  if (value.is_number_integer()) return value.get<std::int64_t>();
  if (value.is_number()) return value.get<double>();
  if (value.is_string()) return value.get<std::string>();
  return value.is_null() ? recordings::Cell{} : recordings::Cell{value.dump()};
}

// "table.column", of the figures of all runs, in their order.
std::vector<std::string> known_figures(const std::vector<Done>& all) {
  std::set<std::string> out;
  for (const auto& done : all)
    if (done.figures.is_object())
      for (const auto& [name, figure] : done.figures.items()) out.insert(name);
  return {out.begin(), out.end()};
}

std::vector<std::string> chosen_figures(const SummaryRequest& request,
                                        const std::vector<std::string>& known) {
  if (known.empty()) return request.figures;  // no run is complete yet
  for (std::size_t i = 0; i < request.figures.size(); ++i) {
    const auto& name = request.figures[i];
    if (std::ranges::count(known, name) > 0) continue;
    const auto guess = nearest_name(name, known);
    throw Error(ErrorCode::invalid_params, "no recording of the plan has this figure",
                Problem{.path = "/figures/" + std::to_string(i),
                        .message = "is not in a report",
                        .given = excerpt(name),
                        .allowed = known,
                        .hint = guess.empty() ? "" : "did you mean \"" + guess + "\"?"});
  }
  if (!request.figures.empty()) return request.figures;
  std::vector<std::string> out;
  for (const auto& name : known)
    if (usual_tables.contains(name.substr(0, name.find('.')))) out.push_back(name);
  return out.empty() ? known : out;
}

json any_figure(const std::vector<Done>& all, const std::string& name) {
  for (const auto& done : all)
    if (done.figures.is_object() && done.figures.contains(name)) return done.figures[name];
  return {{"title", name}, {"unit", ""}};
}

std::optional<double> value_of(const Done& done, const std::string& name, FigureOf of) {
  if (!done.figures.is_object() || !done.figures.contains(name)) return std::nullopt;
  return done.figures[name].at(write_json(of).get<std::string>()).get<double>();
}

std::vector<recordings::Column> sweep_columns(const Plan& plan) {
  std::vector<recordings::Column> out;
  for (const auto& sweep : plan.sweeps) out.push_back({sweep.set, sweep.set, ""});
  return out;
}

Table table_of_runs(const std::vector<Done>& all, const std::vector<std::string>& names, FigureOf of) {
  Table table{.key = "runs",
              .title = "Run by run",
              .columns = sweep_columns(*all.front().entry.plan),
              .rows = {},
              .notes = {}};
  table.columns.insert(table.columns.end(), {{"repeat", "repeat", ""}, {"state", "state", ""}});
  for (const auto& name : names) {
    const auto figure = any_figure(all, name);
    table.columns.push_back({name, figure.at("title"), figure.at("unit")});
  }
  table.columns.push_back({"recording", "recording", ""});
  for (const auto& done : all) {
    const auto& item = done.entry.item;
    std::vector<recordings::Cell> row;
    for (const auto& value : done.entry.step.values) row.push_back(cell_of(value));
    row.emplace_back(item.repeat);
    row.emplace_back(write_json(item.state).get<std::string>());
    for (const auto& name : names) row.push_back(recordings::cell(value_of(done, name, of)));
    row.emplace_back(item.recording);
    table.rows.push_back(std::move(row));
  }
  return table;
}

// The values of the sweeps, and the figure's in the runs with them that have one.
using Groups = std::vector<std::pair<std::vector<json>, std::vector<const Done*>>>;

Groups groups_of(const std::vector<Done>& all) {
  Groups out;
  std::map<std::string, std::size_t> places;
  for (const auto& done : all) {
    const auto [at, made] = places.emplace(json(done.entry.step.values).dump(), out.size());
    if (made) out.push_back({done.entry.step.values, {}});
    out[at->second].second.push_back(&done);
  }
  return out;
}

struct Mean {
  std::int64_t count = 0;
  double value = NAN, uncertainty = 0;
};

// With the standard uncertainty of a mean, by the scatter of the repeats.
Mean mean_of(const std::vector<const Done*>& runs, const std::string& name, FigureOf of) {
  std::vector<double> values;
  for (const auto* done : runs)
    if (const auto value = value_of(*done, name, of)) values.push_back(*value);
  Mean out{.count = static_cast<std::int64_t>(values.size())};
  if (values.empty()) return out;
  const auto n = static_cast<double>(values.size());
  double sum = 0, squares = 0;
  for (const double value : values) sum += value;
  out.value = sum / n;
  for (const double value : values) squares += (value - out.value) * (value - out.value);
  if (values.size() > 1) out.uncertainty = std::sqrt(squares / (n - 1) / n);
  return out;
}

Table table_of_means(const std::vector<Done>& all, const Groups& groups,
                     const std::vector<std::string>& names, FigureOf of) {
  Table table{.key = "means",
              .title = "Means over the repeats",
              .columns = sweep_columns(*all.front().entry.plan),
              .rows = {},
              .notes = {"Uncertainty: by the scatter of the repeats."}};
  table.columns.push_back({"runs", "complete runs", ""});
  for (const auto& name : names) {
    const auto figure = any_figure(all, name);
    table.columns.push_back({name, figure.at("title"), figure.at("unit")});
  }
  for (const auto& [values, runs] : groups) {
    std::vector<recordings::Entry> row;
    for (const auto& value : values) row.emplace_back(cell_of(value));
    row.emplace_back(std::ranges::count_if(
        runs, [](const Done* done) { return done->entry.item.state == ItemState::complete; }));
    for (const auto& name : names) {
      const auto mean = mean_of(runs, name, of);
      recordings::Entry cell(recordings::cell(mean.count > 0 ? std::optional(mean.value) : std::nullopt));
      cell.uncertainty = mean.uncertainty;
      row.push_back(std::move(cell));
    }
    table.add(row);
  }
  return table;
}

// Against the first sweep of several numbers; a curve for each combination of the others.
std::vector<PlanSummary::Picture> pictures_of(const std::vector<Done>& all, const Groups& groups,
                                              const std::vector<std::string>& names, FigureOf of) {
  const auto& plan = *all.front().entry.plan;
  std::optional<std::size_t> along;
  for (std::size_t i = 0; i < plan.sweeps.size() && !along; ++i) {
    std::set<double> values;
    for (const auto& [each, runs] : groups)
      if (each[i].is_number()) values.insert(each[i].get<double>());
    if (values.size() > 1) along = i;
  }
  if (!along) return {};
  std::vector<PlanSummary::Picture> out;
  for (const auto& name : names) {
    const auto figure = any_figure(all, name);
    const auto unit = figure.at("unit").get<std::string>();
    PlanSummary::Picture picture{
        .x = plan.sweeps[*along].set,
        .y = figure.at("title").get<std::string>() + (unit.empty() ? "" : " [" + unit + "]")};
    std::map<std::string, std::size_t> curves;
    for (const auto& [values, runs] : groups) {
      const auto mean = mean_of(runs, name, of);
      if (mean.count == 0 || !values[*along].is_number()) continue;
      std::string label;
      for (std::size_t i = 0; i < values.size(); ++i)
        if (i != *along) label += (label.empty() ? "" : ", ") + plan.sweeps[i].set + " " + values[i].dump();
      const auto [at, made] = curves.emplace(label, picture.curves.size());
      if (made) picture.curves.push_back({.label = label});
      picture.curves[at->second].points.push_back({values[*along].get<double>(), mean.value});
    }
    for (auto& curve : picture.curves) std::ranges::sort(curve.points);
    out.push_back(std::move(picture));
  }
  return out;
}

std::string html_of(const PlanSummary& summary) {
  std::string body;
  std::vector<recordings::Figure> figures;
  for (const auto& picture : summary.pictures) {
    recordings::Figure figure{
        .title = picture.y, .x_label = picture.x, .y_label = picture.y, .square = true, .series = {}};
    for (const auto& curve : picture.curves)
      figure.series.push_back({.label = curve.label, .points = curve.points});
    figures.push_back(std::move(figure));
  }
  if (!figures.empty()) {
    const auto drawing = recordings::draw(figures);
    for (const auto& svg : drawing.svg) body += "<figure>" + svg + "</figure>\n";
    if (!drawing.problem.empty())
      body += "<p>No pictures: " + recordings::escape_html(drawing.problem) + "</p>\n";
  }
  if (summary.means) body += recordings::to_html(*summary.means);
  body += recordings::to_html(summary.runs);
  return recordings::html_frame(summary.title, body);
}

}  // namespace

std::span<const std::pair<FigureOf, std::string_view>> enum_names(FigureOf) {
  static constexpr std::array<std::pair<FigureOf, std::string_view>, 5> names{{{FigureOf::mean, "mean"},
                                                                               {FigureOf::first, "first"},
                                                                               {FigureOf::last, "last"},
                                                                               {FigureOf::min, "min"},
                                                                               {FigureOf::max, "max"}}};
  return names;
}

json figures_of(const std::string& recording_path) {
  json out = json::object();
  const auto recording = recordings::read_recording(recording_path, most_bytes);
  for (const auto& table : recordings::make_report(recording).tables)
    for (std::size_t i = 0; i < table.columns.size(); ++i) {
      if (counters.contains(table.columns[i].key) || table.key == "events") continue;
      if (auto figure = figure_of(table, i); !figure.is_null())
        out[table.key + "." + table.columns[i].key] = std::move(figure);
    }
  return out;
}

PlanSummary summarize(const SummaryRequest& request, Ledger& ledger, const Store& store) {
  const auto all = all_of(request.plan, ledger, store);
  PlanSummary out{.title = all.front().entry.item.name, .known = known_figures(all)};
  const auto names = chosen_figures(request, out.known);
  const auto groups = groups_of(all);
  out.runs = table_of_runs(all, names, request.of);
  if (groups.size() < all.size()) out.means = table_of_means(all, groups, names, request.of);
  out.pictures = pictures_of(all, groups, names, request.of);
  return out;
}

json render(const PlanSummary& summary, const std::string& format) {
  using recordings::Format;
  const auto wanted = recordings::format_from_name(format);
  const auto both = [&](auto&& one, const char* between) {
    return (summary.means ? one(*summary.means) + between : std::string{}) + one(summary.runs);
  };
  switch (wanted) {
    case Format::text:
      return {{"content", both(recordings::to_text, "\n")}};
    case Format::md:
      return {{"content", both(recordings::to_markdown, "\n")}};
    case Format::csv:
      return {{"content", recordings::to_csv(summary.runs)}};
    case Format::html:
      return {{"content", html_of(summary)}};
    case Format::json:
      break;
  }
  json out{{"title", summary.title}, {"runs", to_json(summary.runs)}, {"known_figures", summary.known}};
  if (summary.means) out["means"] = to_json(*summary.means);
  return out;
}

}  // namespace ferrobench::server
