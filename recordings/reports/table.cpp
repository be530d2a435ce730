#include "recordings/reports/table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>

#include "base/error.h"
#include "base/number_text.h"
#include "base/shown_unit.h"
#include "base/visible.h"

namespace ferrobench::recordings {
namespace {

std::string heading(const Column& column) {
  return column.unit.empty() ? column.title : column.title + " [" + shown_unit(column.unit) + "]";
}

std::string shown(const Cell& cell) {
  if (const auto* number = std::get_if<double>(&cell)) return number_text(*number);
  if (const auto* whole = std::get_if<std::int64_t>(&cell)) return std::to_string(*whole);
  if (const auto* text = std::get_if<std::string>(&cell)) return *text;
  return "-";
}

// With as many digits as tell it from the one before and after: late in a recording, four are not enough.
std::string start_text(const Table& table, std::size_t row, std::size_t column) {
  const double start = std::get<double>(table.rows[row][column]);
  double nearest = INFINITY;
  for (const auto other : {row - 1, row + 1})
    if (const auto* beside =
            other < table.rows.size() ? std::get_if<double>(&table.rows[other][column]) : nullptr)
      if (*beside != start && std::abs(*beside - start) < std::abs(nearest - start)) nearest = *beside;
  if (std::isinf(nearest)) return number_text(start);
  return start < nearest ? interval_text(start, nearest).first : interval_text(nearest, start).second;
}

std::string shown(const Table& table, std::size_t row, std::size_t column) {
  if (table.columns[column].key == "start_s" && std::holds_alternative<double>(table.rows[row][column]))
    return start_text(table, row, column);
  const auto known = table.uncertainty.find({row, column});
  const auto* number = std::get_if<double>(&table.rows[row][column]);
  const auto text = known != table.uncertainty.end() && number != nullptr
                        ? with_uncertainty(*number, known->second)
                        : shown(table.rows[row][column]);
  return text + (table.clipped.contains({row, column}) ? " !" : "");
}

std::string uncertainty_key(const Column& column) {
  return column.key + "_uncertainty";
}

bool has_uncertainty(const Table& table, std::size_t column) {
  return std::ranges::any_of(table.uncertainty, [column](const auto& u) { return u.first.second == column; });
}

std::optional<double> uncertainty_of(const Table& table, std::size_t row, std::size_t column) {
  const auto found = table.uncertainty.find({row, column});
  return found == table.uncertainty.end() ? std::nullopt : std::optional(found->second);
}

std::vector<std::string> clipped_keys(const Table& table, std::size_t row) {
  std::vector<std::string> out;
  for (std::size_t i = 0; i < table.columns.size(); ++i)
    if (table.clipped.contains({row, i})) out.push_back(table.columns[i].key);
  return out;
}

// What the table says below itself.
std::vector<std::string> all_notes(const Table& table) {
  auto out = table.notes;
  if (!table.uncertainty.empty())
    out.emplace_back(
        "In parentheses: the standard uncertainty in the last digits, from noise and local fits and, where "
        "the device states it, calibration; two times that covers the true value in 95 % (k = 2).");
  if (table.clipped.empty()) return out;
  std::string where;
  for (const auto& text : table.cut_off) where += (where.empty() ? "" : "; ") + text;
  out.push_back(
      "! is no measured value: samples that it is made of are at the end of the converter's range, and what "
      "was "
      "beyond is not known (" +
      where + ").");
  return out;
}

std::string in_full(const Cell& cell) {
  if (const auto* number = std::get_if<double>(&cell)) return number_in_full(*number);
  return std::holds_alternative<std::monostate>(cell) ? "" : shown(cell);
}

bool is_text(const Cell& cell) {
  return std::holds_alternative<std::string>(cell);
}

std::size_t width(std::string_view text) {  // in code points, which is near enough for aligning
  return static_cast<std::size_t>(std::ranges::count_if(text, [](char c) { return (c & 0xc0) != 0x80; }));
}

std::string padded(const std::string& text, std::size_t to, bool left) {
  const std::string space(to > width(text) ? to - width(text) : 0, ' ');
  return left ? text + space : space + text;
}

std::string replaced(std::string_view text, std::initializer_list<std::pair<char, std::string_view>> by) {
  std::string out;
  for (const char c : text) {
    const auto* found = std::ranges::find(by, c, &std::pair<char, std::string_view>::first);
    if (found == by.end()) {
      out += c;
    } else {
      out += found->second;
    }
  }
  return out;
}

// Labels stay on their line; messages of events do not fit on one.
const char* text_cell(const Cell& cell) {
  constexpr std::size_t longest_label = 40;
  return width(std::get<std::string>(cell)) > longest_label ? "<td class=\"text long\">"
                                                            : "<td class=\"text\">";
}

// Rows of aligned text between `edge`s.
std::string aligned(const Table& table, const std::function<std::string(std::string_view)>& clean,
                    std::string_view before, std::string_view between, std::string_view after, char rule) {
  std::vector<std::vector<std::string>> lines(1);
  for (const auto& column : table.columns) lines[0].push_back(clean(heading(column)));
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    lines.emplace_back();
    for (std::size_t i = 0; i < table.rows[row].size(); ++i)
      lines.back().push_back(clean(shown(table, row, i)));
  }
  std::vector<std::size_t> widths(table.columns.size(), 3);
  for (const auto& line : lines)
    for (std::size_t i = 0; i < line.size(); ++i) widths.at(i) = std::max(widths.at(i), width(line[i]));
  std::string out;
  for (std::size_t k = 0; k < lines.size(); ++k) {
    for (std::size_t i = 0; i < lines[k].size(); ++i) {
      const bool left = !table.rows.empty() && is_text(table.rows[k == 0 ? 0 : k - 1].at(i));
      out += i == 0 ? before : between;
      out += padded(lines[k][i], widths[i], left);
    }
    out += after;
    out += '\n';
    if (k > 0) continue;
    for (std::size_t i = 0; i < widths.size(); ++i) {
      out += i == 0 ? before : between;
      out += std::string(widths[i], rule);
    }
    out += after;
    out += '\n';
  }
  return out;
}

}  // namespace

Format format_from_name(const std::string& name) {
  constexpr std::array<std::pair<std::string_view, Format>, 5> names{{{"text", Format::text},
                                                                      {"md", Format::md},
                                                                      {"csv", Format::csv},
                                                                      {"json", Format::json},
                                                                      {"html", Format::html}}};
  for (const auto& [known, format] : names)
    if (known == name) return format;
  throw Error(ErrorCode::invalid_params, "there is no such format",
              Problem{.path = "/format",
                      .message = "is not a format",
                      .given = name,
                      .allowed = {"text", "md", "csv", "json", "html"}});
}

Entry::Entry(Cell c) : cell(std::move(c)) {}
Entry::Entry(double value) : cell(value) {}
Entry::Entry(std::int64_t value) : cell(value) {}
Entry::Entry(std::string text) : cell(std::move(text)) {}

Entry::Entry(const std::optional<Estimate>& estimate, double unit) {
  if (!estimate) return;
  cell = recordings::cell(estimate->value / unit);
  uncertainty = estimate->uncertainty() / unit;
}

void Table::add(const std::vector<Entry>& row) {
  auto& cells = rows.emplace_back();
  for (const auto& entry : row) {
    if (std::holds_alternative<double>(entry.cell) && entry.uncertainty > 0 &&
        std::isfinite(entry.uncertainty))
      uncertainty[{rows.size() - 1, cells.size()}] = entry.uncertainty;
    cells.push_back(entry.cell);
  }
}

std::string with_uncertainty(double value, double uncertainty) {
  if (!(uncertainty > 0) || !std::isfinite(uncertainty) || !std::isfinite(value)) return number_text(value);
  // The last digit stands for 10^place.
  int place = static_cast<int>(std::floor(std::log10(uncertainty)));
  if (uncertainty < 2.95 * std::pow(10, place)) --place;  // 2.95 is 3 in one digit
  // Beyond the digits of numbers without one, the power of ten follows: 1.234(5)e-06.
  const double size = std::max(std::abs(value), uncertainty), unit = std::pow(10, place);
  const int power = size >= 1e5 || size < 1e-3 ? static_cast<int>(std::floor(std::log10(size))) : 0;
  const auto rounded = [unit](double x) { return std::round(x / unit) * unit; };
  std::array<char, 400> text{};
  if (power == 0 && place >= 0) {  // 1230(50), not 123(5) tens
    (void)std::snprintf(text.data(), text.size(), "%.0f(%.0f)", rounded(value), rounded(uncertainty));
    return text.data();
  }
  (void)std::snprintf(text.data(), text.size(), "%.*f(%.0f)", power - place, value / std::pow(10, power),
                      uncertainty / unit);
  std::string out = text.data();
  if (power == 0) return out;
  (void)std::snprintf(text.data(), text.size(), "e%+03d", power);
  return out + text.data();
}

Cell cell(std::optional<double> value) {
  if (!value || !std::isfinite(*value)) return std::monostate{};
  return *value;
}

std::string escape_html(std::string_view text) {
  return replaced(visible(text),
                  {{'&', "&amp;"}, {'<', "&lt;"}, {'>', "&gt;"}, {'"', "&quot;"}, {'\'', "&#39;"}});
}

std::string escape_markdown(std::string_view text) {
  return replaced(visible(text),
                  {{'|', "\\|"}, {'<', "&lt;"}, {'>', "&gt;"}, {'`', "\\`"}, {'[', "\\["}, {']', "\\]"}});
}

std::string escape_csv(std::string_view text) {
  std::string line = visible(text);
  // A spreadsheet would run what starts like a formula.
  if (!line.empty() && std::string_view("=+-@").find(line[0]) != std::string_view::npos) line.insert(0, "'");
  if (line.find_first_of(",\"") == std::string::npos) return line;
  return '"' + replaced(line, {{'"', "\"\""}}) + '"';
}

std::string to_text(const Table& table) {
  std::string out = visible(table.title) + '\n' + aligned(table, visible, "  ", "  ", "", '-');
  for (const auto& note : all_notes(table)) out += "  " + visible(note) + '\n';
  return out;
}

std::string to_markdown(const Table& table) {
  std::string out =
      "## " + escape_markdown(table.title) + "\n\n" + aligned(table, escape_markdown, "| ", " | ", " |", '-');
  for (const auto& note : all_notes(table)) out += '\n' + escape_markdown(note) + '\n';
  return out;
}

std::string to_csv(const Table& table) {
  std::string out;
  for (std::size_t i = 0; i < table.columns.size(); ++i) {
    out += (i > 0 ? "," : "") + table.columns[i].key;
    if (has_uncertainty(table, i)) out += "," + uncertainty_key(table.columns[i]);
  }
  if (!table.clipped.empty()) out += ",clipped";
  out += '\n';
  for (std::size_t k = 0; k < table.rows.size(); ++k) {
    const auto& row = table.rows[k];
    for (std::size_t i = 0; i < row.size(); ++i) {
      if (i > 0) out += ',';
      out += is_text(row[i]) ? escape_csv(std::get<std::string>(row[i])) : in_full(row[i]);
      if (!has_uncertainty(table, i)) continue;
      const auto u = uncertainty_of(table, k, i);
      out += u ? "," + number_in_full(*u) : ",";
    }
    if (!table.clipped.empty()) out += ',';
    const auto keys = clipped_keys(table, k);
    for (std::size_t i = 0; i < keys.size(); ++i) out += (i > 0 ? " " : "") + keys[i];
    out += '\n';
  }
  return out;
}

nlohmann::json to_json(const Table& table) {
  auto rows = nlohmann::json::array();
  for (const auto& row : table.rows) {
    auto object = nlohmann::json::object();
    if (auto keys = clipped_keys(table, rows.size()); !keys.empty()) object["clipped"] = std::move(keys);
    for (std::size_t i = 0; i < row.size(); ++i)
      std::visit(
          [&](const auto& value) {
            if constexpr (std::is_same_v<std::decay_t<decltype(value)>, std::monostate>) {
              object[table.columns.at(i).key] = nullptr;
            } else {
              object[table.columns.at(i).key] = value;
            }
          },
          row[i]);
    for (std::size_t i = 0; i < table.columns.size(); ++i) {
      if (!has_uncertainty(table, i)) continue;
      const auto u = uncertainty_of(table, rows.size(), i);
      object[uncertainty_key(table.columns[i])] = u ? nlohmann::json(*u) : nlohmann::json();
    }
    rows.push_back(std::move(object));
  }
  auto columns = nlohmann::json::array();
  for (std::size_t i = 0; i < table.columns.size(); ++i) {
    const auto& column = table.columns[i];
    columns.push_back({{"key", column.key}, {"title", column.title}, {"unit", shown_unit(column.unit)}});
    if (has_uncertainty(table, i)) columns.back()["uncertainty"] = uncertainty_key(column);
  }
  return {{"title", table.title},
          {"columns", std::move(columns)},
          {"rows", std::move(rows)},
          {"notes", all_notes(table)}};
}

std::string to_html(const Table& table) {
  std::string out =
      "<section id=\"" + escape_html(table.key) + "\">\n<h2>" + escape_html(table.title) +
      "</h2>\n<div class=\"wide\" role=\"region\" tabindex=\"0\" aria-label=\"" +  // scrolled by keys, too
      escape_html(table.title) + "\"><table>\n<thead><tr>";
  for (const auto& column : table.columns) {
    out += "<th>" + escape_html(column.title);
    if (!column.unit.empty()) out += "<br><small>[" + escape_html(shown_unit(column.unit)) + "]</small>";
    out += "</th>";
  }
  out += "</tr></thead>\n<tbody>\n";
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    out += "<tr>";
    for (std::size_t i = 0; i < table.rows[row].size(); ++i)
      out += std::string(table.clipped.contains({row, i}) ? "<td class=\"clipped\">"
                         : is_text(table.rows[row][i])    ? text_cell(table.rows[row][i])
                                                          : "<td>") +
             escape_html(shown(table, row, i)) + "</td>";
    out += "</tr>\n";
  }
  out += "</tbody>\n</table></div>\n";
  for (const auto& note : all_notes(table)) out += "<p class=\"note\">" + escape_html(note) + "</p>\n";
  return out + "</section>\n";
}

}  // namespace ferrobench::recordings
