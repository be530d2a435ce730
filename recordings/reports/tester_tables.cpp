// Tables for what testers measure beside loops and pulses: leakage, fatigue.
#include <algorithm>
#include <array>
#include <cmath>

#include "base/units.h"
#include "recordings/reports/clipped_cells.h"
#include "recordings/reports/report.h"

namespace ferrobench::recordings {
namespace {

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
  const Clipping clipping(r);
  for (const auto i : leakage_samples(r, field)) {
    const double density = (*current)[i] / (s.area * static_cast<double>(s.layer_count));
    const double resistivity = field[i] / density;
    table.add({r.time[i], cell(field[i] / volts_per_m_in_kv_per_mm), cell((*current)[i]), cell(density),
               resistivity > 0 ? cell(resistivity) : Cell{}});
    mark_clipped(table, clipping, {"field_kV_per_mm", "resistivity_Ohm_m"}, std::array{Channel::field}, i, i);
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
    std::vector<Entry> row{cell((*cycles)[i])};
    for (const auto* column : shown) row.emplace_back(cell(column->values[i]));
    table.add(row);
  }
  return table;
}

}  // namespace ferrobench::recordings
