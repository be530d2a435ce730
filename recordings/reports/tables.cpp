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

Entry in_um(const std::optional<Estimate>& value) {
  return {value, metre_in_um};
}
Entry in_kv_per_mm(const std::optional<Estimate>& value) {
  return {value, volts_per_m_in_kv_per_mm};
}
Entry in_si(const std::optional<Estimate>& value) {
  return {value, 1};
}
// Without an uncertainty.
Cell value_alone(const std::optional<Estimate>& estimate, double unit) {
  return estimate ? cell(estimate->value / unit) : Cell{};
}
Cell in_kv_per_mm(double value) {
  return cell(value / volts_per_m_in_kv_per_mm);
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
        "Noisy channels are measured on local parabolas, as wide as the curve allows and a twentieth of each "
        "leg at the most, which do not cross turning points.");
}

void note_centring(const LoopMeter& meter, Table& table) {
  if (meter.centred())
    table.notes.emplace_back(
        "The charge has no absolute zero: polarization counts from the middle of its range.");
}

using Keys = std::vector<std::string>;
constexpr std::array field_alone{Channel::field}, displacement_alone{Channel::displacement},
    force_alone{Channel::force};
constexpr std::array displacement_loop{Channel::displacement, Channel::field},
    charge_loop{Channel::charge, Channel::field};

// Of estimates that have their noise each for itself and their calibration together. It is none if one of
// them is none, and without an uncertainty if one of them is: that one's share would be missing.
class Mean {
 public:
  void take(const std::optional<Estimate>& one) {
    const auto given = one.value_or(Estimate{NAN});
    sum_.value += given.value;
    sum_.noise = std::hypot(sum_.noise, given.noise);
    sum_.calibration += given.calibration;
    stated_ = stated_ && given.uncertainty() > 0;
    ++count_;
  }
  Estimate done() const {
    if (!stated_) return {sum_.value / count_};
    return {sum_.value / count_, sum_.noise / count_, sum_.calibration / count_};
  }

 private:
  Estimate sum_;
  double count_ = 0;
  bool stated_ = true;
};

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
  const auto add = [&](Cell name, const Cycle& cycle, const std::optional<Estimate>& stroke,
                       const std::optional<Estimate>& force_span) {
    table.add({std::move(name), r.time[cycle.first], in_kv_per_mm(cycle.low), in_kv_per_mm(cycle.high),
               cycle.rate > 0 ? in_kv_per_mm(cycle.rate) : Cell{}, in_um(stroke),
               Entry(stroke, r.header.specimen.length / 100), in_si(force_span)});
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
  auto stroke = meter.stroke(0, last), force_span = meter.force_span(0, last);
  if (cycles.size() > 1) {
    for (auto* of_several : {&stroke, &force_span})
      if (*of_several) *of_several = Estimate{(*of_several)->value};
    if (meter.smoothed_any())
      table.notes.emplace_back(
          "Overall figures have no uncertainty: of several cycles, noise has a part in which is the "
          "largest.");
  }
  if (const auto range = extremes(field_of(r)))
    add("overall", {0, last, range->low, range->high, 0, {}}, stroke, force_span);
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
    table.add({whole(i + 1), cycle.rate > 0 ? in_kv_per_mm(cycle.rate) : Cell{},
               Entry(m.displacement_area, cubic_metre_in_um), in_kv_per_mm(m.width),
               Entry(m.width, (cycle.high - cycle.low) / 100), in_kv_per_mm(m.coercive_negative),
               in_kv_per_mm(m.coercive_positive), in_si(m.remanent_falling), in_si(m.remanent_rising),
               in_si(m.energy)});
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
  note_centring(meter, table);
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
    std::vector<Entry> row{whole(i + 1), holds[i].label, in_kv_per_mm(holds[i].level), holds[i].duration};
    for (const auto& [channel, unit] : signals) {
      const auto creep = measure_creep(r, channel, holds[i]);
      exact = exact && channel.exact;
      const double change = creep.change.value;
      row.emplace_back(creep.change, unit);
      row.emplace_back(cell(creep.range / unit));
      row.emplace_back(std::string(change > 0 ? "+" : change < 0 ? "-" : "0"));
      row.emplace_back(creep.per_decade, unit);
      row.emplace_back(cell(creep.time_to_half));
    }
    table.add(row);
    for (const auto& [channel, keys] : made_of)
      mark_clipped(table, clipping, keys, std::span(&channel, 1), holds[i].first, holds[i].last);
  }
  if (!exact)
    table.notes.emplace_back(
        "Noisy channels: start and end come from a line through the first and last samples, a hundredth of "
        "the "
        "hold (5 samples at least) at the most, range and half time from means over tenths of a decade of "
        "time.");
  return table;
}

std::optional<Table> mean_table(const Analysis& analysis) {
  const auto& mean = analysis.mean();
  if (!mean) return std::nullopt;
  const Analysis own(mean->recording);
  const auto& cycles = own.cycles();
  if (cycles.empty()) return std::nullopt;
  Table table{.key = "mean",
              .title = "Mean of " + mean->in_words(),
              .columns = {{"cycle", "cycle", ""},
                          rate_column(),
                          {"stroke_um", "stroke", "um"},
                          {"strain_percent", "strain", "%"},
                          {"displacement_area_um_kV_per_mm", "area, displacement loop", "um kV/mm"},
                          {"width_kV_per_mm", "width at half stroke", "kV/mm"},
                          {"coercive_negative_kV_per_mm", "coercive field, falling", "kV/mm"},
                          {"coercive_positive_kV_per_mm", "coercive field, rising", "kV/mm"},
                          {"remanent_falling_C_per_m2", "remanent polarization, falling", "C/m^2"},
                          {"remanent_rising_C_per_m2", "remanent polarization, rising", "C/m^2"},
                          {"energy_J_per_m3", "energy per cycle", "J/m^3"}},
              .rows = {},
              .notes = {"Sample by sample, without the first pass, which brings the specimen into the loop. "
                        "Noise is the scatter of the passes about their mean."}};
  for (const auto& why : mean->left_out) table.notes.push_back(why);
  for (std::size_t i = 0; i < cycles.size(); ++i) {
    const auto& m = own.measures()[i];
    table.add({whole(i + 1), cycles[i].rate > 0 ? in_kv_per_mm(cycles[i].rate) : Cell{}, in_um(m.stroke),
               Entry(m.stroke, mean->recording.header.specimen.length / 100),
               Entry(m.displacement_area, cubic_metre_in_um), in_kv_per_mm(m.width),
               in_kv_per_mm(m.coercive_negative), in_kv_per_mm(m.coercive_positive),
               in_si(m.remanent_falling), in_si(m.remanent_rising), in_si(m.energy)});
    const auto mark = [&](const Keys& keys, std::span<const Channel> channels) {
      mark_clipped(table, own.clipping(), keys, channels, cycles[i].first, cycles[i].last);
    };
    mark({"stroke_um", "strain_percent"}, displacement_alone);
    mark({"displacement_area_um_kV_per_mm", "width_kV_per_mm"}, displacement_loop);
    mark({"coercive_negative_kV_per_mm", "coercive_positive_kV_per_mm", "remanent_falling_C_per_m2",
          "remanent_rising_C_per_m2", "energy_J_per_m3"},
         charge_loop);
  }
  note_centring(own.meter(), table);
  note_smoothing(own.meter(), table);
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
    Mean stroke, area, energy;
    do {
      const auto& m = cycles[next].loop;
      stroke.take(m.stroke);
      area.take(m.displacement_area);
      energy.take(m.energy);
      ++next;
    } while (next < cycles.size() && cycles[next].rate <= 1.01 * cycles[first].rate);
    table.add({in_kv_per_mm(cycles[first].rate), cycles[first].rate * r.header.specimen.layer_thickness,
               whole(next - first), in_um(stroke.done()), Entry(area.done(), cubic_metre_in_um),
               in_si(energy.done())});
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
                        "one and back to the same field. They have no uncertainty: noise moves that field."}};
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
    table.add({whole(k), r.time[here.arrive], in_kv_per_mm(before.level), in_kv_per_mm(here.level),
               in_kv_per_mm(after.level), value_alone(meter.stroke(first, last), metre_in_um),
               value_alone(meter.displacement_area(first, last), cubic_metre_in_um)});
    mark_clipped(table, analysis.clipping(), {"stroke_um"}, displacement_alone, first, last);
    mark_clipped(table, analysis.clipping(), {"displacement_area_um_kV_per_mm"}, displacement_loop, first,
                 last);
  }
  note_smoothing(meter, table);
  return table;
}

}  // namespace ferrobench::recordings
