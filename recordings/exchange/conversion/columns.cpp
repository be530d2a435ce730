#include "recordings/exchange/conversion/columns.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/number_text.h"
#include "base/units.h"
#include "recordings/exchange/conversion/checks.h"
#include "recordings/exchange/conversion/loops_of_tester.h"
#include "recordings/exchange/conversion/radiant_columns.h"
#include "recordings/exchange/conversion/units_of_columns.h"

namespace ferrobench::recordings {
namespace {

std::optional<double> number_in(const TesterTable& table, std::string_view key) {
  const auto value = table.find(key);
  return value ? value->number : std::nullopt;
}

double demand_number(const TesterTable& table, std::string_view key) {
  const auto value = number_in(table, key);
  if (value && *value > 0) return *value;
  throw Error(ErrorCode::bad_recording, "the file's header cannot be understood",
              Problem{.message = "the header of " + table.label + " has no number above zero for " +
                                 std::string(key) + ", which its time follows from"});
}

void take_pulses(TesterTable& table, Measured& m) {
  m.time = demand_column(table, "Time", Quantity::time);
  m.voltage = demand_column(table, "V", Quantity::voltage);
  m.current = take_column(table, "I", Quantity::current);
  m.polarization = take_column(table, "P", Quantity::polarization);
  m.blocks = table.blocks;
  const auto sequence = table.find("Pulse Sequence");
  for (std::size_t i = 0; i <= m.blocks.size(); ++i) {
    const auto row = i == 0 ? 0 : m.blocks[i - 1];
    if (row >= m.time.size()) break;
    std::string text = "pulse " + std::to_string(i + 1) + " of " + std::to_string(m.blocks.size() + 1);
    if (sequence && i == 0) text += ", sequence " + sequence->text;
    if (row > 0 && m.time[row] > m.time[row - 1])
      text += ", after " + number_text(m.time[row] - m.time[row - 1]) + " s without samples";
    m.say("pulse", text, m.time[row]);
  }
}

void take_leakage_steps(TesterTable& table, Measured& m) {
  const double step = demand_number(table, "Step Duration");
  for (std::size_t i = 0; i < table.rows(); ++i) m.time.push_back(step * static_cast<double>(i + 1));
  m.voltage = demand_column(table, "Voltage", Quantity::voltage);
  m.current = demand_column(table, "Leakage Current Density", Quantity::current_density);
  for (double& i : *m.current) i *= m.area;
  m.conducts = true;
  m.say("note", "the table has no time: each row is taken for the reading at the end of its step of " +
                    number_text(step) + " s (Step Duration)");
}

// The program of a leakage table is in its header: from zero by even steps to both maxima and back.
void check_staircase(const TesterTable& table, Measured& m) {
  const auto step = number_in(table, "Voltage Step"), most = number_in(table, "Max. Voltage");
  if (table.kind != Measurement::leakage_steps || !m.voltage || !step || !(*step > 0)) return;
  constexpr double part = 0.2;
  const auto& v = *m.voltage;
  std::size_t wrong = 0, first = 0;
  for (std::size_t i = 1; i < v.size(); ++i)
    if (std::abs(std::abs(v[i] - v[i - 1]) - *step) > part * *step && wrong++ == 0) first = i;
  if (wrong > 0)
    m.say("warning",
          std::to_string(wrong) + " steps of the voltage are not the " + number_text(*step) +
              " V of the header (Voltage Step), first in " + m.place(first) + ": rows are missing or changed",
          m.time[first]);
  const auto [low, high] = range_of(v);
  const bool whole = std::abs(v.back() - v.front()) < *step / 2 &&
                     (!most || std::max(high, -low) > std::abs(*most) - *step / 2);
  m.say(whole ? "check" : "warning",
        whole ? "the voltage goes through all of its program and ends where it began"
              : "the voltage does not go through all of its program: it ends at " + number_text(v.back()) +
                    " V, so rows are missing");
}

// Readings of a fatigue test in order of their cycles, which are its time.
void take_fatigue(TesterTable& table, Measured& m, const Specimen& specimen) {
  auto& columns = table.columns;
  const auto cycles = std::ranges::find(columns, "Cycles", &TesterColumn::name);
  if (cycles == columns.end()) demand_column(table, "Cycles", Quantity::time);  // says what there is
  const double frequency = demand_number(table, "Fatigue Frequency"),
               amplitude = demand_number(table, "Fatigue Amplitude");
  std::vector<std::size_t> order(table.rows());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::ranges::stable_sort(order, {}, [&cycles](std::size_t i) { return cycles->values[i]; });
  if (!std::ranges::is_sorted(order)) m.say("note", "the readings were put in order of their cycles");
  for (auto& column : columns) {
    Values sorted;
    for (const auto i : order) sorted.push_back(column.values[i]);
    column.values = std::move(sorted);
  }
  for (const double n : cycles->values) m.time.push_back(n / frequency);
  m.channel(Channel::command) = Values(m.time.size(), amplitude / specimen.layer_thickness);
  m.place_of = [table_order = order, first = table.first_line](std::size_t row) {
    return "line " + std::to_string(first + table_order.at(row));
  };
  m.say("note", "readings between cycles: the time is that of the cycles, at " + number_text(frequency) +
                    " Hz, and the command is their amplitude of " + number_text(amplitude) + " V");
}

void take_flags(const TesterTable& table, Measured& m) {
  for (const std::string_view key : {"Error", "Warning"})
    for (const auto& line : table.header)
      if (const auto value = header_value(line, key)) m.say("flag", std::string(key) + ": " + value->text);
  if (const auto single = table.find("SingleLoop"); single && single->text != "NO")
    m.say("flag", "SingleLoop: " + single->text);
  if (const auto status = number_in(table, "Measurement Status"); status && *status != 0)
    m.say("flag", "Measurement Status: " + number_text(*status));
}

// Cls and Epsls are one slope of the loop, as a capacitance and as a permittivity: between them lie the
// specimen's area and thickness.
void check_permittivity(const TesterTable& table, Measured& m, const Specimen& specimen) {
  constexpr double exact = 5e-3;
  const auto capacitance = number_in(table, "Cls"), permittivity = number_in(table, "Epsls");
  if (!capacitance || !permittivity || !(*capacitance > 0) || !(*permittivity > 0)) return;
  const double stated = *capacitance / (*permittivity * vacuum_permittivity),
               own = specimen.area / specimen.layer_thickness;
  const bool holds = std::abs(stated / own - 1) < exact;
  m.say(holds ? "check" : "warning", "area over thickness is " + number_text(own) + " m, and " +
                                         number_text(stated) + " m by the tester's Cls and Epsls" +
                                         (holds ? ": so the thickness holds" : ""));
}

}  // namespace

Measured measured_of(TesterTable& table, const Specimen& specimen, double area) {
  Measured m{.time = {}, .area = area};
  m.place_of = [blocks = table.blocks, first = table.first_line](std::size_t row) {
    TesterTable lines;
    lines.blocks = blocks;
    lines.first_line = first;
    return "line " + std::to_string(lines.line_of(row));
  };
  const bool radiant = table.column("Drive Voltage") != nullptr || table.column("Volts") != nullptr;
  if (radiant && table.columns.front().name == "Point") table.columns.erase(table.columns.begin());
  switch (table.kind) {
    case Measurement::hysteresis:
    case Measurement::remanent_hysteresis:
      if (radiant || table.kind == Measurement::remanent_hysteresis)
        take_radiant_loop(table, m);
      else
        take_tester_loop(table, m);
      break;
    case Measurement::pulses:
      take_pulses(table, m);
      break;
    case Measurement::leakage:
      take_radiant_leakage(table, m);
      break;
    case Measurement::leakage_steps:
      take_leakage_steps(table, m);
      break;
    case Measurement::fatigue:
      take_fatigue(table, m, specimen);
      break;
  }
  take_others(table, m);
  demand_rising_time(m);
  m.returns = table.kind != Measurement::leakage && table.kind != Measurement::fatigue;
  const bool from_zero =
      !radiant && (table.kind == Measurement::hysteresis || table.kind == Measurement::pulses);
  if (from_zero && m.time.front() != 0)
    m.say("warning",
          "the time begins at " + number_text(m.time.front()) + " s, not at zero: rows are missing");
  take_flags(table, m);
  check_radiant(table, m, specimen);
  check_permittivity(table, m, specimen);
  check_staircase(table, m);
  for (const std::string_view key : {"Hysteresis Amplitude", "Volts"})
    if (!m.amplitude && table.kind != Measurement::leakage) m.amplitude = number_in(table, key);
  m.frequency = number_in(table, "Hysteresis Frequency");
  if (const auto period = table.find("Hysteresis Period"); period && period->number && *period->number > 0) {
    constexpr std::array of_time{Quantity::time};
    if (const auto* unit = find_unit(period->unit, of_time)) m.frequency = 1 / (*period->number * unit->si);
  }
  if (table.kind == Measurement::pulses) m.amplitude = number_in(table, "Pund Amplitude");
  for (auto& finding : table.findings) m.findings.push_back(std::move(finding));
  return m;
}

}  // namespace ferrobench::recordings
