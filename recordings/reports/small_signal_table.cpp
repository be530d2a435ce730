// The table of the small-signal response, bias by bias.
#include <array>

#include "base/units.h"
#include "recordings/analysis/small_signal.h"
#include "recordings/reports/analysis.h"
#include "recordings/reports/clipped_cells.h"
#include "recordings/reports/report.h"

namespace ferrobench::recordings {
namespace {

constexpr std::array bias_channel{Channel::field};
constexpr std::array capacitance_channels{Channel::charge, Channel::field};
constexpr std::array d33_channels{Channel::displacement, Channel::field};

Cell bias_cell(double field) {
  return cell(field / volts_per_m_in_kv_per_mm);
}

std::string in_words(Approach approach) {
  return approach == Approach::up ? "up" : approach == Approach::down ? "down" : "-";
}

}  // namespace

std::optional<Table> small_signal_table(const Analysis& analysis) {
  const auto& r = analysis.recording;
  const auto& points = analysis.small_signal();
  if (points.empty()) return std::nullopt;
  const bool charge = r.has(Channel::charge), displacement = r.has(Channel::displacement);
  Table table{
      .key = "small_signal",
      .title = "Small-signal response, bias by bias",
      .columns = {{"field_kV_per_mm", "bias", "kV/mm"},
                  {"approached", "approached", ""},
                  {"frequency_Hz", "frequency", "Hz"},
                  {"amplitude_kV_per_mm", "amplitude", "kV/mm"}},
      .rows = {},
      .notes = {"By least squares at each bias, over all cycles of the sine but the first: a "
                "cubic for bias and creep, the fundamental and two harmonics. Phases count from the field."}};
  if (charge) {
    table.columns.insert(table.columns.end(), {{"capacitance_F", "capacitance", "F"},
                                               {"permittivity", "relative permittivity", ""},
                                               {"tan_delta", "tan δ", ""}});
    table.notes.emplace_back("tan δ is positive where the charge lags the field, by which energy is lost.");
  }
  if (displacement) {
    table.columns.insert(table.columns.end(),
                         {{"d33_m_per_V", "d33", "m/V"}, {"phase_degree", "phase of d33", "degree"}});
    table.notes.emplace_back(
        "d33: amplitude of the strain over that of the field, under the load of this recording. Phase: "
        "negative where the displacement lags, near 180 degrees where it goes against the field.");
  }
  table.notes.emplace_back(
      "A response below five of its standard uncertainties has no phase, no tan δ, and none is stated.");
  for (const auto& point : points) {
    std::vector<Entry> row{bias_cell(point.sine.bias), in_words(point.sine.approach), point.frequency,
                           bias_cell(point.amplitude)};
    if (charge)
      for (const auto& figure : {point.capacitance, point.permittivity, point.tan_delta})
        row.emplace_back(figure, 1);
    if (displacement)
      for (const auto& figure : {point.d33, point.phase}) row.emplace_back(figure, 1);
    table.add(row);
    const auto mark = [&](const std::vector<std::string>& keys, std::span<const Channel> channels) {
      mark_clipped(table, analysis.clipping(), keys, channels, point.sine.first, point.sine.last);
    };
    mark({"field_kV_per_mm", "amplitude_kV_per_mm"}, bias_channel);
    if (charge) mark({"capacitance_F", "permittivity", "tan_delta"}, capacitance_channels);
    if (displacement) mark({"d33_m_per_V", "phase_degree"}, d33_channels);
  }
  return table;
}

}  // namespace ferrobench::recordings
