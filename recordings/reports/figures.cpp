#include "recordings/reports/figures.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "base/number_text.h"
#include "base/units.h"
#include "recordings/analysis/creep.h"
#include "recordings/analysis/forc.h"
#include "recordings/analysis/loops.h"
#include "recordings/analysis/parts.h"
#include "recordings/analysis/signals.h"
#include "recordings/analysis/statistics.h"
#include "recordings/analysis/thinning.h"
#include "recordings/reports/table.h"

namespace ferrobench::recordings {
namespace {

constexpr std::size_t pixels = 1200;
constexpr std::size_t most_cycles = 12;

std::vector<double> scaled(std::vector<double> values, double unit) {
  for (auto& v : values) v /= unit;
  return values;
}

struct Shown {
  std::string title, label;
  std::vector<double> values;
};

// The channels that were measured, in the units of the field.
std::vector<Shown> shown_channels(const Recording& r) {
  std::vector<Shown> out;
  if (r.has(Channel::charge))
    out.push_back({"Charge per electrode area", "polarization [C/m²]", *polarization(r).own});
  if (r.has(Channel::displacement))
    out.push_back({"Displacement", "displacement [µm]", scaled(r.at(Channel::displacement), metre_in_um)});
  if (r.has(Channel::force)) out.push_back({"Force", "force [N]", r.at(Channel::force)});
  // A current is shown where nothing follows from it.
  for (const auto& other : r.others)
    if (other.as.name == "current" && !r.has(Channel::charge))
      out.push_back({"Current", "current [A]", other.values});
  return out;
}

// A leakage current is drawn against a field only if there is more than one field.
bool is_stepped(const std::vector<double>& field) {
  constexpr double rests = 0.02;
  const auto [low, high] = std::ranges::minmax(field);
  return high - low > rests * std::max(std::abs(low), std::abs(high));
}

void add_creep(const Analysis& analysis, const Signal& signal, double unit, const std::string& name,
               const std::string& unit_name, std::vector<Figure>& figures) {
  Figure figure{.title = "Creep of the " + name,
                .x_label = "time since the start of the hold [s]",
                .y_label = name + " change [" + unit_name + "]",
                .log_x = true,
                .square = true,
                .series = {}};
  for (const auto& curve : creep_curves(analysis.recording, signal, analysis.sines())) {
    const auto& hold = curve.hold;
    auto& series = figure.series.emplace_back();
    series.label = (hold.label.empty() ? "hold " + std::to_string(hold.number) : hold.label) + ": " +
                   number_text(hold.level / volts_per_m_in_kv_per_mm) + " kV/mm";
    for (std::size_t i = 0; i < curve.time.size(); ++i)
      series.points.push_back({curve.time[i], curve.change[i] / unit});
  }
  if (!figure.series.empty()) figures.push_back(std::move(figure));
}

double range_of(const std::vector<double>& values) {
  const auto range = extremes(values);
  return range && range->span() > 0 ? range->span() : 1;
}

Figure loop_figure(const Parts& parts, const std::vector<double>& field, const Shown& channel) {
  constexpr double pixels_across = 1000, error = 0.5;
  constexpr std::size_t most_points = 60'000;
  Figure figure{.title = channel.title + " against field",
                .x_label = "field [kV/mm]",
                .y_label = channel.label,
                .square = true,
                .series = {}};
  const double x_pixel = range_of(field) / pixels_across, y_pixel = range_of(channel.values) / pixels_across;
  double worst = 0;
  for (const auto& part : parts.parts) {
    const auto count = part.last - part.first + 1;
    const auto x = std::span(field).subspan(part.first, count);
    const auto y = std::span(channel.values).subspan(part.first, count);
    const auto thinned = thin_to(x, y, x_pixel, y_pixel, error, most_points / parts.parts.size() + 2);
    worst = std::max(worst, thinned.error);
    Series series{.label = parts.label(part), .points = {}, .value = 0, .quiet = !part.cycle};
    if (part.cycle)
      series.value = parts.by == ToldBy::cycle
                         ? static_cast<double>(*part.cycle)
                         : std::log(parts.by == ToldBy::rate ? part.rate : part.frequency);
    for (const auto i : thinned.kept) series.points.push_back({x[i], y[i]});
    figure.series.push_back(std::move(series));
  }
  std::ranges::stable_sort(figure.series, [](const Series& a, const Series& b) {
    return a.quiet != b.quiet ? a.quiet : a.value < b.value;
  });
  std::string said;  // cycles alike share one line of the legend
  for (auto& series : figure.series)
    if (series.label == said)
      series.label.clear();
    else
      said = series.label;
  const auto shown = static_cast<std::size_t>(
      std::ranges::count_if(parts.parts, [](const Part& part) { return part.cycle.has_value(); }));
  if (shown < parts.cycles)
    figure.note = std::to_string(shown) + " of " + std::to_string(parts.cycles) + " cycles";
  if (worst > error)
    figure.note += (figure.note.empty() ? "" : ", ") + std::string("noise thinned to ") +
                   number_text(worst / pixels_across * 100) + " % of the axes";
  return figure;
}

void add_mean(const MeanOfPasses& mean, std::vector<Figure>& figures) {
  const Analysis analysis(mean.recording);
  const auto field = scaled(field_of(mean.recording), volts_per_m_in_kv_per_mm);
  const auto parts = parts_of(mean.recording, analysis.cycles(), most_cycles);
  for (auto& channel : shown_channels(mean.recording)) {
    if (channel.title == "Force" || channel.title == "Current") continue;
    auto figure = loop_figure(parts, field, channel);
    figure.title += ", mean of " + mean.in_words();
    figures.push_back(std::move(figure));
  }
}

void add_forc(const Forc& forc, std::vector<Figure>& figures) {
  constexpr double density = volts_per_m_in_kv_per_mm * volts_per_m_in_kv_per_mm;
  const auto field = scaled(forc.field, volts_per_m_in_kv_per_mm);
  const auto reversal = scaled(forc.reversal, volts_per_m_in_kv_per_mm);
  Figure family{.title = "First-order reversal curves",
                .x_label = "field [kV/mm]",
                .y_label = "polarization less that at the upper level [C/m²]",
                .square = true,
                .series = {}};
  for (std::size_t k = 0; k < reversal.size(); ++k) {
    const bool ends = k == 0 || k + 1 == reversal.size();
    Series series{.label = ends ? "from " + number_text(reversal[k]) + " kV/mm" : "",
                  .points = {},
                  .value = reversal[k]};
    for (std::size_t i = 0; i < field.size(); ++i)
      series.points.push_back({field[i], forc.polarization[k][i]});
    family.series.push_back(std::move(series));
  }
  figures.push_back(std::move(family));
  const auto side = std::to_string(2 * forc.smoothing + 1);
  Figure map{.title = "Distribution of the reversals",
             .x_label = "field [kV/mm]",
             .y_label = "reversal field [kV/mm]",
             .square = true,
             .series = {},
             .map = Map{.x = field, .y = reversal, .z = forc.density, .label = "C/m² / (kV/mm)²"},
             .note = "second-degree polynomials over " + side + " × " + side + " points"};
  for (auto& row : map.map->z)
    for (auto& z : row) z *= density;
  figures.push_back(std::move(map));
}

// From bias to bias, each way a line of its own that begins where the other one turned. None where fewer than
// two biases have the figure.
std::optional<Figure> bias_figure(const std::vector<SmallSignalPoint>& points, const std::string& title,
                                  const std::string& label, std::optional<Estimate> SmallSignalPoint::*value,
                                  double unit) {
  Figure out{.title = title + " against bias",
             .x_label = "bias [kV/mm]",
             .y_label = label,
             .square = true,
             .series = {}};
  const bool several = std::ranges::any_of(points, [&](const SmallSignalPoint& p) {
    return std::abs(p.frequency - points.front().frequency) > 0.01 * p.frequency;
  });
  std::string before;
  std::array<double, 2> last{NAN, NAN};
  int known = 0;
  for (const auto& p : points) {
    const auto start = last;
    const auto& estimate = p.*value;
    last = {p.sine.bias / volts_per_m_in_kv_per_mm, estimate ? estimate->value / unit : NAN};
    known += estimate ? 1 : 0;
    if (p.sine.approach == Approach::none) continue;  // where the first line begins
    auto name = std::string(p.sine.approach == Approach::up ? "up" : "down");
    if (several) name += ", " + number_text(p.frequency) + " Hz";
    auto line = std::ranges::find(out.series, name, &Series::label);
    if (line == out.series.end()) line = out.series.insert(line, {.label = name, .points = {}});
    if (name != before) line->points.insert(line->points.end(), {{NAN, NAN}, start});
    before = name;
    line->points.push_back(last);
  }
  return known < 2 || out.series.empty() ? std::nullopt : std::optional(out);
}

void add_small_signal(const std::vector<SmallSignalPoint>& points, std::vector<Figure>& figures) {
  const auto add = [&](const std::string& title, const std::string& label,
                       std::optional<Estimate> SmallSignalPoint::*value, double unit) {
    if (auto figure = bias_figure(points, title, label, value, unit)) figures.push_back(std::move(*figure));
  };
  constexpr double picometre = 1e-12;
  add("Relative permittivity", "relative permittivity", &SmallSignalPoint::permittivity, 1);
  add("Loss", "tan δ", &SmallSignalPoint::tan_delta, 1);
  add("Piezoelectric coefficient", "d33 [pm/V]", &SmallSignalPoint::d33, picometre);
  add("Phase of the displacement", "phase [degree]", &SmallSignalPoint::phase, 1);
}

}  // namespace

std::vector<std::array<double, 2>> band(const std::vector<double>& x, const std::vector<double>& y,
                                        std::size_t pieces) {
  std::vector<std::array<double, 2>> out;
  const auto begins = stretches(x, pieces);
  for (std::size_t k = 0; k < begins.size(); ++k) {
    const auto first = begins[k], last = k + 1 < begins.size() ? begins[k + 1] : x.size();
    std::set<std::size_t> kept;
    for (const auto* values : {&x, &y}) {
      std::size_t low = last, high = last;
      for (std::size_t i = first; i < last; ++i) {
        if (std::isnan(x[i]) || std::isnan(y[i])) continue;
        if (low == last || (*values)[i] < (*values)[low]) low = i;
        if (high == last || (*values)[i] > (*values)[high]) high = i;
      }
      if (low < last) kept.insert({low, high});
    }
    if (kept.empty()) out.push_back({NAN, NAN});
    for (const auto i : kept) out.push_back({x[i], y[i]});
  }
  return out;
}

std::vector<Figure> make_figures(const Analysis& analysis) {
  const auto& r = analysis.recording;
  std::vector<Figure> out;
  if (r.size() < 2 || (!r.has(Channel::field) && !r.has(Channel::command))) return out;
  const auto field = scaled(field_of(r), volts_per_m_in_kv_per_mm);
  const auto over_time = [&](const std::string& title, const std::string& label,
                             const std::vector<double>& values) {
    out.push_back({.title = title,
                   .x_label = "time [s]",
                   .y_label = label,
                   .series = {{.label = "", .points = band(r.time, values, pixels)}}});
  };
  const auto channels = shown_channels(r);
  over_time("Field", "field [kV/mm]", field);
  for (const auto& channel : channels) over_time(channel.title, channel.label, channel.values);
  const auto& cycles = analysis.cycles();
  const auto parts = parts_of(r, cycles, most_cycles);
  for (const auto& channel : channels)
    if (channel.title != "Force" && (channel.title != "Current" || is_stepped(field)))
      out.push_back(loop_figure(parts, field, channel));
  if (const auto& mean = analysis.mean()) add_mean(*mean, out);
  if (const auto forc = find_forc(r, cycles)) add_forc(*forc, out);
  add_small_signal(analysis.small_signal(), out);
  if (r.has(Channel::displacement))
    add_creep(analysis, signal(r, Channel::displacement), metre_in_um, "displacement", "µm", out);
  if (r.has(Channel::charge)) add_creep(analysis, polarization(r), 1, "polarization", "C/m²", out);
  return out;
}

}  // namespace ferrobench::recordings
