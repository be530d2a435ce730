#include "recordings/tables/published.h"

#include <cassert>
#include <charconv>
#include <optional>
#include <set>
#include <stdexcept>

#include "protocols/common/error.h"

namespace ferrobench::published {  // the files of this folder, see ferrobench_embed()
std::optional<std::string_view> embedded(std::string_view name);
}

namespace ferrobench::recordings {
namespace {

std::vector<std::string_view> split(std::string_view text, char by) {
  std::vector<std::string_view> out;
  for (;;) {
    const auto end = text.find(by);
    out.push_back(text.substr(0, end));
    if (end == std::string_view::npos) return out;
    text.remove_prefix(end + 1);
  }
}

double number(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size())
    throw std::logic_error("a published table is broken");
  return value;
}

bool is_key(std::string_view column) {
  static const std::set<std::string_view> keys{"hold", "field_kV_per_mm", "prestress_MPa", "rate_V_per_s"};
  return keys.contains(column);
}

}  // namespace

double PublishedCell::key(std::string_view name) const {
  for (const auto& [key, value] : keys)
    if (key == name) return value;
  throw std::logic_error("a published table has no such key");
}

std::vector<std::string> published_table_names() {
  return {"3.10", "3.11", "3.12", "3.13"};
}

PublishedTable published_table(const std::string& name) {
  const auto names = published_table_names();
  std::string file = "tables/table_" + name + ".csv";
  std::ranges::replace(file.begin(), file.end() - 4, '.', '_');
  const auto text = published::embedded(file);
  if (std::ranges::find(names, name) == names.end() || !text)
    throw Error(
        ErrorCode::not_found, "there is no such table",
        Problem{.path = "/table", .message = "is not a published table", .given = name, .allowed = names});
  PublishedTable table{.name = name, .title = "", .cells = {}};
  std::vector<std::string_view> columns;
  for (const auto line : split(*text, '\n')) {
    if (line.empty()) continue;
    if (line.starts_with('#')) {  // the first comment says what the table holds
      if (table.title.empty()) table.title = line.substr(line.find_first_not_of("# "));
      continue;
    }
    const auto fields = split(line, ',');
    if (columns.empty()) {
      columns = fields;
      continue;
    }
    std::vector<std::pair<std::string, double>> keys;
    bool doubtful = false;
    for (std::size_t i = 0; i < columns.size(); ++i) {
      if (is_key(columns[i])) keys.emplace_back(columns[i], number(fields.at(i)));
      if (columns[i] == "doubtful") doubtful = number(fields.at(i)) != 0;
    }
    for (std::size_t i = 0; i < columns.size(); ++i)
      if (!is_key(columns[i]) && columns[i] != "doubtful")
        table.cells.push_back({std::string(columns[i]), keys, number(fields.at(i)), doubtful});
  }
  return table;
}

}  // namespace ferrobench::recordings
