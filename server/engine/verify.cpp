#include "server/engine/verify.h"

#include <algorithm>
#include <cmath>

#include "base/fields.h"
#include "base/number_text.h"
#include "recordings/format/parts.h"
#include "recordings/reports/report.h"

namespace ferrobench::server {

using recordings::Recording;

namespace {

std::string in_full(const std::optional<double>& v) {
  if (!v) return "nothing";
  return std::isnan(*v) ? "a gap" : number_in_full(*v);
}

// The report without what names the run.
std::string report_of(const Recording& recording) {
  auto report = recordings::make_report(recording);
  std::erase_if(report.facts, [](const auto& fact) {
    return fact.first == "start" || fact.first == "device" || fact.first == "identifier";
  });
  return render(report, recordings::Format::json);
}

}  // namespace

std::string in_words(const recordings::ColumnDifference& c) {
  if (!c.in_a || !c.in_b) return c.in_a ? "only in the first" : "only in the second";
  if (!c.first) return "identical";
  return "row " + std::to_string(c.first->row) + ": " + in_full(c.first->a) + " and " + in_full(c.first->b) +
         " " + c.unit;
}

std::optional<std::string> first_difference(const Recording& recorded, const Recording& replayed) {
  const auto difference = recordings::compare(recorded, replayed);
  for (const auto& column : difference.columns) {
    if (column.identical()) continue;
    const bool added = !column.in_a && column.dataset.ends_with("/command");
    const bool left_out = !column.in_b && column.unit == "counts" && !replayed.raw;
    if (!added && !left_out) return column.dataset + ", " + in_words(column);
  }
  for (const auto& value : difference.tables) {
    const bool was_open = recordings::is_open(recorded.status) && value.place == "/status";
    const bool left_out = !replayed.raw && value.place.starts_with("/scaling");
    if (!was_open && !left_out)
      return value.place + ": " + excerpt(value.a.dump()) + " and " + excerpt(value.b.dump());
  }
  // A status that was open stands in the report, too.
  auto asked = recorded;
  if (recordings::is_open(asked.status)) asked.status = replayed.status;
  if (report_of(asked) != report_of(replayed)) return "the report";
  return std::nullopt;
}

}  // namespace ferrobench::server
