// A published table with the values that recordings give for its cells, and how far they are apart.
//
// Where a cell is measured, its table's description says (description.h): in which recording, by prestress;
// in which hold, by field; in which cycles, by rate. A hold starts at the corner after the ramp
// (recordings/analysis/creep.h says how noise is dealt with). Measured values of a quantity in arbitrary
// units are multiplied by the one factor that makes the mean log error zero.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "recordings/format/recording.h"
#include "recordings/reports/table.h"
#include "recordings/tables/published.h"

namespace ferrobench::recordings {

struct ComparedCell {
  PublishedCell published;
  std::optional<double> measured;  // in the quantity's unit, scaled; none if no recording has it
  // The channel that a converter cut off where this was measured; then it counts for no error. "": none.
  std::string cut_off = {};
  double uncertainty = 0;  // standard, of `measured`; 0: none is known
};

struct Comparison {
  PublishedTable table;
  std::vector<ComparedCell> cells;
  std::map<std::string, double> scale;          // by quantity, of those in arbitrary units
  std::map<std::string, double> rms_log_error;  // by quantity: sqrt(mean(ln(measured / published)^2))
};

Comparison compare(const PublishedTable& table, std::span<const Recording> recordings);

// {table, cells: [{quantity, <keys>, measured, measured_uncertainty, published, error, doubtful, clipped}],
// rms_log_error: {quantity: x}, scale}
nlohmann::json to_json(const Comparison& comparison);
Table as_table(const Comparison& comparison);
std::string render(const Comparison& comparison, Format format);

}  // namespace ferrobench::recordings
