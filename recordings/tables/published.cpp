#include "recordings/tables/published.h"

#include <algorithm>
#include <optional>
#include <set>
#include <stdexcept>

#include "base/delimited_text.h"

namespace ferrobench::published {  // the files of this folder, see ferrobench_embed()
std::optional<std::string_view> embedded(std::string_view name);
}

namespace ferrobench::recordings {
namespace {

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
  const auto first = text->substr(0, text->find('\n'));  // a comment that says what the table holds
  table.title = first.substr(first.find_first_not_of("# "));
  std::vector<Problem> problems;
  DelimitedText rows(*text, {}, file, problems, 1);
  const auto& columns = rows.names();
  while (rows.next()) {
    std::vector<std::pair<std::string, double>> keys;
    bool doubtful = false;
    for (std::size_t i = 0; i < columns.size(); ++i) {
      if (is_key(columns[i])) keys.emplace_back(columns[i], rows.number(i));
      if (columns[i] == "doubtful") doubtful = rows.number(i) != 0;
    }
    for (std::size_t i = 0; i < columns.size(); ++i)
      if (!is_key(columns[i]) && columns[i] != "doubtful")
        table.cells.push_back({columns[i], keys, rows.number(i), doubtful});
  }
  if (!problems.empty()) throw std::logic_error("a published table is broken");
  return table;
}

}  // namespace ferrobench::recordings
