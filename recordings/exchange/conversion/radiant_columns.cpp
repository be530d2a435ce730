#include "recordings/exchange/conversion/radiant_columns.h"

#include <algorithm>
#include <cmath>

#include "base/number_text.h"
#include "base/units.h"
#include "recordings/analysis/statistics.h"
#include "recordings/exchange/conversion/checks.h"
#include "recordings/exchange/conversion/units_of_columns.h"
#include "recordings/exchange/testers/number_rows.h"

namespace ferrobench::recordings {
namespace {

constexpr double figures_close = 0.02;

std::optional<double> figure_of(const TesterTable& table, std::string_view key) {
  for (const auto& text : table.figures)
    if (const auto value = header_value({text, 0}, key)) return value->number;
  return std::nullopt;
}

void compare(Measured& m, const std::string& what, double ours, double theirs, const std::string& unit,
             const std::string& whose) {
  const bool holds = std::abs(ours - theirs) <= figures_close * std::abs(theirs);
  m.say(holds ? "check" : "warning", what + " is " + number_text(ours) + " " + unit + ", and " +
                                         number_text(theirs) + " " + unit + " by " + whose);
}

// "346.15 (kV/cm)"
std::optional<double> header_field(const TesterTable& table) {
  const auto value = table.find("Field");
  if (!value) return std::nullopt;
  const auto open = value->text.find('(');
  if (open == std::string::npos) return std::nullopt;
  const auto number = number_of(std::string_view(value->text).substr(0, open));
  const auto close = value->text.find(')', open);
  constexpr std::array of_field{Quantity::field};
  const auto* unit = find_unit(value->text.substr(open + 1, close - open - 1), of_field);
  return number && unit != nullptr ? std::optional(*number * unit->si) : std::nullopt;
}

// Cross-checks a capacitance and a permittivity: between them lie area and thickness.
void check_capacitance(const TesterTable& table, Measured& m, const Specimen& specimen) {
  const auto capacitance = figure_of(table, "C (Max-Eff)"), permittivity = figure_of(table, "K (Eff)");
  if (!capacitance || !permittivity || !(*capacitance > 0) || !(*permittivity > 0)) return;
  constexpr double farad_in_nf = 1e-9;
  compare(m, "area over thickness", specimen.area / specimen.layer_thickness,
          *capacitance * farad_in_nf / (*permittivity * vacuum_permittivity), "m",
          "Vision's C and K: so area and thickness");
}

// Remanent = Logic 1 - Logic 0, and a constant for each half of the loop.
void check_remanent(const TesterTable& table, Measured& m) {
  const auto *off = table.column("Logic 0 Polarization"), *rest = table.column("Remanent Polarization");
  if (off == nullptr || rest == nullptr || !m.polarization) return;
  constexpr double si = 1e-2, jump = 0.01;
  const auto& on = *m.polarization;
  const double range = range_of(on).span();
  std::size_t jumps = 0, first = 0;
  for (std::size_t i = 1; i < on.size(); ++i) {
    const auto constant = [&](std::size_t k) { return on[k] / si - off->values[k] - rest->values[k]; };
    if (std::abs(constant(i) - constant(i - 1)) * si > jump * range && jumps++ == 0) first = i;
  }
  if (jumps <= 1)
    m.say("check", "the remanent polarization is Logic 1 less Logic 0, in each half of the loop");
  else
    m.say("warning", "the remanent polarization is not Logic 1 less Logic 0, first in " + m.place(first),
          m.time[first]);
}

void check_leakage(const TesterTable& table, Measured& m, const Specimen& specimen) {
  if (!m.conducts || !m.current || m.current->empty()) return;
  const auto current = figure_of(table, "Current"), resistance = figure_of(table, "Resistance"),
             resistivity = figure_of(table, "Resistivity");
  const auto tail = std::max<std::size_t>(m.current->size() / 50, 1);
  const double last = median({m.current->end() - static_cast<std::ptrdiff_t>(tail), m.current->end()});
  if (current) compare(m, "the current at the end", last, *current, "A", "Vision's figure");
  constexpr double metres_in_cm = 1e-2;
  if (resistance && resistivity)
    compare(m, "the resistivity, R A/h,", *resistance * specimen.area / specimen.layer_thickness,
            *resistivity * metres_in_cm, "Ohm m", "Vision's figure: so area and thickness");
}

}  // namespace

void take_radiant_loop(TesterTable& table, Measured& m) {
  m.time = demand_column(table, "Time", Quantity::time);
  m.voltage = demand_column(table, "Drive Voltage", Quantity::voltage, "V");
  const bool remanent = table.kind == Measurement::remanent_hysteresis;
  const auto* switching = remanent ? "Logic 1 Polarization" : "Measured Polarization";
  m.polarization = demand_column(table, switching, Quantity::polarization, "uC/cm2");
  if (remanent) {
    check_remanent(table, m);
    m.say("note", "of the two runs the switching one, Logic 1, is the recording's; the other goes along");
    for (const std::string_view name : {"Logic 0 Polarization", "Remanent Polarization"})
      for (auto& column : table.columns)
        if (column.name == name && column.unit.empty()) column.unit = "uC/cm2";
  }
  m.say("note", "Vision writes no units for its columns: V and uC/cm2, as its figures have them");
}

void take_radiant_leakage(TesterTable& table, Measured& m) {
  m.time = demand_column(table, "Time", Quantity::time);
  m.voltage = demand_column(table, "Volts", Quantity::voltage, "V");
  m.current = demand_column(table, "Measured Current", Quantity::current, "A");
  m.conducts = true;
}

void check_radiant(const TesterTable& table, Measured& m, const Specimen& specimen) {
  if (table.tester != "Radiant Vision") return;
  constexpr double si = 1e-2;  // C/m^2 in uC/cm2
  if (const auto largest = figure_of(table, "PMax"); largest && m.polarization && !m.polarization->empty())
    compare(m, "the largest polarization", range_of(*m.polarization).high / si, *largest, "uC/cm2",
            "Vision's figure PMax");
  const auto volts = table.find("Volts");
  if (const auto field = header_field(table); field && volts && volts->number)
    compare(m, "the field at " + volts->text + " V", *volts->number / specimen.layer_thickness / 1e6,
            *field / 1e6, "kV/mm", "Vision's header: so the thickness");
  check_capacitance(table, m, specimen);
  check_leakage(table, m, specimen);
}

}  // namespace ferrobench::recordings
