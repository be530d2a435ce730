// What stands beside a published table's numbers (tables/table_3_11.json beside table_3_11.csv): which
// experiment is behind them, what its columns mean, and how well its cells are known.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/fields.h"

namespace ferrobench::recordings {

// What a key column tells of the place where a cell was measured. number: a row's number, nothing else.
enum class KeyKind { number, prestress, field, rate };
// creep: the difference, without sign, between the values at the start and at the end of the hold at the
// cell's field, of several the longest. stroke: the largest stroke of the cycles at the cell's rate, or of
// all.
enum class MeasureKind { creep, stroke };
enum class MeasuredChannel { displacement, charge };  // creep of the charge is that of the polarization
std::span<const std::pair<KeyKind, std::string_view>> enum_names(KeyKind);
std::span<const std::pair<MeasureKind, std::string_view>> enum_names(MeasureKind);
std::span<const std::pair<MeasuredChannel, std::string_view>> enum_names(MeasuredChannel);

struct TableKey {
  std::string column{};
  KeyKind kind = KeyKind::number;
  std::string unit{};  // "" for none
  double si = 1;       // SI units in one of it; of a rate V/s
  // There is a run for each value of the column: the run's setting that takes it, "prestress_MPa" or a
  // parameter of the protocol. "": the same run serves all values.
  std::string setting{};
};

struct TableQuantity {
  std::string column{};
  MeasureKind measure = MeasureKind::creep;
  MeasuredChannel channel = MeasuredChannel::displacement;
  // "" for arbitrary units: what is measured is multiplied by the one factor that makes the mean log error
  // zero.
  std::string unit{};
  double si = 1;                                    // SI units in one of it
  double uncertainty = 1;                           // standard deviation of a cell's logarithm
  std::optional<double> uncertainty_if_doubtful{};  // where the print is doubtful; absent: the same

  bool arbitrary() const { return unit.empty(); }
};

// The direction in which a quantity changes from one value of a key to the next, all else equal, is known
// better than the values: in cells whose `where_negative` is below zero, ln(later / earlier) has the
// published sign and is at least `least`.
struct TableTrend {
  std::string along{}, where_negative{};
  double least = 0, uncertainty = 1;
};

struct TableDescription {
  std::string protocol{};                                // of the library of field programs
  std::string specimen{};                                // of the library of models
  nlohmann::json parameters = nlohmann::json::object();  // of the protocol, where they are not its own
  std::vector<TableKey> keys{};
  std::vector<TableQuantity> quantities{};
  std::optional<TableTrend> trend{};  // of the first quantity
  std::string note{};
};

template <class Visitor>
void describe(Visitor& visit, TableKey& k) {
  visit("column", k.column, {.required = true});
  visit("kind", k.kind, {.required = true});
  visit("unit", k.unit, {});
  visit("si", k.si, {.min = 0, .exclusive_min = true});
  visit("setting", k.setting, {});
}
template <class Visitor>
void describe(Visitor& visit, TableQuantity& q) {
  visit("column", q.column, {.required = true});
  visit("measure", q.measure, {.required = true});
  visit("channel", q.channel, {.required = true});
  visit("unit", q.unit, {});
  visit("si", q.si, {.min = 0, .exclusive_min = true});
  visit("uncertainty", q.uncertainty, {.min = 0, .exclusive_min = true, .required = true});
  visit("uncertainty_if_doubtful", q.uncertainty_if_doubtful, {.min = 0, .exclusive_min = true});
}
template <class Visitor>
void describe(Visitor& visit, TableTrend& t) {
  visit("along", t.along, {.required = true});
  visit("where_negative", t.where_negative, {.required = true});
  visit("least", t.least, {.min = 0, .required = true});
  visit("uncertainty", t.uncertainty, {.min = 0, .exclusive_min = true, .required = true});
}
template <class Visitor>
void describe(Visitor& visit, TableDescription& d) {
  visit("protocol", d.protocol, {.required = true});
  visit("specimen", d.specimen, {.required = true});
  visit("parameters", d.parameters, {});
  visit("keys", d.keys, {.required = true});
  visit("quantities", d.quantities, {.required = true});
  visit("trend", d.trend, {});
  visit("note", d.note, {});
}

}  // namespace ferrobench::recordings
