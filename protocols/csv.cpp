#include "protocols/csv.h"

#include <array>
#include <cmath>

#include "base/delimited_text.h"
#include "base/fields.h"
#include "base/headings.h"
#include "base/units.h"

namespace ferrobench::protocols {
namespace {

constexpr std::size_t time_column = 0, level_column = 1;
constexpr std::array of_time{Quantity::time};
constexpr std::array of_level{Quantity::field, Quantity::voltage};

// The unit of a column, nullptr if its heading says none; a problem if it is none of these quantities.
const KnownUnit* unit_of(const DelimitedText& table, std::size_t column, std::span<const Quantity> quantities,
                         const std::string& path, std::vector<Problem>& problems) {
  const auto heading = read_heading(table.names().at(column));
  const auto* unit = find_unit(heading.unit, quantities);
  const bool bare_voltage = heading.unit.empty() && column == level_column && names_a_voltage(heading.name);
  if (unit == nullptr && (bare_voltage || !heading.unit.empty()))
    problems.push_back(
        {.path = path,
         .message = table.column_name(column) +
                    (bare_voltage ? " is a voltage that says no unit" : " has a unit that is not understood"),
         .given = excerpt(bare_voltage ? heading.name : heading.unit),
         .allowed = units_of(quantities),
         .hint = column == time_column ? "a heading like time_s or t [ms]"
                                       : "a heading like field_kV_per_mm, E (kV/mm), voltage_V or U/kV"});
  return unit;
}

}  // namespace

std::span<const std::pair<Unit, std::string_view>> enum_names(Unit) {
  static constexpr std::pair<Unit, std::string_view> names[] = {{Unit::kv_per_mm, "kV/mm"},
                                                                {Unit::volt, "V"}};
  return names;
}

PointTable read_points(std::string_view text, const std::string& path, std::optional<Unit> unit,
                       std::vector<Problem>& problems) {
  PointTable out{.points = {}, .unit = unit.value_or(Unit::kv_per_mm)};
  DelimitedText table(text, {}, path, problems, max_problems);
  if (table.columns() == 0) return out;
  if (table.columns() != 2) {
    table.complain(
        "a time and a level are wanted, and there are " + std::to_string(table.columns()) + " columns",
        table.names().empty() ? "" : table.names().back());
    return out;
  }
  double seconds = 1, levels = 1;
  if (!table.names().empty()) {
    const auto before = problems.size();
    const auto* time_unit = unit_of(table, time_column, of_time, path, problems);
    const auto* level = unit_of(table, level_column, of_level, path, problems);
    if (problems.size() > before) return out;
    if (time_unit != nullptr) seconds = time_unit->si;
    if (level != nullptr) {
      const auto said = level->quantity == Quantity::voltage ? Unit::volt : Unit::kv_per_mm;
      if (unit && said != *unit) {
        problems.push_back(
            {.path = path,
             .message = table.column_name(level_column) + " is in another unit than the protocol",
             .given = level->text,
             .allowed = units_of(std::span(of_level).subspan(*unit == Unit::volt ? 1 : 0, 1))});
        return out;
      }
      out.unit = said;
      levels = level->si / (said == Unit::volt ? 1 : volts_per_m_in_kv_per_mm);
    }
  }
  while (table.next()) {
    const auto before = problems.size();
    const double time = table.number(time_column), level = table.number(level_column);
    if (problems.size() > before) continue;
    if (std::isnan(time) || std::isnan(level))
      table.complain(table.column_name(std::isnan(time) ? time_column : level_column) + " is empty", "");
    else
      out.points.push_back({time * seconds, level * levels});
  }
  return out;
}

}  // namespace ferrobench::protocols
