// Creep read at times that are spaced evenly in their logarithm, hold by hold.
#include <string>

#include "base/number_text.h"
#include "base/units.h"
#include "recordings/analysis/creep.h"
#include "recordings/reports/analysis.h"
#include "recordings/reports/clipped_cells.h"
#include "recordings/reports/report.h"

namespace ferrobench::recordings {
namespace {

struct CreepChannel {
  Channel channel;
  std::string name, suffix, unit;
  double in_unit;  // what one unit is in SI
};

Table reading_table(const Analysis& analysis, const std::vector<Hold>& holds,
                    const std::vector<double>& times, const Signal& signal, const CreepChannel& shown) {
  Table table{
      .key = "creep_readings_" + shown.name,
      .title = "Creep of the " + shown.name + ": change since the start of the hold",
      .columns = {{"hold", "hold", ""}, {"label", "label", ""}, {"field_kV_per_mm", "field", "kV/mm"}},
      .rows = {},
      .notes = {"Readings at 1, 2 and 5 of every decade of the time since the start of the hold (the "
                "corner after the ramp)."}};
  std::vector<std::string> keys;
  for (const double t : times) {
    keys.push_back("after_" + number_text(t) + "_s_" + shown.suffix);
    table.columns.push_back({keys.back(), "after " + number_text(t) + " s", shown.unit});
  }
  for (const auto& hold : holds) {
    std::vector<Entry> row{static_cast<std::int64_t>(hold.number), hold.label,
                           hold.level / volts_per_m_in_kv_per_mm};
    for (const double t : times)
      row.emplace_back(creep_after(analysis.recording, signal, hold, t), shown.in_unit);
    table.add(row);
    mark_clipped(table, analysis.clipping(), keys, std::span(&shown.channel, 1), hold.first, hold.last);
  }
  if (!signal.exact)
    table.notes.emplace_back(
        "Noisy channel: the mean of the samples within a twentieth of a decade on either side of the time, "
        "less the start, which comes from a line through the first samples of the hold.");
  return table;
}

}  // namespace

std::vector<Table> creep_readings(const Analysis& analysis) {
  const auto& r = analysis.recording;
  std::vector<Table> out;
  if (r.size() < 2 || (!r.has(Channel::field) && !r.has(Channel::command))) return out;
  const auto holds = long_holds(r, analysis.sines());
  const auto times = reading_times(r, holds);
  if (times.empty()) return out;
  if (r.has(Channel::displacement))
    out.push_back(reading_table(analysis, holds, times, signal(r, Channel::displacement),
                                {Channel::displacement, "displacement", "um", "um", metre_in_um}));
  if (r.has(Channel::charge))
    out.push_back(reading_table(analysis, holds, times, polarization(r),
                                {Channel::charge, "polarization", "C_per_m2", "C/m^2", 1}));
  return out;
}

}  // namespace ferrobench::recordings
