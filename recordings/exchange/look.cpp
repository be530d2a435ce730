#include "recordings/exchange/look.h"

#include <algorithm>

#include "base/fields.h"
#include "base/number_text.h"
#include "recordings/exchange/testers/number_rows.h"

namespace ferrobench::recordings {

nlohmann::json what_columns_hold(std::string_view text, const DelimitedText& table) {
  constexpr std::size_t rows = 1000, most_columns = 20;
  if (!table.names().empty() || table.columns() == 0) return nullptr;
  struct Column {
    bool numbers = true, rises = true;
    std::size_t count = 0;
    double first = 0, last = 0, low = 0, high = 0;
    std::string text;
  };
  std::vector<Column> columns(std::min(table.columns(), most_columns));
  std::vector<Problem> ignored;
  DelimitedText again(text, {.delimiter = table.delimiter(), .decimal_comma = {}, .names = false}, "",
                      ignored, 1);
  for (std::size_t row = 0; row < rows && again.next(); ++row)
    for (std::size_t i = 0; i < columns.size(); ++i) {
      auto& c = columns[i];
      const auto value = number_of(again.text(i));
      if (c.text.empty()) c.text = excerpt(again.text(i));
      c.numbers = c.numbers && value;
      if (!value) continue;
      c.rises = c.rises && (c.count == 0 || *value > c.last);
      c.low = c.count == 0 ? *value : std::min(c.low, *value);
      c.high = c.count == 0 ? *value : std::max(c.high, *value);
      if (c.count++ == 0) c.first = *value;
      c.last = *value;
    }
  auto out = nlohmann::json::array();
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const auto& c = columns[i];
    auto what = "column " + std::to_string(i + 1);
    if (!c.numbers || c.count == 0)
      what += c.text.empty() ? " is empty" : " holds \"" + c.text + "\"";
    else if (c.rises && c.count > 1)
      what += " rises from " + number_text(c.first) + " to " + number_text(c.last);
    else
      what += " lies within " + number_text(c.low) + " and " + number_text(c.high);
    out.push_back(std::move(what));
  }
  return out;
}

}  // namespace ferrobench::recordings
