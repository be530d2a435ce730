// The one model of a report's table, and how it is rendered: as text, Markdown, CSV, JSON or an HTML
// fragment.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <variant>
#include <vector>

#include "recordings/analysis/uncertainty.h"

namespace ferrobench::recordings {

enum class Format { text, md, csv, json, html };
// "text", "md", "csv", "json", "html"; Error(invalid_params) otherwise.
Format format_from_name(const std::string& name);

// key: the column's name in JSON and CSV, with the unit in it ("stroke_um"). title: what people read
// ("stroke").
struct Column {
  std::string key;
  std::string title;
  std::string unit;  // "" for none
};

// Empty cells are values that could not be measured.
using Cell = std::variant<std::monostate, double, std::int64_t, std::string>;
Cell cell(std::optional<double> value);

// A cell with the standard uncertainty of its figure, in the column's unit; 0: none is stated.
struct Entry {
  // NOLINTBEGIN(google-explicit-constructor): a row is written as a list of them
  Entry(Cell cell);
  Entry(double value);
  Entry(std::int64_t value);
  Entry(std::string text);
  // NOLINTEND(google-explicit-constructor)
  // `unit`: of the column in the estimate's.
  Entry(const std::optional<Estimate>& estimate, double unit);

  Cell cell;
  double uncertainty = 0;
};

struct Table {
  std::string key;    // "stroke"
  std::string title;  // "Stroke per cycle"
  std::vector<Column> columns;
  std::vector<std::vector<Cell>> rows;
  std::vector<std::string> notes;  // how it was measured, below the table
  // Cells (row, column) that are made of samples which a converter cut off (clipped_cells.h), and where that
  // was.
  std::set<std::pair<std::size_t, std::size_t>> clipped = {};
  std::vector<std::string> cut_off = {};
  // Standard uncertainties of cells (row, column), in the column's unit (recordings/analysis/uncertainty.h).
  std::map<std::pair<std::size_t, std::size_t>, double> uncertainty = {};

  void add(const std::vector<Entry>& row);
};

// "41.59(4)": the figure with its standard uncertainty in units of its last digit; two digits of that where
// the first is 1 or 2. What JSON and CSV call KEY_uncertainty.
std::string with_uncertainty(double value, double uncertainty);

// Text, Markdown and HTML show figures as with_uncertainty() does, and say so below.
std::string to_text(const Table& table);
std::string to_markdown(const Table& table);
// A heading line of keys, then rows; numbers in full. A column with uncertainties is followed by
// KEY_uncertainty. Where cells are clipped, a last column "clipped" has their keys.
std::string to_csv(const Table& table);
// {title, columns: [{key, title, unit}], rows: [{key: value}], notes}, columns in order; a row with clipped
// cells has their keys as "clipped": [key]. A column with uncertainties also says "uncertainty", under which
// key a row has them, null where there is none.
nlohmann::json to_json(const Table& table);
std::string to_html(const Table& table);  // <section> with heading, table and notes

std::string escape_html(std::string_view text);
std::string escape_markdown(std::string_view text);
std::string escape_csv(std::string_view text);

}  // namespace ferrobench::recordings
