#include "recordings/tables/published.h"

#include <algorithm>
#include <array>
#include <optional>
#include <stdexcept>

#include "base/delimited_text.h"

namespace ferrobench::published {  // the files of this folder, see ferrobench_embed()
std::optional<std::string_view> embedded(std::string_view name);
std::vector<std::string_view> embedded_names();
}  // namespace ferrobench::published

namespace ferrobench::recordings {
namespace {

constexpr std::string_view file_begin = "tables/table_", file_end = ".csv";

std::string file_of(const std::string& table, std::string_view ending) {
  auto number = table;
  std::ranges::replace(number, '.', '_');
  return std::string(file_begin).append(number).append(ending);
}

std::string_view content(const std::string& file) {
  const auto text = published::embedded(file);
  if (!text) throw std::logic_error("a published table has no file " + file);
  return *text;
}

template <class List>
const auto* find_column(const List& list, std::string_view column) {
  const auto found =
      std::ranges::find(list, column, [](const auto& c) -> std::string_view { return c.column; });
  return found == list.end() ? nullptr : &*found;
}

std::vector<PublishedCell> read_cells(std::string_view text, const std::string& file,
                                      const TableDescription& description) {
  std::vector<PublishedCell> out;
  std::vector<Problem> problems;
  DelimitedText rows(text, {}, file, problems, 1);
  const auto& columns = rows.names();
  while (rows.next()) {
    std::vector<std::pair<std::string, double>> keys;
    bool doubtful = false;
    for (std::size_t i = 0; i < columns.size(); ++i) {
      if (find_column(description.keys, columns[i]) != nullptr) keys.emplace_back(columns[i], rows.number(i));
      if (columns[i] == "doubtful") doubtful = rows.number(i) != 0;
    }
    for (std::size_t i = 0; i < columns.size(); ++i)
      if (const auto* q = find_column(description.quantities, columns[i]))
        out.push_back({columns[i], keys, rows.number(i), doubtful,
                       doubtful ? q->uncertainty_if_doubtful.value_or(q->uncertainty) : q->uncertainty});
  }
  if (!problems.empty()) throw std::logic_error("a published table is broken");
  return out;
}

}  // namespace

std::span<const std::pair<KeyKind, std::string_view>> enum_names(KeyKind) {
  static constexpr std::array<std::pair<KeyKind, std::string_view>, 4> names{
      {{KeyKind::number, "number"},
       {KeyKind::prestress, "prestress"},
       {KeyKind::field, "field"},
       {KeyKind::rate, "rate"}}};
  return names;
}

std::span<const std::pair<MeasureKind, std::string_view>> enum_names(MeasureKind) {
  static constexpr std::array<std::pair<MeasureKind, std::string_view>, 2> names{
      {{MeasureKind::creep, "creep"}, {MeasureKind::stroke, "stroke"}}};
  return names;
}

std::span<const std::pair<MeasuredChannel, std::string_view>> enum_names(MeasuredChannel) {
  static constexpr std::array<std::pair<MeasuredChannel, std::string_view>, 2> names{
      {{MeasuredChannel::displacement, "displacement"}, {MeasuredChannel::charge, "charge"}}};
  return names;
}

double PublishedCell::key(std::string_view name) const {
  for (const auto& [key, value] : keys)
    if (key == name) return value;
  throw std::logic_error("a published table has no such key");
}

const TableQuantity& PublishedTable::quantity_of(const PublishedCell& cell) const {
  return *find_column(description.quantities, cell.quantity);
}

const TableKey* PublishedTable::run_key() const {
  for (const auto& key : description.keys)
    if (!key.setting.empty()) return &key;
  return nullptr;
}

std::vector<double> PublishedTable::run_values() const {
  std::vector<double> out;
  if (const auto* key = run_key())
    for (const auto& cell : cells)
      if (const double v = cell.key(key->column); std::ranges::find(out, v) == out.end()) out.push_back(v);
  return out;
}

std::vector<std::string> published_table_names() {
  std::vector<std::string> out;
  for (auto file : published::embedded_names()) {
    if (!file.starts_with(file_begin) || !file.ends_with(file_end)) continue;
    file.remove_prefix(file_begin.size());
    file.remove_suffix(file_end.size());
    std::ranges::replace(out.emplace_back(file), '_', '.');
  }
  std::ranges::sort(out);
  return out;
}

std::string published_tables_in_words() {
  const auto names = published_table_names();
  std::string out;
  for (std::size_t i = 0; i < names.size(); ++i)
    out.append(i == 0 ? "" : i + 1 == names.size() ? " or " : ", ").append(names[i]);
  return out;
}

PublishedTable published_table(const std::string& name) {
  const auto names = published_table_names();
  if (std::ranges::find(names, name) == names.end())
    throw Error(
        ErrorCode::not_found, "there is no such table",
        Problem{.path = "/table", .message = "is not a published table", .given = name, .allowed = names});
  const auto csv = file_of(name, file_end), json = file_of(name, ".json");
  PublishedTable table{.name = name, .title = "", .description = {}, .cells = {}};
  const auto text = content(csv);
  const auto first = text.substr(0, text.find('\n'));  // a comment that says what the table holds
  table.title = first.substr(first.find_first_not_of("# "));
  table.description = parse<TableDescription>(parse_json_text(content(json), ErrorCode::internal, json),
                                              ErrorCode::internal, json);
  table.cells = read_cells(text, csv, table.description);
  return table;
}

}  // namespace ferrobench::recordings
