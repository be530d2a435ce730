#include "recordings/exchange/unread_columns.h"

#include <algorithm>

#include "base/headings.h"
#include "recordings/exchange/conversion/units_of_columns.h"

namespace ferrobench::recordings {
namespace {

std::string listed(const std::vector<std::string>& names) {
  constexpr std::size_t most = 20;  // a list that nobody reads helps nobody
  std::string out;
  for (std::size_t i = 0; i < std::min(names.size(), most); ++i) out += (i > 0 ? ", " : "") + names[i];
  return names.size() <= most ? out : out + " and " + std::to_string(names.size() - most) + " more";
}

}  // namespace

void UnreadColumns::add(std::size_t at, const std::string& heading) {
  columns_.push_back({.at = at, .heading = heading});
}

void UnreadColumns::take_row(DelimitedText& table, Overloads& overloads) {
  for (auto& c : columns_) {
    if (!c.numbers) continue;
    if (const auto value = table.number_if_any(c.at))
      c.values.push_back(overloads.checked(*value, table.text(c.at), table.line()));
    else
      c.numbers = false, c.values = {};
  }
}

void UnreadColumns::finish(Measured& m, bool of_tester) {
  std::vector<std::string> kept, left_out;
  TesterTable table;
  for (auto& c : columns_) {
    if (of_tester && (!c.numbers || c.values == m.time)) continue;
    if (!c.numbers) {
      left_out.push_back(c.heading);
      continue;
    }
    if (is_measured(c.values)) kept.push_back(c.heading);
    auto heading = read_heading(c.heading);
    table.columns.push_back({heading.name, heading.unit, std::move(c.values)});
  }
  if (!kept.empty())
    m.say("note", "columns not read as channels: " + listed(kept) +
                      "; they go along beside these, and a map makes a channel of one");
  if (!left_out.empty()) m.say("note", "columns without numbers are not read: " + listed(left_out));
  take_others(table, m);
}

}  // namespace ferrobench::recordings
