#include "recordings/reports/figures.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "base/number_text.h"
#include "base/units.h"
#include "recordings/analysis/creep.h"
#include "recordings/analysis/signals.h"
#include "recordings/analysis/statistics.h"
#include "recordings/reports/table.h"

namespace ferrobench::recordings {
namespace {

constexpr std::size_t pixels = 1200;
constexpr std::size_t most_curves = 16;

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
    out.push_back({"Charge per electrode area", "polarization [C/m^2]", *polarization(r).own});
  if (r.has(Channel::displacement))
    out.push_back({"Displacement", "displacement [um]", scaled(r.at(Channel::displacement), metre_in_um)});
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

// Change since the start of the hold against the time since, averaged over a fortieth of a decade.
Series creep_curve(const Recording& r, const Signal& signal, const Hold& hold, double unit) {
  Series out{.label = number_text(hold.level / volts_per_m_in_kv_per_mm) + " kV/mm", .points = {}};
  const double start = edge_value(r, signal, hold.first, hold.last - hold.first + 1, false);
  std::vector<double> times, values;
  double bin = NAN;
  const auto close = [&] {
    if (!times.empty()) out.points.push_back({mean(times), (mean(values) - start) / unit});
    times.clear();
    values.clear();
  };
  for (std::size_t i = hold.first + 1; i <= hold.last; ++i) {
    const double t = r.time[i] - r.time[hold.first];
    if (std::floor(40 * std::log10(t)) != bin) close();
    bin = std::floor(40 * std::log10(t));
    times.push_back(t);
    values.push_back(signal.values[i]);
  }
  close();
  return out;
}

// Of the long holds only: the short ones lead back to where the next begins.
std::vector<Hold> shown_holds(const Recording& r) {
  auto holds = find_holds(r);
  double longest = 0;
  for (const auto& hold : holds) longest = std::max(longest, hold.duration);
  std::erase_if(holds, [&](const Hold& hold) { return hold.duration < 0.5 * longest; });
  if (holds.size() > most_curves) holds.resize(most_curves);
  return holds;
}

void add_creep(const Recording& r, const Signal& signal, double unit, const std::string& name,
               const std::string& unit_name, std::vector<Figure>& figures) {
  Figure figure{.title = "Creep of the " + name,
                .x_label = "time since the start of the hold [s]",
                .y_label = name + " change [" + unit_name + "]",
                .log_x = true,
                .square = true,
                .series = {}};
  for (const auto& hold : shown_holds(r)) figure.series.push_back(creep_curve(r, signal, hold, unit));
  if (!figure.series.empty()) figures.push_back(std::move(figure));
}

}  // namespace

std::vector<std::array<double, 2>> thinned(const std::vector<double>& x, const std::vector<double>& y,
                                           std::size_t pieces) {
  std::vector<std::array<double, 2>> out;
  const std::size_t step = std::max<std::size_t>(1, x.size() / pieces);
  for (std::size_t first = 0; first < x.size(); first += step) {
    const auto last = std::min(first + step, x.size());
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

std::vector<Figure> make_figures(const Recording& r) {
  std::vector<Figure> out;
  if (r.size() < 2 || (!r.has(Channel::field) && !r.has(Channel::command))) return out;
  const auto field = scaled(field_of(r), volts_per_m_in_kv_per_mm);
  const auto over_time = [&](const std::string& title, const std::string& label,
                             const std::vector<double>& values) {
    out.push_back({.title = title,
                   .x_label = "time [s]",
                   .y_label = label,
                   .series = {{.label = "", .points = thinned(r.time, values, pixels)}}});
  };
  const auto channels = shown_channels(r);
  over_time("Field", "field [kV/mm]", field);
  for (const auto& channel : channels) over_time(channel.title, channel.label, channel.values);
  for (const auto& channel : channels)
    if (channel.title != "Force" && (channel.title != "Current" || is_stepped(field)))
      out.push_back({.title = channel.title + " against field",
                     .x_label = "field [kV/mm]",
                     .y_label = channel.label,
                     .square = true,
                     .series = {{.label = "", .points = thinned(field, channel.values, pixels)}}});
  if (r.has(Channel::displacement))
    add_creep(r, signal(r, Channel::displacement), metre_in_um, "displacement", "um", out);
  if (r.has(Channel::charge)) add_creep(r, polarization(r), 1, "polarization", "C/m^2", out);
  return out;
}

}  // namespace ferrobench::recordings
