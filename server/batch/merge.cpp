#include "server/batch/merge.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "recordings/analysis/statistics.h"
#include "recordings/format/version.h"
#include "recordings/hdf5/columns_file.h"
#include "recordings/reports/html_page.h"

namespace ferrobench::batch {

using nlohmann::json;
using recordings::Cell;
using recordings::Table;

namespace {

constexpr double normal_spread =
    1.4826;  // standard deviations of a normal distribution in its median distance
constexpr double outlier_spreads = 3.5;
constexpr std::size_t fewest = 5;  // numbers of which one can stand out

// What comes first in the merged table.
std::vector<std::string> leading_columns(Kind kind) {
  switch (kind) {
    case Kind::discover:
      return {
          "verdict", "effects",       "probability", "family", "probability_unknown", "probability_nothing",
          "share",   "share_held_out"};
    case Kind::fit:
      return {"cost_before", "cost_after"};
    case Kind::report:
      return {"recording"};
    case Kind::import:
      return {"recording", "duration", "samples", "findings", "warnings"};
  }
  return {};
}

std::string state_in_words(const json& result) {
  return result.is_null() ? "missing" : text_at(result, "state");
}

std::string error_in_words(const json& result) {
  if (result.is_null() || !result.contains("error")) return "";
  auto out = text_at(result.at("error"), "message");
  for (const auto& p : result.at("error").value("problems", json::array()))
    out += "; " + text_at(p, "path") + " " + text_at(p, "message");
  return out;
}

Cell cell_of(const json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_number_integer()) return value.get<std::int64_t>();
  if (value.is_number()) return recordings::cell(value.get<double>());
  return std::monostate{};
}

std::optional<double> number_in(const Cell& cell) {
  if (const auto* value = std::get_if<double>(&cell)) return *value;
  if (const auto* value = std::get_if<std::int64_t>(&cell)) return static_cast<double>(*value);
  return std::nullopt;
}

// What the work was like, and not the specimen: no item stands out by it.
bool is_of_the_work(const std::string& key) {
  return key.starts_with("probability") || key.starts_with("share") || key == "simulations";
}

// A column of numbers over the fleet; what only says how sure another one is, is none.
struct Numbers {
  std::size_t column = 0;
  std::vector<std::pair<double, std::size_t>> values;  // with their rows
  double median = 0, spread = 0;
};

std::vector<Numbers> numbers_of(const Table& table) {
  std::vector<Numbers> out;
  for (std::size_t c = 0; c < table.columns.size(); ++c) {
    const auto& key = table.columns[c].key;
    if (key.ends_with(".std") || key.ends_with(".low") || key.ends_with(".high")) continue;
    Numbers numbers;
    numbers.column = c;
    std::vector<double> values, distances;
    for (std::size_t row = 0; row < table.rows.size(); ++row)
      if (const auto value = number_in(table.rows[row][c])) {
        numbers.values.emplace_back(*value, row);
        values.push_back(*value);
      }
    if (values.empty()) continue;
    numbers.median = recordings::median(values);
    distances.reserve(values.size());
    for (const double value : values) distances.push_back(std::abs(value - numbers.median));
    numbers.spread = normal_spread * recordings::median(distances);
    out.push_back(std::move(numbers));
  }
  return out;
}

// "stack-017", and of which recording where an item has several rows.
std::string whose(const Table& table, std::size_t row) {
  auto out = std::get<std::string>(table.rows[row][0]);
  const auto recording = std::ranges::find(table.columns, "recording", &recordings::Column::key);
  if (recording != table.columns.end()) {
    const auto& name = table.rows[row][static_cast<std::size_t>(recording - table.columns.begin())];
    if (const auto* text = std::get_if<std::string>(&name)) out += ", " + *text;
  }
  return out;
}

// "a, b, c and 40 more"
std::string some_of(const std::vector<std::string>& names) {
  constexpr std::size_t most = 30;
  std::string out;
  for (std::size_t i = 0; i < std::min(most, names.size()); ++i) out += (i > 0 ? ", " : "") + names[i];
  if (names.size() > most) out += " and " + std::to_string(names.size() - most) + " more";
  return out;
}

Table empty_table(std::string key, std::string title, std::vector<recordings::Column> columns) {
  return {.key = std::move(key),
          .title = std::move(title),
          .columns = std::move(columns),
          .rows = {},
          .notes = {}};
}

Table short_table(const Table& merged, std::size_t columns) {
  auto out = merged;
  out.columns.resize(std::min(columns, out.columns.size()));
  for (auto& row : out.rows) row.resize(out.columns.size());
  out.notes.clear();
  return out;
}

void check_commits(const std::vector<ItemResult>& results) {
  std::map<std::string, std::vector<std::string>> by_commit;
  for (const auto& [id, result] : results)
    if (result.is_object() && result.at("asked").is_object())
      by_commit[text_at(result.at("asked"), "commit") + " (" + text_at(result.at("asked"), "software") + ")"]
          .push_back(id);
  if (by_commit.size() < 2) return;
  std::vector<Problem> problems;
  problems.reserve(by_commit.size());
  for (const auto& [commit, ids] : by_commit)
    problems.push_back(
        {.message = std::to_string(ids.size()) + " by commit " + commit, .given = some_of(ids)});
  throw Error(ErrorCode::bad_state, "results of different commits of ferrobench are not put together",
              std::move(problems));
}

std::string page(Kind kind, const std::vector<ItemResult>& results, const Table& merged) {
  std::size_t done = 0;
  for (const auto& r : results) done += state_in_words(r.result) == "done" ? 1 : 0;
  std::string body = "<dl>\n";
  const auto fact = [&body](const std::string& name, const std::string& value) {
    body += "<dt>" + recordings::escape_html(name) + "</dt><dd>" + recordings::escape_html(value) + "</dd>\n";
  };
  fact("what", "ferrobench batch " + kind_name(kind));
  fact("items", std::to_string(results.size()));
  fact("done", std::to_string(done));
  fact("commit", std::string(recordings::software_commit()));
  body += "</dl>\n<p><a href=\"table.csv\">table.csv</a>, <a href=\"table.h5\">table.h5</a>: all of it</p>\n";
  if (done < results.size()) {
    auto table = empty_table("failed", "Failed or missing",
                             {{"id", "item", ""}, {"state", "state", ""}, {"error", "why", ""}});
    for (const auto& [id, result] : results)
      if (state_in_words(result) != "done")
        table.rows.push_back({id, state_in_words(result), error_in_words(result)});
    table.notes = {"The same command again does these, and nothing else."};
    body += to_html(table);
  }
  if (kind == Kind::discover) body += to_html(effects_table(results));
  const auto outliers = outlier_table(merged);
  body += to_html(outliers) + to_html(fleet_table(merged));
  body += to_html(short_table(merged, 3 + leading_columns(kind).size()));
  // Pages of items that have one.
  body += "<section><h2>Pages</h2>\n<p>";
  for (const auto& [id, result] : results) {
    if (!result.is_object() || !result.contains("products")) continue;
    for (const auto& product : result.at("products")) {
      const auto name = product.get<std::string>();
      if (!name.ends_with(".html")) continue;
      const auto shown = name == "report.html" ? id : id + ": " + name.substr(0, name.size() - 5);
      body += "<a href=\"items/" + recordings::escape_html(id) + "/";
      for (const char c : name) {  // of a file, which may be called anything
        static constexpr std::string_view digits = "0123456789ABCDEF";
        const auto byte = static_cast<unsigned char>(c);
        if (std::isalnum(byte) != 0 || std::string_view("._-").find(c) != std::string_view::npos)
          body += c;
        else
          body.append("%").append(1, digits[byte >> 4]).append(1, digits[byte & 15]);
      }
      body += "\">" + recordings::escape_html(shown) + "</a>\n";
    }
  }
  body += "</p></section>\n";
  return recordings::html_frame("Batch of " + std::to_string(results.size()) + ": " + kind_name(kind), body);
}

}  // namespace

Table merged_table(Kind kind, const std::vector<ItemResult>& results) {
  auto out =
      empty_table("items", "Items", {{"id", "item", ""}, {"state", "state", ""}, {"error", "error", ""}});
  std::set<std::string> others;
  std::map<std::string, std::string> units;
  const auto leading = leading_columns(kind);
  for (const auto& [id, result] : results) {
    if (state_in_words(result) != "done") continue;
    for (const auto& row : result.at("rows"))
      for (const auto& [key, value] : row.items())
        if (std::ranges::find(leading, key) == leading.end()) others.insert(key);
    for (const auto& [key, unit] : result.at("units").items()) units[key] = unit;
  }
  std::vector<std::string> keys = leading;
  keys.insert(keys.end(), others.begin(), others.end());
  for (const auto& key : keys) {
    const auto unit = units.find(key);
    auto title = key;
    std::ranges::replace(title, '_', ' ');
    out.columns.push_back({key, title, unit == units.end() || unit->second == "1" ? "" : unit->second});
  }
  for (const auto& [id, result] : results) {
    const auto state = state_in_words(result);
    const auto rows =
        state == "done" && !result.at("rows").empty() ? result.at("rows") : json::array({json::object()});
    for (const auto& row : rows) {
      std::vector<Cell> cells{id, state, error_in_words(result)};
      for (const auto& key : keys) cells.push_back(row.contains(key) ? cell_of(row.at(key)) : Cell{});
      out.rows.push_back(std::move(cells));
    }
  }
  return out;
}

Table fleet_table(const Table& merged) {
  auto out = empty_table("fleet", "Over the fleet",
                         {{"figure", "figure", ""},
                          {"unit", "unit", ""},
                          {"count", "numbers", ""},
                          {"median", "median", ""},
                          {"spread", "spread", ""},
                          {"lowest", "lowest", ""},
                          {"lowest_of", "of", ""},
                          {"highest", "highest", ""},
                          {"highest_of", "of", ""}});
  for (const auto& n : numbers_of(merged)) {
    const auto [low, high] =
        std::ranges::minmax_element(n.values, {}, &std::pair<double, std::size_t>::first);
    out.rows.push_back({merged.columns[n.column].title, merged.columns[n.column].unit,
                        static_cast<std::int64_t>(n.values.size()), n.median, n.spread, low->first,
                        whose(merged, low->second), high->first, whose(merged, high->second)});
  }
  out.notes = {
      "The spread is 1.4826 times the median distance from the median: the standard deviation, were they "
      "normally "
      "distributed."};
  return out;
}

Table outlier_table(const Table& merged) {
  auto out = empty_table("outliers", "Outliers",
                         {{"item", "item", ""},
                          {"figure", "figure", ""},
                          {"value", "value", ""},
                          {"unit", "unit", ""},
                          {"median", "median of all", ""},
                          {"spreads", "spreads away", ""}});
  for (const auto& n : numbers_of(merged)) {
    if (n.values.size() < fewest || !(n.spread > 0) || is_of_the_work(merged.columns[n.column].key)) continue;
    for (const auto& [value, row] : n.values)
      if (const double away = (value - n.median) / n.spread; std::abs(away) > outlier_spreads)
        out.rows.push_back({whose(merged, row), merged.columns[n.column].title, value,
                            merged.columns[n.column].unit, n.median, away});
  }
  std::ranges::stable_sort(out.rows, std::greater<>(),
                           [](const auto& row) { return std::abs(std::get<double>(row.back())); });
  out.notes = {
      "Further from the median of all than 3.5 spreads, of figures that at least 5 items have and that "
      "differ in more "
      "than half of them."};
  return out;
}

Table effects_table(const std::vector<ItemResult>& results) {
  std::map<std::string, std::vector<std::string>> named, rivals;
  for (const auto& [id, result] : results) {
    if (state_in_words(result) != "done") continue;
    const auto& found = result.at("result");
    const auto verdict = text_at(found, "verdict");
    if (verdict != "named" && verdict != "ambiguous") {
      named[verdict == "unknown" ? "(unknown)" : "(nothing missing)"].push_back(id);
      continue;
    }
    std::set<std::string> first, other;
    const auto& explanations = found.at("explanations");
    for (std::size_t i = 0; i < explanations.size(); ++i)
      for (const auto& effect : explanations[i].at("effects"))
        (i == 0 ? first : other).insert(effect.at("id"));
    for (const auto& effect : first) named[effect].push_back(id);
    for (const auto& effect : other)
      if (!first.contains(effect)) rivals[effect].push_back(id);
  }
  for (const auto& [effect, ids] : rivals) named[effect];
  auto out = empty_table("effects", "What is missing, and where",
                         {{"effect", "effect", ""},
                          {"count", "named in", ""},
                          {"items", "items", ""},
                          {"rival_in", "also possible in", ""}});
  for (const auto& [effect, ids] : named) {
    auto shown = effect;
    std::ranges::replace(shown, '_', ' ');
    out.rows.push_back({shown, static_cast<std::int64_t>(ids.size()), some_of(ids), some_of(rivals[effect])});
  }
  std::ranges::stable_sort(out.rows, std::greater<>(),
                           [](const auto& row) { return std::get<std::int64_t>(row[1]); });
  return out;
}

void put_merged(Kind kind, const std::vector<ItemResult>& results, const BatchFolder& folder) {
  check_commits(results);
  const auto table = merged_table(kind, results);
  put_text(folder.path() / "table.csv", to_csv(table));
  std::vector<recordings::FileColumn> columns;
  for (std::size_t c = 0; c < table.columns.size(); ++c) {
    const bool text = std::ranges::any_of(
        table.rows, [c](const auto& row) { return std::holds_alternative<std::string>(row[c]); });
    auto name = table.columns[c].key;
    std::ranges::replace(name, '/', '_');
    recordings::FileColumn column{name, table.columns[c].unit, {}};
    if (text) {
      auto& values = column.values.emplace<std::vector<std::string>>();
      for (const auto& row : table.rows) {
        const auto* value = std::get_if<std::string>(&row[c]);
        values.push_back(value != nullptr ? *value : "");
      }
    } else {
      auto& values = column.values.emplace<std::vector<double>>();
      for (const auto& row : table.rows) values.push_back(number_in(row[c]).value_or(NAN));
    }
    columns.push_back(std::move(column));
  }
  recordings::write_columns((folder.path() / "table.h5").string(), "ferrobench batch " + kind_name(kind),
                            columns);
  put_text(folder.path() / "index.html", page(kind, results, table));
}

}  // namespace ferrobench::batch
