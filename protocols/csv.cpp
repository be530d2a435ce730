#include "protocols/csv.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <utility>

#include "protocols/common/fields.h"

namespace ferrobench::protocols {
namespace {

constexpr std::string_view separators = ",; \t\r";

std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> cells;
  while (true) {
    const auto begin = line.find_first_not_of(separators);
    if (begin == std::string_view::npos) return cells;
    line.remove_prefix(begin);
    cells.push_back(line.substr(0, line.find_first_of(separators)));
    line.remove_prefix(cells.back().size());
  }
}

std::optional<double> number(std::string_view cell) {
  if (cell.starts_with('+')) cell.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (error != std::errc{} || end != cell.data() + cell.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

}  // namespace

std::vector<std::vector<double>> read_points(std::string_view text, const std::string& path,
                                             std::vector<Problem>& problems) {
  constexpr std::string_view byte_order_mark = "\xef\xbb\xbf";
  if (text.starts_with(byte_order_mark)) text.remove_prefix(byte_order_mark.size());
  std::vector<std::vector<double>> rows;
  bool names_allowed = true;
  for (std::size_t line_number = 1; !text.empty(); ++line_number) {
    const auto line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
    const auto cells = split(line.substr(0, line.find('#')));
    if (cells.empty()) continue;
    const bool first = std::exchange(names_allowed, false);
    const auto time = number(cells[0]);
    const auto level = cells.size() == 2 ? number(cells[1]) : std::nullopt;
    if (time && level) {
      rows.push_back({*time, *level});
    } else if (!first || time) {
      problems.push_back({.path = path,
                          .message = "line " + std::to_string(line_number) + " is not a time and a level",
                          .given = excerpt(line),
                          .allowed = "two numbers, split by a comma, semicolon, tab or space"});
      if (problems.size() >= max_problems) return rows;
    }
  }
  return rows;
}

}  // namespace ferrobench::protocols
