// Tables of pulses: each of them, the sequences that they make, and the figures of the tester that made them.
#include <algorithm>
#include <array>
#include <cmath>

#include "base/units.h"
#include "recordings/reports/analysis.h"
#include "recordings/reports/clipped_cells.h"
#include "recordings/reports/report.h"

namespace ferrobench::recordings {
namespace {

constexpr std::array pulse_channels{Channel::charge, Channel::field};

Cell in_kv_per_mm(double field) {
  return cell(field / volts_per_m_in_kv_per_mm);
}

// "Psw [uC/cm2]: 17.5273" in the header that an import kept, in C/m^2.
std::optional<double> stated(const Recording& r, const std::string& name) {
  constexpr double microcoulomb_per_cm2 = 1e-2;
  if (!r.header.device.is_object() || !r.header.device.contains("header")) return std::nullopt;
  for (const auto& line : r.header.device["header"]) {
    const auto text = line.is_string() ? line.get<std::string>() : "";
    const auto start = name + " [uC/cm2]: ";
    if (!text.starts_with(start)) continue;
    char* end = nullptr;
    const double value = std::strtod(text.c_str() + start.size(), &end);
    if (end != text.c_str() + start.size()) return value * microcoulomb_per_cm2;
  }
  return std::nullopt;
}

bool near(double a, double b) {
  constexpr double rounding = 1e-3;
  return std::abs(a - b) <= rounding * std::max(std::abs(a), std::abs(b));
}

}  // namespace

std::optional<Table> pulse_table(const Analysis& analysis) {
  const auto& r = analysis.recording;
  const auto& pulses = analysis.pulses();
  if (!pulses) return std::nullopt;
  const auto& p = pulses->polarization;
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
  for (std::size_t i = 0; i < pulses->list.size(); ++i) {
    const auto& pulse = pulses->list[i];
    const auto change = [&](std::size_t at) {
      return Entry(p.estimate(p.reading(at) - p.reading(pulse.start)), 1);
    };
    const auto* kind = i == 0 ? "first" : pulse.up != pulses->list[i - 1].up ? "switching" : "not switching";
    table.add({static_cast<std::int64_t>(i + 1), r.time[pulse.start],
               in_kv_per_mm(r.at(Channel::field)[pulse.peak]), std::string(kind), change(pulse.peak),
               change(pulse.end)});
    mark_clipped(table, analysis.clipping(), {"field_kV_per_mm", "at_peak_C_per_m2", "left_C_per_m2"},
                 pulse_channels, pulse.start, pulse.end);
  }
  return table;
}

std::optional<Table> pund_table(const Analysis& analysis) {
  const auto& r = analysis.recording;
  const auto& pulses = analysis.pulses();
  if (!pulses) return std::nullopt;
  Table table{
      .key = "pund",
      .title = "Switched polarization (PUND), cycle by cycle",
      .columns = {{"cycle", "cycle", ""},
                  {"start_s", "start", "s"},
                  {"field_kV_per_mm", "largest field", "kV/mm"},
                  {"P_C_per_m2", "P", "C/m^2"},
                  {"U_C_per_m2", "U", "C/m^2"},
                  {"N_C_per_m2", "N", "C/m^2"},
                  {"D_C_per_m2", "D", "C/m^2"},
                  {"switched_C_per_m2", "switched", "C/m^2"},
                  {"non_switched_C_per_m2", "not switched", "C/m^2"},
                  {"switched_left_C_per_m2", "switched and left at zero field", "C/m^2"}},
      .rows = {},
      .notes = {
          "P, U, N, D: change of the polarization from where a pulse begins to its largest field. Switched: "
          "the mean of P - U and |N| - |D|; not switched: the mean of U and |D|."}};
  const auto cycles = pund_cycles(pulses->list);
  for (std::size_t i = 0; i < cycles.size(); ++i) {
    const auto at_peak = charges_of(cycles[i], *pulses, &Pulse::peak);
    const auto left = charges_of(cycles[i], *pulses, &Pulse::end);
    std::size_t first = r.size(), last = 0;
    double largest = 0;
    for (const auto& k : cycles[i]) {
      if (!k) continue;
      first = std::min(first, pulses->list[*k].start);
      last = std::max(last, pulses->list[*k].end);
      largest = std::max(largest, std::abs(r.at(Channel::field)[pulses->list[*k].peak]));
    }
    const auto charge = [&](const std::optional<Reading>& reading) {
      return Entry(reading ? std::optional(pulses->polarization.estimate(*reading)) : std::nullopt, 1);
    };
    std::vector<Entry> row{static_cast<std::int64_t>(i + 1), r.time[first], in_kv_per_mm(largest)};
    for (const auto& change : at_peak.change) row.push_back(charge(change));
    for (const auto& sum : {at_peak.switched(), at_peak.non_switched(), left.switched()})
      row.push_back(charge(sum));
    table.add(row);
    std::vector<std::string> keys;
    for (const auto& column : std::span(table.columns).subspan(2)) keys.push_back(column.key);
    mark_clipped(table, analysis.clipping(), keys, pulse_channels, first, last);
  }
  return table;
}

std::optional<Table> pund_tester_table(const Analysis& analysis) {
  const auto& r = analysis.recording;
  const auto& pulses = analysis.pulses();
  if (!pulses) return std::nullopt;
  const auto cycles = pund_cycles(pulses->list);
  if (cycles.size() != 1) return std::nullopt;
  const auto ours = tester_figures(cycles.front(), *pulses);
  if (!ours) return std::nullopt;
  Table table{
      .key = "pund_tester",
      .title = "The tester's own figures",
      .columns = {{"figure", "figure", ""},
                  {"definition", "definition", ""},
                  {"samples_C_per_m2", "from the samples", "C/m^2"},
                  {"tester_C_per_m2", "stated", "C/m^2"},
                  {"difference_percent", "difference", "%"}},
      .rows = {},
      .notes = {"Polarization counts from the middle of its values at the largest fields of N and P. Unlike "
                "the table above, switched and not switched count from Prrel, where the tester's next pulse "
                "begins."}};
  const auto add = [&](const std::string& name, const std::string& definition, const Reading& reading) {
    const auto theirs = stated(r, name);
    const auto value = pulses->polarization.estimate(reading);
    if (theirs)
      table.add({name, definition, Entry(value, 1), *theirs,
                 Entry(Estimate{value.value - *theirs, value.noise, value.calibration}, *theirs / 100)});
    return theirs;
  };
  auto p_max = add("Pmax", "at the largest field", ours->p_max);
  if (!p_max) p_max = add("Pvmax+", "at the largest field", ours->p_max);
  const auto plus = add("Prrel+", "where U begins", ours->relaxed_plus);
  const auto minus = add("Prrel-", "where D begins", ours->relaxed_minus);
  if (!p_max || !plus || !minus) return std::nullopt;
  add("Pnsw", "Pmax - Prrel+", ours->p_max - ours->relaxed_plus);
  // Versions of the tester's program differ; the header's figures tell which one it was.
  const auto switched = stated(r, "Psw");
  if (switched && near(*switched, *p_max - *minus)) {
    add("Psw", "Pmax - Prrel-", ours->p_max - ours->relaxed_minus);
    add("dPsw", "Psw - Pnsw", ours->relaxed_plus - ours->relaxed_minus);
  } else if (switched && near(*switched, *p_max + *minus)) {
    add("Psw", "Pmax + Prrel-, the change of D", ours->p_max + ours->relaxed_minus);
  }
  return table;
}

}  // namespace ferrobench::recordings
