// The report's tables from the cycles and holds of a recording, in the units of the field.
#include <array>
#include <cmath>
#include <map>

#include "base/units.h"
#include "recordings/analysis/creep.h"
#include "recordings/analysis/loop_measures.h"
#include "recordings/analysis/loops.h"
#include "recordings/reports/clipped_cells.h"
#include "recordings/reports/report.h"

namespace ferrobench::recordings {
namespace {

constexpr double cubic_metre_in_um = metre_in_um * volts_per_m_in_kv_per_mm;  // m V/m in one um kV/mm

Cell in(double unit, std::optional<double> value) {
  return cell(value ? std::optional(*value / unit) : std::nullopt);
}
Cell in_um(std::optional<double> value) {
  return in(metre_in_um, value);
}
Cell in_kv_per_mm(std::optional<double> value) {
  return in(volts_per_m_in_kv_per_mm, value);
}
Cell whole(std::size_t value) {
  return static_cast<std::int64_t>(value);
}

bool has_program(const Recording& r) {
  return r.size() > 1 && (r.has(Channel::field) || r.has(Channel::command));
}

void note_smoothing(const LoopMeter& meter, Table& table) {
  if (meter.smoothed_any())
    table.notes.emplace_back(
        "Noisy channels are measured on local parabolas over a twentieth of each leg, which do not cross "
        "turning points.");
}

using Keys = std::vector<std::string>;
constexpr std::array field_alone{Channel::field}, displacement_alone{Channel::displacement},
    force_alone{Channel::force};
constexpr std::array displacement_loop{Channel::displacement, Channel::field},
    charge_loop{Channel::charge, Channel::field};

Column rate_column() {
  return {"rate_kV_per_mm_s", "rate", "kV/mm/s"};
}

}  // namespace

std::optional<Table> stroke_table(const Analysis& analysis) {
  const auto& r = analysis.recording;
  if (!has_program(r) || !r.has(Channel::displacement)) return std::nullopt;
  Table table{.key = "stroke",
              .title = "Stroke per cycle and overall",
              .columns = {{"cycle", "cycle", ""},
                          {"start_s", "start", "s"},
                          {"field_low_kV_per_mm", "lowest field", "kV/mm"},
                          {"field_high_kV_per_mm", "highest field", "kV/mm"},
                          rate_column(),
                          {"stroke_um", "stroke", "um"},
                          {"strain_percent", "strain", "%"},
                          {"force_span_N", "force range", "N"}},
              .rows = {},
              .notes = {"Stroke: largest minus smallest displacement."}};
  const auto& meter = analysis.meter();
  const auto add = [&](Cell name, const Cycle& cycle, std::optional<double> stroke,
                       std::optional<double> force_span) {
    const auto strain = stroke ? std::optional(*stroke / r.header.specimen.length * 100) : std::nullopt;
    table.rows.push_back({std::move(name), r.time[cycle.first], in_kv_per_mm(cycle.low),
                          in_kv_per_mm(cycle.high), cycle.rate > 0 ? in_kv_per_mm(cycle.rate) : Cell{},
                          in_um(stroke), cell(strain), cell(force_span)});
    const auto mark = [&](const Keys& keys, std::span<const Channel> channels) {
      mark_clipped(table, analysis.clipping(), keys, channels, cycle.first, cycle.last);
    };
    mark({"field_low_kV_per_mm", "field_high_kV_per_mm"}, field_alone);
    mark({"stroke_um", "strain_percent"}, displacement_alone);
    mark({"force_span_N"}, force_alone);
  };
  const auto& cycles = analysis.cycles();
  const auto& measures = analysis.measures();
  for (std::size_t i = 0; i < cycles.size(); ++i)
    add(std::to_string(i + 1), cycles[i], measures[i].stroke, measures[i].force_span);
  const auto last = r.size() - 1;
  if (const auto range = extremes(field_of(r)))
    add("overall", {0, last, range->low, range->high, 0, {}}, meter.stroke(0, last),
        meter.force_span(0, last));
  note_smoothing(meter, table);
  return table;
}

std::optional<Table> hysteresis_table(const Analysis& analysis) {
  const auto& r = analysis.recording;
  if (!has_program(r) || (!r.has(Channel::displacement) && !r.has(Channel::charge))) return std::nullopt;
  const auto& cycles = analysis.cycles();
  if (cycles.empty()) return std::nullopt;
  Table table{
      .key = "hysteresis",
      .title = "Hysteresis per cycle",
      .columns = {{"cycle", "cycle", ""},
                  rate_column(),
                  {"displacement_area_um_kV_per_mm", "area, displacement loop", "um kV/mm"},
                  {"width_kV_per_mm", "width at half stroke", "kV/mm"},
                  {"width_percent", "width, share of field span", "%"},
                  {"coercive_negative_kV_per_mm", "coercive field, falling", "kV/mm"},
                  {"coercive_positive_kV_per_mm", "coercive field, rising", "kV/mm"},
                  {"remanent_falling_C_per_m2", "remanent polarization, falling", "C/m^2"},
                  {"remanent_rising_C_per_m2", "remanent polarization, rising", "C/m^2"},
                  {"energy_J_per_m3", "energy per cycle", "J/m^3"}},
      .rows = {},
      .notes = {
          "Width: between the first and the last passing of half stroke. Energy: the closed integral of E "
          "dP, with P = Q/(n A)."}};
  const auto& meter = analysis.meter();
  for (std::size_t i = 0; i < cycles.size(); ++i) {
    const auto& cycle = cycles[i];
    const auto& m = analysis.measures()[i];
    const auto share = m.width ? std::optional(*m.width / (cycle.high - cycle.low) * 100) : std::nullopt;
    table.rows.push_back({whole(i + 1), cycle.rate > 0 ? in_kv_per_mm(cycle.rate) : Cell{},
                          in(cubic_metre_in_um, m.displacement_area), in_kv_per_mm(m.width), cell(share),
                          in_kv_per_mm(m.coercive_negative), in_kv_per_mm(m.coercive_positive),
                          cell(m.remanent_falling), cell(m.remanent_rising), cell(m.energy)});
    mark_clipped(table, analysis.clipping(),
                 {"displacement_area_um_kV_per_mm", "width_kV_per_mm", "width_percent"}, displacement_loop,
                 cycle.first, cycle.last);
    mark_clipped(table, analysis.clipping(), {"energy_J_per_m3"}, charge_loop, cycle.first, cycle.last);
    // Where polarization counts from the middle of its range, all of the recording is behind it.
    const auto [first, last] =
        meter.centred() ? std::pair(std::size_t{0}, r.size() - 1) : std::pair(cycle.first, cycle.last);
    mark_clipped(table, analysis.clipping(),
                 {"coercive_negative_kV_per_mm", "coercive_positive_kV_per_mm", "remanent_falling_C_per_m2",
                  "remanent_rising_C_per_m2"},
                 charge_loop, first, last);
  }
  if (meter.centred())
    table.notes.emplace_back(
        "The charge has no absolute zero: polarization counts from the middle of its range.");
  note_smoothing(meter, table);
  return table;
}

std::optional<Table> creep_table(const Recording& r) {
  if (!has_program(r)) return std::nullopt;
  const auto holds = find_holds(r);
  if (holds.empty() || (!r.has(Channel::displacement) && !r.has(Channel::charge))) return std::nullopt;
  Table table{
      .key = "creep",
      .title = "Creep per hold",
      .columns = {{"hold", "hold", ""},
                  {"label", "label", ""},
                  {"field_kV_per_mm", "field", "kV/mm"},
                  {"duration_s", "duration", "s"}},
      .rows = {},
      .notes = {
          "Change: value at the end of the hold minus value at its start (the corner after the ramp); range: "
          "largest minus smallest value. Rate: slope against log10 of the time since the start, from a "
          "hundredth of the hold on."}};
  const Clipping clipping(r);
  std::vector<std::pair<Signal, double>> signals;
  std::vector<std::pair<Channel, Keys>> made_of;
  const auto columns = [&](Channel channel, const std::string& name, const std::string& suffix,
                           const std::string& unit) {
    table.columns.push_back({name + "_change_" + suffix, name + " change", unit});
    table.columns.push_back({name + "_range_" + suffix, name + " range", unit});
    table.columns.push_back({name + "_sign", "sign", ""});
    table.columns.push_back({name + "_rate_" + suffix + "_per_decade", "rate", unit + "/decade"});
    table.columns.push_back({name + "_time_to_half_s", "time to half", "s"});
    auto& keys = made_of.emplace_back(channel, Keys{}).second;
    for (const auto& column : std::span(table.columns).last(5)) keys.push_back(column.key);
  };
  if (r.has(Channel::displacement)) {
    signals.emplace_back(signal(r, Channel::displacement), metre_in_um);
    columns(Channel::displacement, "displacement", "um", "um");
  }
  if (r.has(Channel::charge)) {
    signals.emplace_back(polarization(r), 1.0);
    columns(Channel::charge, "polarization", "C_per_m2", "C/m^2");
  }
  bool exact = true;
  for (std::size_t i = 0; i < holds.size(); ++i) {
    std::vector<Cell> row{whole(i + 1), holds[i].label, in_kv_per_mm(holds[i].level), holds[i].duration};
    for (const auto& [channel, unit] : signals) {
      const auto creep = measure_creep(r, channel, holds[i]);
      exact = exact && channel.exact;
      row.push_back(in(unit, creep.change));
      row.push_back(in(unit, creep.range));
      row.emplace_back(std::string(creep.change > 0 ? "+" : creep.change < 0 ? "-" : "0"));
      row.push_back(in(unit, creep.per_decade));
      row.push_back(cell(creep.time_to_half));
    }
    table.rows.push_back(std::move(row));
    for (const auto& [channel, keys] : made_of)
      mark_clipped(table, clipping, keys, std::span(&channel, 1), holds[i].first, holds[i].last);
  }
  if (!exact)
    table.notes.emplace_back(
        "Noisy channels: start and end come from a line through the first and last hundredth of the hold (5 "
        "samples at "
        "least), range and half time from means over tenths of a decade of time.");
  return table;
}

std::optional<Table> rate_table(const Analysis& analysis) {
  const auto& r = analysis.recording;
  if (!has_program(r) || !r.has(Channel::displacement)) return std::nullopt;
  struct Measured {
    double rate;
    LoopMeasures loop;
    std::size_t cycle;
  };
  std::vector<Measured> cycles;
  for (std::size_t i = 0; i < analysis.cycles().size(); ++i)
    if (const double rate = analysis.cycles()[i].rate; rate > 0)
      cycles.push_back({rate, analysis.measures()[i], i});
  std::ranges::stable_sort(cycles, {}, &Measured::rate);
  if (cycles.empty() || cycles.back().rate <= 1.01 * cycles.front().rate) return std::nullopt;
  Table table{.key = "rates",
              .title = "Stroke and loop area against ramp rate",
              .columns = {rate_column(),
                          {"rate_V_per_s", "rate", "V/s"},
                          {"cycles", "cycles", ""},
                          {"stroke_um", "mean stroke", "um"},
                          {"displacement_area_um_kV_per_mm", "mean area", "um kV/mm"},
                          {"energy_J_per_m3", "mean energy", "J/m^3"}},
              .rows = {},
              .notes = {"Rates within 1 % of each other count as one."}};
  for (std::size_t first = 0; first < cycles.size();) {
    std::size_t next = first;
    double stroke = 0, area = 0, energy = 0;
    do {
      const auto& m = cycles[next].loop;
      stroke += m.stroke.value_or(NAN);
      area += m.displacement_area.value_or(NAN);
      energy += m.energy.value_or(NAN);
      ++next;
    } while (next < cycles.size() && cycles[next].rate <= 1.01 * cycles[first].rate);
    const auto count = static_cast<double>(next - first);
    table.rows.push_back({in_kv_per_mm(cycles[first].rate),
                          cycles[first].rate * r.header.specimen.layer_thickness, whole(next - first),
                          in_um(stroke / count), in(cubic_metre_in_um, area / count), cell(energy / count)});
    for (; first < next; ++first) {
      const auto& cycle = analysis.cycles()[cycles[first].cycle];
      const auto mark = [&](const Keys& keys, std::span<const Channel> channels) {
        mark_clipped(table, analysis.clipping(), keys, channels, cycle.first, cycle.last);
      };
      mark({"stroke_um"}, displacement_alone);
      mark({"displacement_area_um_kV_per_mm"}, displacement_loop);
      mark({"energy_J_per_m3"}, charge_loop);
    }
  }
  note_smoothing(analysis.meter(), table);
  return table;
}

std::optional<Table> minor_loop_table(const Analysis& analysis) {
  const auto& r = analysis.recording;
  if (!has_program(r) || !r.has(Channel::displacement)) return std::nullopt;
  const auto& turns = analysis.turns().points;
  if (turns.size() < 4) return std::nullopt;
  Table table{.key = "minor_loops",
              .title = "Minor loops, reversal by reversal",
              .columns = {{"reversal", "reversal", ""},
                          {"time_s", "time", "s"},
                          {"from_kV_per_mm", "from", "kV/mm"},
                          {"turning_point_kV_per_mm", "turning point", "kV/mm"},
                          {"return_kV_per_mm", "return", "kV/mm"},
                          {"stroke_um", "stroke", "um"},
                          {"displacement_area_um_kV_per_mm", "area", "um kV/mm"}},
              .rows = {},
              .notes = {"Stroke and area of the closed part: from the nearer of the two neighbouring turning "
                        "points to this "
                        "one and back to the same field."}};
  const auto& meter = analysis.meter();
  const auto& field = field_of(r);
  for (std::size_t k = 1; k + 1 < turns.size(); ++k) {
    const auto &before = turns[k - 1], &here = turns[k], &after = turns[k + 1];
    const bool from_before = std::abs(before.level - here.level) <= std::abs(after.level - here.level);
    const double joint = from_before ? before.level : after.level;
    const auto outside = [&](std::size_t i) {
      return std::abs(field[i] - here.level) > std::abs(joint - here.level);
    };
    std::size_t first = before.leave, last = after.arrive;
    while (first < here.arrive && outside(first)) ++first;
    while (last > here.leave && outside(last)) --last;
    table.rows.push_back({whole(k), r.time[here.arrive], in_kv_per_mm(before.level), in_kv_per_mm(here.level),
                          in_kv_per_mm(after.level), in_um(meter.stroke(first, last)),
                          in(cubic_metre_in_um, meter.displacement_area(first, last))});
    mark_clipped(table, analysis.clipping(), {"stroke_um"}, displacement_alone, first, last);
    mark_clipped(table, analysis.clipping(), {"displacement_area_um_kV_per_mm"}, displacement_loop, first,
                 last);
  }
  note_smoothing(meter, table);
  return table;
}

}  // namespace ferrobench::recordings
