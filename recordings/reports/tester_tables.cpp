// Tables for what testers measure beside loops: pulses, leakage, fatigue.
#include <algorithm>
#include <cmath>

#include "base/units.h"
#include "recordings/analysis/signals.h"
#include "recordings/analysis/statistics.h"
#include "recordings/reports/report.h"

namespace ferrobench::recordings {
namespace {

struct Pulse {
  std::size_t start, peak, end;  // samples: before it, at the largest field, and back at none
  bool up;
};

// Stretches of one sign above a twentieth of the largest field.
std::vector<Pulse> pulses_of(const std::vector<double>& field) {
  constexpr double low = 0.05, none = 0.01;
  double largest = 0;
  for (const double e : field) largest = std::max(largest, std::abs(e));
  std::vector<Pulse> out;
  for (std::size_t i = 1; i < field.size(); ++i) {
    if (!(std::abs(field[i]) > low * largest) || std::abs(field[i - 1]) > low * largest) continue;
    Pulse pulse{i - 1, i, i, field[i] > 0};
    const auto within = [&](double limit) {
      return pulse.end + 1 < field.size() && (field[pulse.end] > 0) == pulse.up &&
             std::abs(field[pulse.end]) > limit * largest;
    };
    for (; within(low); ++pulse.end)
      if (std::abs(field[pulse.end]) > std::abs(field[pulse.peak])) pulse.peak = pulse.end;
    i = pulse.end;
    while (within(none)) ++pulse.end;
    if (pulse.end - pulse.start > 4) out.push_back(pulse);
  }
  return out;
}

// Positive-up-negative-down: of both signs two in a row, all about as high, each from zero back to zero.
bool is_pund(const std::vector<Pulse>& pulses, const std::vector<double>& field) {
  constexpr std::size_t least = 4, most = 64;
  constexpr double alike = 0.5;
  if (pulses.size() < least || pulses.size() > most) return false;
  double largest = 0;
  for (const auto& p : pulses) largest = std::max(largest, std::abs(field[p.peak]));
  bool up = false, down = false;
  for (std::size_t i = 0; i < pulses.size(); ++i) {
    if (std::abs(field[pulses[i].peak]) < alike * largest) return false;
    if (i == 0 || pulses[i].up != pulses[i - 1].up) continue;
    (pulses[i].up ? up : down) = true;
  }
  return up && down;
}

const std::vector<double>* other(const Recording& r, std::string_view name) {
  const auto found =
      std::ranges::find_if(r.others, [name](const OtherColumn& o) { return o.as.name == name; });
  return found == r.others.end() ? nullptr : &found->values;
}

// A tenth of a decade of the time apart while the field rests, and every sample where it steps.
std::vector<std::size_t> leakage_samples(const Recording& r, const std::vector<double>& field) {
  constexpr double rests = 0.02, apart = 1.3;
  constexpr std::size_t most = 400;
  double largest = 0;
  for (const double e : field) largest = std::max(largest, std::abs(e));
  std::vector<std::size_t> out;
  double since = 0, shown = 0;
  for (std::size_t i = 0; i < field.size() && out.size() < most; ++i) {
    const bool stepped = i == 0 || std::abs(field[i] - field[i - 1]) > rests * largest;
    if (stepped) since = i == 0 ? 0 : r.time[i - 1];
    const bool last = i + 1 == field.size() || std::abs(field[i + 1] - field[i]) > rests * largest;
    if (!stepped && !last && r.time[i] - since < apart * shown) continue;
    shown = r.time[i] - since;
    out.push_back(i);
  }
  return out;
}

}  // namespace

std::optional<Table> pulse_table(const Recording& r) {
  if (r.size() < 2 || !r.has(Channel::field) || !r.has(Channel::charge)) return std::nullopt;
  const auto& field = r.at(Channel::field);
  const auto pulses = pulses_of(field);
  if (!is_pund(pulses, field)) return std::nullopt;
  const auto p = polarization(r);
  Table table{
      .key = "pulses",
      .title = "Pulses (PUND)",
      .columns = {{"pulse", "pulse", ""},
                  {"start_s", "start", "s"},
                  {"field_kV_per_mm", "largest field", "kV/mm"},
                  {"kind", "kind", ""},
                  {"at_peak_C_per_m2", "polarization change at the largest field", "C/m^2"},
                  {"left_C_per_m2", "polarization change left at zero field", "C/m^2"}},
      .rows = {},
      .notes = {"A pulse switches if the one before had the other sign. The switched polarization is the "
                "change of a switching pulse less that of the next, which does not switch."}};
  for (std::size_t i = 0; i < pulses.size(); ++i) {
    const auto& pulse = pulses[i];
    const auto change = [&](std::size_t at) { return cell(p.values[at] - p.values[pulse.start]); };
    const auto* kind = i == 0 ? "first" : pulse.up != pulses[i - 1].up ? "switching" : "not switching";
    table.rows.push_back({static_cast<std::int64_t>(i + 1), r.time[pulse.start],
                          cell(field[pulse.peak] / volts_per_m_in_kv_per_mm), std::string(kind),
                          change(pulse.peak), change(pulse.end)});
  }
  return table;
}

std::optional<Table> leakage_table(const Recording& r) {
  const auto* current = other(r, "current");
  if (r.size() < 2 || current == nullptr || r.has(Channel::charge) || !r.has(Channel::field))
    return std::nullopt;
  const auto& field = r.at(Channel::field);
  const auto& s = r.header.specimen;
  Table table{
      .key = "leakage",
      .title = "Leakage",
      .columns = {{"time_s", "time", "s"},
                  {"field_kV_per_mm", "field", "kV/mm"},
                  {"current_A", "current", "A"},
                  {"current_density_A_per_m2", "current density", "A/m^2"},
                  {"resistivity_Ohm_m", "resistivity", "Ohm m"}},
      .rows = {},
      .notes = {"Resistivity: field over current density; none where they have different signs. Where "
                "the field rests, samples stand ever further apart."}};
  for (const auto i : leakage_samples(r, field)) {
    const double density = (*current)[i] / (s.area * static_cast<double>(s.layer_count));
    const double resistivity = field[i] / density;
    table.rows.push_back({r.time[i], cell(field[i] / volts_per_m_in_kv_per_mm), cell((*current)[i]),
                          cell(density), resistivity > 0 ? cell(resistivity) : Cell{}});
  }
  return table;
}

std::optional<Table> fatigue_table(const Recording& r) {
  const auto* cycles = other(r, "cycles");
  if (cycles == nullptr || r.size() < 2) return std::nullopt;
  constexpr std::size_t most_columns = 12, most_rows = 1000;
  Table table{.key = "fatigue",
              .title = "Fatigue",
              .columns = {{"cycles", "cycles", ""}},
              .rows = {},
              .notes = {"As the tester found them after so many cycles."}};
  std::vector<const OtherColumn*> shown;
  for (const auto& column : r.others) {
    if (column.as.name == "cycles" || shown.size() >= most_columns) continue;
    shown.push_back(&column);
    table.columns.push_back({column.as.name, column.as.long_name, column.as.unit});
  }
  for (std::size_t i = 0; i < std::min(r.size(), most_rows); ++i) {
    std::vector<Cell> row{cell((*cycles)[i])};
    for (const auto* column : shown) row.push_back(cell(column->values[i]));
    table.rows.push_back(std::move(row));
  }
  return table;
}

}  // namespace ferrobench::recordings
