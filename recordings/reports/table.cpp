#include "recordings/reports/table.h"

#include <array>
#include <charconv>
#include <cmath>

#include "protocols/common/error.h"

namespace ferrobench::recordings {
namespace {

std::string heading(const Column& column) {
  return column.unit.empty() ? column.title : column.title + " [" + column.unit + "]";
}

std::string shown(const Cell& cell) {
  if (const auto* number = std::get_if<double>(&cell)) return number_text(*number);
  if (const auto* whole = std::get_if<std::int64_t>(&cell)) return std::to_string(*whole);
  if (const auto* text = std::get_if<std::string>(&cell)) return *text;
  return "-";
}

std::string in_full(const Cell& cell) {
  if (const auto* number = std::get_if<double>(&cell)) return number_in_full(*number);
  return std::holds_alternative<std::monostate>(cell) ? "" : shown(cell);
}

bool is_text(const Cell& cell) {
  return std::holds_alternative<std::string>(cell);
}

// Control characters would break a line or a terminal.
std::string one_line(std::string text) {
  for (auto& c : text)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';
  return text;
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

// Rows of aligned text between `edge`s.
std::string aligned(const Table& table, const std::function<std::string(const std::string&)>& clean,
                    std::string_view before, std::string_view between, std::string_view after, char rule) {
  std::vector<std::vector<std::string>> lines(1);
  for (const auto& column : table.columns) lines[0].push_back(clean(heading(column)));
  for (const auto& row : table.rows) {
    lines.emplace_back();
    for (const auto& item : row) lines.back().push_back(clean(shown(item)));
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

Cell cell(std::optional<double> value) {
  if (!value || !std::isfinite(*value)) return std::monostate{};
  return *value;
}

std::string number_text(double value) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value == 0 ? 0.0 : value,
                                 std::chars_format::general, 4);
  return {text.data(), end.ptr};
}

std::string number_in_full(double value) {
  std::array<char, 32> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

std::string escape_html(std::string_view text) {
  return replaced(one_line(std::string(text)),
                  {{'&', "&amp;"}, {'<', "&lt;"}, {'>', "&gt;"}, {'"', "&quot;"}, {'\'', "&#39;"}});
}

std::string escape_markdown(std::string_view text) {
  return replaced(one_line(std::string(text)),
                  {{'|', "\\|"}, {'<', "&lt;"}, {'>', "&gt;"}, {'`', "\\`"}, {'[', "\\["}, {']', "\\]"}});
}

std::string escape_csv(std::string_view text) {
  std::string line = one_line(std::string(text));
  // A spreadsheet would run what starts like a formula.
  if (!line.empty() && std::string_view("=+-@").find(line[0]) != std::string_view::npos) line.insert(0, "'");
  if (line.find_first_of(",\"") == std::string::npos) return line;
  return '"' + replaced(line, {{'"', "\"\""}}) + '"';
}

std::string to_text(const Table& table) {
  std::string out = one_line(table.title) + '\n' + aligned(table, one_line, "  ", "  ", "", '-');
  for (const auto& note : table.notes) out += "  " + one_line(note) + '\n';
  return out;
}

std::string to_markdown(const Table& table) {
  std::string out =
      "## " + escape_markdown(table.title) + "\n\n" + aligned(table, escape_markdown, "| ", " | ", " |", '-');
  for (const auto& note : table.notes) out += '\n' + escape_markdown(note) + '\n';
  return out;
}

std::string to_csv(const Table& table) {
  std::string out;
  for (std::size_t i = 0; i < table.columns.size(); ++i) out += (i > 0 ? "," : "") + table.columns[i].key;
  out += '\n';
  for (const auto& row : table.rows) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      if (i > 0) out += ',';
      out += is_text(row[i]) ? escape_csv(std::get<std::string>(row[i])) : in_full(row[i]);
    }
    out += '\n';
  }
  return out;
}

nlohmann::json to_json(const Table& table) {
  auto rows = nlohmann::json::array();
  for (const auto& row : table.rows) {
    auto object = nlohmann::json::object();
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
    rows.push_back(std::move(object));
  }
  return {{"title", table.title}, {"rows", std::move(rows)}, {"notes", table.notes}};
}

std::string to_html(const Table& table) {
  std::string out = "<section id=\"" + escape_html(table.key) + "\">\n<h2>" + escape_html(table.title) +
                    "</h2>\n<div class=\"wide\"><table>\n<thead><tr>";
  for (const auto& column : table.columns) {
    out += "<th>" + escape_html(column.title);
    if (!column.unit.empty()) out += "<br><small>" + escape_html(column.unit) + "</small>";
    out += "</th>";
  }
  out += "</tr></thead>\n<tbody>\n";
  for (const auto& row : table.rows) {
    out += "<tr>";
    for (const auto& item : row)
      out += (is_text(item) ? "<td class=\"text\">" : "<td>") + escape_html(shown(item)) + "</td>";
    out += "</tr>\n";
  }
  out += "</tbody>\n</table></div>\n";
  for (const auto& note : table.notes) out += "<p class=\"note\">" + escape_html(note) + "</p>\n";
  return out + "</section>\n";
}

}  // namespace ferrobench::recordings
