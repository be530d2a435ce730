#include "recordings/tables/comparison.h"

#include <cmath>

#include "base/number_text.h"
#include "base/units.h"
#include "recordings/analysis/clipping.h"
#include "recordings/analysis/creep.h"
#include "recordings/analysis/signals.h"
#include "recordings/reports/analysis.h"
#include "recordings/reports/html_page.h"

namespace ferrobench::recordings {
namespace {

constexpr double field_match = 2e3;  // V/m: levels are given to 0.01 kV/mm, reached to a bit of the converter
constexpr double share_match = 0.02;  // of prestress and rate

bool near(double value, double wanted) {
  return std::abs(value - wanted) <= share_match * std::abs(wanted);
}

// The cell's value of the key of a kind, in SI; none if the table has no such key.
std::optional<double> key_of(const PublishedTable& table, const PublishedCell& cell, KeyKind kind) {
  for (const auto& key : table.description.keys)
    if (key.kind == kind) return cell.key(key.column) * key.si;
  return std::nullopt;
}

struct Measured {
  Estimate estimate;
  std::string cut_off;
};

// A value made of the samples first..last of a channel.
Measured measured_in(const Recording& r, Channel channel, Estimate value, double unit, std::size_t first,
                     std::size_t last) {
  const Clipping clipping(r);
  return {{value.value / unit, value.noise / unit, value.calibration / unit},
          clipping.any(std::span(&channel, 1), first, last) ? std::string(channel_name(channel)) : ""};
}

// The longest hold at the field.
std::optional<Hold> hold_at(const Recording& r, std::optional<double> field) {
  std::optional<Hold> found;
  for (const auto& hold : find_holds(r))
    if ((!field || std::abs(hold.level - *field) <= field_match) &&
        (!found || hold.duration > 1.01 * found->duration))
      found = hold;
  return found;
}

std::optional<Measured> creep_of(const TableQuantity& quantity, std::optional<double> field,
                                 const Recording& r) {
  const bool of_charge = quantity.channel == MeasuredChannel::charge;
  const auto channel = of_charge ? Channel::charge : Channel::displacement;
  if (!r.has(channel)) return std::nullopt;
  const auto found = hold_at(r, field);
  if (!found) return std::nullopt;
  auto change = measure_creep(r, of_charge ? polarization(r) : signal(r, channel), *found).change;
  change.value = std::abs(change.value);
  return measured_in(r, channel, change, quantity.si, found->first, found->last);
}

std::optional<Measured> stroke_of(const TableQuantity& quantity, std::optional<double> rate,
                                  const Recording& r) {
  if (!r.has(Channel::displacement)) return std::nullopt;
  const Analysis analysis(r);
  std::optional<Measured> largest;
  std::size_t cycles = 0;
  for (const auto& cycle : analysis.cycles()) {
    if (rate && !near(cycle.rate * r.header.specimen.layer_thickness, *rate)) continue;
    const auto stroke = analysis.meter().stroke(cycle.first, cycle.last);
    if (stroke) ++cycles;
    if (stroke && (!largest || stroke->value / quantity.si > largest->estimate.value))
      largest = measured_in(r, Channel::displacement, *stroke, quantity.si, cycle.first, cycle.last);
  }
  // Of several, noise has a part in which is the largest.
  if (cycles > 1) largest->estimate = {largest->estimate.value};
  return largest;
}

std::optional<Measured> measure(const PublishedTable& table, const PublishedCell& cell, const Recording& r) {
  const auto prestress = key_of(table, cell, KeyKind::prestress);
  if (prestress && !near(r.header.load.prestress, *prestress)) return std::nullopt;
  const auto& quantity = table.quantity_of(cell);
  switch (quantity.measure) {
    case MeasureKind::creep:
      return creep_of(quantity, key_of(table, cell, KeyKind::field), r);
    case MeasureKind::stroke:
      return stroke_of(quantity, key_of(table, cell, KeyKind::rate), r);
  }
  return std::nullopt;
}

std::optional<double> log_error(const ComparedCell& cell) {
  if (!cell.measured || !(*cell.measured > 0) || !cell.cut_off.empty()) return std::nullopt;
  return std::log(*cell.measured / cell.published.published);
}

}  // namespace

Comparison compare(const PublishedTable& table, std::span<const Recording> recordings) {
  Comparison out{.table = table, .cells = {}, .scale = {}, .rms_log_error = {}};
  for (const auto& cell : table.cells) {
    out.cells.push_back({cell, std::nullopt});
    for (const auto& recording : recordings)
      if (auto found = measure(table, cell, recording)) {
        out.cells.back().measured = found->estimate.value;
        out.cells.back().uncertainty = found->estimate.uncertainty();
        out.cells.back().cut_off = std::move(found->cut_off);
        break;
      }
  }
  std::map<std::string, std::vector<double>> errors;
  const auto in_arbitrary_units = [&table](const std::string& quantity) {
    return std::ranges::any_of(table.description.quantities, [&quantity](const TableQuantity& q) {
      return q.column == quantity && q.arbitrary();
    });
  };
  for (const auto& cell : out.cells)
    if (const auto error = log_error(cell)) errors[cell.published.quantity].push_back(*error);
  for (auto& [quantity, list] : errors) {
    const auto count = static_cast<double>(list.size());
    if (in_arbitrary_units(quantity)) {
      double mean = 0;
      for (const double error : list) mean += error / count;
      for (double& error : list) error -= mean;
      out.scale[quantity] = std::exp(-mean);
      for (auto& cell : out.cells)
        if (cell.measured && cell.published.quantity == quantity) {
          *cell.measured *= out.scale[quantity];
          cell.uncertainty *= out.scale[quantity];
        }
    }
    double squares = 0;
    for (const double error : list) squares += error * error;
    out.rms_log_error[quantity] = std::sqrt(squares / count);
  }
  return out;
}

nlohmann::json to_json(const Comparison& comparison) {
  auto cells = nlohmann::json::array();
  for (const auto& cell : comparison.cells) {
    nlohmann::json item{{"quantity", cell.published.quantity},
                        {"published", cell.published.published},
                        {"measured", nullptr},
                        {"measured_uncertainty", nullptr},
                        {"error", nullptr},
                        {"doubtful", cell.published.doubtful},
                        {"clipped", !cell.cut_off.empty()}};
    for (const auto& [key, value] : cell.published.keys) item[key] = value;
    if (cell.measured) {
      item["measured"] = *cell.measured;
      if (cell.uncertainty > 0 && cell.cut_off.empty()) item["measured_uncertainty"] = cell.uncertainty;
      item["error"] = *cell.measured / cell.published.published - 1;
    }
    cells.push_back(std::move(item));
  }
  nlohmann::json out{{"table", comparison.table.name},
                     {"title", comparison.table.title},
                     {"cells", std::move(cells)},
                     {"rms_log_error", comparison.rms_log_error}};
  if (!comparison.scale.empty()) out["scale"] = comparison.scale;
  return out;
}

Table as_table(const Comparison& comparison) {
  Table table{.key = "table_" + comparison.table.name,
              .title = comparison.table.title,
              .columns = {{"quantity", "quantity", ""}},
              .rows = {},
              .notes = {}};
  if (!comparison.cells.empty())
    for (const auto& [key, value] : comparison.cells.front().published.keys)
      table.columns.push_back({key, key, ""});
  table.columns.insert(table.columns.end(), {{"measured", "measured", ""},
                                             {"published", "published", ""},
                                             {"error_percent", "error", "%"},
                                             {"doubtful", "print doubtful", ""}});
  for (const auto& cell : comparison.cells) {
    std::vector<Entry> row{cell.published.quantity};
    for (const auto& [key, value] : cell.published.keys) row.emplace_back(value);
    const double uncertainty = cell.cut_off.empty() ? cell.uncertainty : 0,
                 published = cell.published.published;
    const auto estimate = [&](double less) {
      return cell.measured ? std::optional(Estimate{*cell.measured - less, uncertainty}) : std::nullopt;
    };
    row.insert(row.end(), {Entry(estimate(0), 1), published, Entry(estimate(published), published / 100),
                           std::string(cell.published.doubtful ? "yes" : "")});
    table.add(row);
    if (cell.cut_off.empty()) continue;
    for (std::size_t i = 0; i < table.columns.size(); ++i)
      if (table.columns[i].key == "measured" || table.columns[i].key == "error_percent")
        table.clipped.emplace(table.rows.size() - 1, i);
    if (std::ranges::find(table.cut_off, cell.cut_off) == table.cut_off.end())
      table.cut_off.push_back(cell.cut_off);
  }
  if (!table.clipped.empty()) table.notes.emplace_back("Errors are those of the cells without a mark.");
  for (const auto& [quantity, error] : comparison.rms_log_error)
    table.notes.push_back("root-mean-square log error of " + quantity + ": " + number_text(error));
  for (const auto& [quantity, scale] : comparison.scale)
    table.notes.push_back(quantity + " was published in arbitrary units: measured in C/m^2 times " +
                          number_text(scale));
  return table;
}

std::string render(const Comparison& comparison, Format format) {
  const auto table = as_table(comparison);
  switch (format) {
    case Format::text:
      return to_text(table);
    case Format::md:
      return to_markdown(table);
    case Format::csv:
      return to_csv(table);
    case Format::json:
      return to_json(comparison).dump(2) + '\n';
    case Format::html:
      return html_frame("Table " + comparison.table.name, to_html(table));
  }
  return "";
}

}  // namespace ferrobench::recordings
