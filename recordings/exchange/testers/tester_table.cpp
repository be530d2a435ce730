#include "recordings/exchange/testers/tester_table.h"

#include <algorithm>

#include "recordings/exchange/testers/lines.h"
#include "recordings/exchange/testers/number_rows.h"

namespace ferrobench::recordings {

std::size_t TesterTable::line_of(std::size_t row) const {
  const auto after = std::ranges::upper_bound(blocks, row);
  return first_line + row - (after == blocks.begin() ? 0 : *(after - 1));
}

std::optional<HeaderValue> TesterTable::find(std::string_view key) const {
  for (const auto* lines : {&header, &file_header})
    for (const auto& line : *lines)
      if (auto value = header_value(line, key)) return value;
  return std::nullopt;
}

const TesterColumn* TesterTable::column(std::string_view name) const {
  const auto found = std::ranges::find(columns, name, &TesterColumn::name);
  return found == columns.end() ? nullptr : &*found;
}

std::optional<HeaderValue> header_value(const HeaderLine& line, std::string_view key) {
  std::string_view rest = trimmed(line.text);
  if (!rest.starts_with(key)) return std::nullopt;
  rest = trimmed(rest.substr(key.size()));
  HeaderValue out{.text = {}, .unit = {}, .line = line.line};
  for (const std::string_view brackets : {"[]", "()"}) {
    const auto close = rest.find(brackets[1]);
    if (!rest.starts_with(brackets[0]) || close == std::string_view::npos) continue;
    out.unit = rest.substr(1, close - 1);
    rest = trimmed(rest.substr(close + 1));
    break;
  }
  if (!rest.starts_with(':')) return std::nullopt;
  out.text = trimmed(rest.substr(1));
  out.number = number_of(out.text);
  return out;
}

}  // namespace ferrobench::recordings
