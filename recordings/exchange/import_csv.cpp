#include "recordings/exchange/import_csv.h"

#include <algorithm>
#include <boost/uuid/random_generator.hpp>
#include <boost/uuid/uuid_io.hpp>
#include <cmath>
#include <optional>

#include "base/delimited_text.h"
#include "base/headings.h"
#include "recordings/analysis/segments.h"
#include "recordings/format/iso_time.h"

namespace ferrobench::recordings {
namespace {

constexpr std::size_t most_told = 20;  // problems

std::vector<Quantity> quantities_of(Channel channel) {
  switch (channel) {
    case Channel::charge:
      return {Quantity::charge};
    case Channel::displacement:
      return {Quantity::displacement};
    case Channel::force:
      return {Quantity::force};
    default:
      return {Quantity::field, Quantity::voltage};
  }
}

std::string lowered(std::string text) {
  std::ranges::transform(text, text.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c; });
  return text;
}

// A column that is read, and where its values go.
struct Source {
  std::size_t at = 0;
  double scale = 1, offset = 0;
  std::vector<double>* values = nullptr;
};

class Import {
 public:
  explicit Import(const CsvImport& import)
      : import_(import), table_(import.csv, dialect_of(import), "/csv", problems_, most_told) {}

  Recording read() {
    by_names_ = !import_.time && !import_.sample_rate;
    const std::array<const std::optional<ColumnMap>*, 5> maps{
        &import_.command, &import_.field, &import_.charge, &import_.displacement, &import_.force};
    for (const auto* map : maps) by_names_ = by_names_ && !*map;
    if (import_.time && import_.sample_rate)
      problems_.push_back({.path = "/sample_rate_Hz", .message = "goes without a column of the time"});
    const std::array time_units{Quantity::time};
    if (const auto map = map_of("time", import_.time))
      want("time", *map, time_units, out_.time);
    else if (!import_.sample_rate)
      problems_.push_back({.path = "/time",
                           .message = "is missing",
                           .allowed = table_.names(),
                           .hint = "name the column of the time, or give sample_rate_Hz"});
    for (const auto channel : all_channels)
      if (const auto map = map_of(channel_name(channel), *maps.at(static_cast<std::size_t>(channel))))
        want(std::string(channel_name(channel)), *map, quantities_of(channel), out_.set(channel));
    const bool measured = std::ranges::any_of(all_channels, [this](Channel c) { return out_.has(c); });
    if (!measured && problems_.empty())
      problems_.push_back(
          {.path = "/csv", .message = "has no column of a channel", .allowed = table_.names()});
    read_rows();
    if (!problems_.empty())
      throw Error(ErrorCode::bad_recording, "the text is not a recording", std::move(problems_));
    return std::move(out_);
  }

 private:
  static TextDialect dialect_of(const CsvImport& import) {
    TextDialect out{.delimiter = {}, .decimal_comma = import.decimal_comma, .names = import.header};
    if (import.delimiter)
      for (const auto& [delimiter, text] : enum_names(Delimiter{}))
        if (delimiter == *import.delimiter) out.delimiter = text[0];
    return out;
  }

  // As given, or the column of that name where nothing was given at all.
  std::optional<ColumnMap> map_of(std::string_view what, const std::optional<ColumnMap>& given) const {
    if (!by_names_) return given;
    for (const auto& name : table_.names())
      if (lowered(read_heading(name).name) == what) return ColumnMap{.column = name};
    return std::nullopt;
  }

  void want(const std::string& what, const ColumnMap& map, std::span<const Quantity> quantities,
            std::vector<double>& values) {
    const auto at = column_of(what, map);
    if (!at) return;
    sources_.push_back({.at = *at,
                        .scale = unit_of(what, map, *at, quantities) * map.scale.value_or(1),
                        .offset = map.offset,
                        .values = &values});
  }

  std::optional<std::size_t> column_of(const std::string& what, const ColumnMap& map) {
    const auto& names = table_.names();
    if (map.number.has_value() != map.column.empty()) {
      problems_.push_back({.path = "/" + what, .message = "wants either a column's name or its number"});
    } else if (map.number) {
      if (*map.number <= static_cast<std::int64_t>(table_.columns()))
        return static_cast<std::size_t>(*map.number - 1);
      problems_.push_back({.path = "/" + what + "/number",
                           .message = "is beyond the last column",
                           .given = *map.number,
                           .allowed = table_.columns()});
    } else if (const auto found = std::ranges::find(names, map.column); found == names.end()) {
      problems_.push_back({.path = "/" + what + "/column",
                           .message = names.empty() ? "has no meaning: the first row holds no names"
                                                    : "is not in the first line",
                           .given = excerpt(map.column),
                           .allowed = names.empty() ? nlohmann::json() : nlohmann::json(names),
                           .hint = names.empty() ? "give the column's number" : ""});
    } else if (std::ranges::count(names, map.column) > 1) {
      problems_.push_back({.path = "/" + what + "/column",
                           .message = "stands in the first line more than once",
                           .given = excerpt(map.column),
                           .hint = "give the column's number"});
    } else {
      return static_cast<std::size_t>(found - names.begin());
    }
    return std::nullopt;
  }

  // SI units in one of what is written.
  double unit_of(const std::string& what, const ColumnMap& map, std::size_t at,
                 std::span<const Quantity> quantities) {
    const bool given = !map.unit.empty();
    if (!given && (map.scale || table_.names().empty())) return 1;
    const auto text = given ? map.unit : read_heading(table_.names()[at]).unit;
    if (text.empty()) return 1;
    if (const auto* unit = find_unit(text, quantities))
      return unit->quantity == Quantity::voltage ? unit->si / import_.layer_thickness : unit->si;
    problems_.push_back(
        {.path = "/" + what + (given ? "/unit" : "/column"),
         .message = (given ? "" : table_.column_name(at) + ": ") + "is not a unit that is understood here",
         .given = excerpt(text),
         .allowed = units_of(quantities),
         .hint = given ? "" : "give the column's unit, or a scale, in the map"});
    return 1;
  }

  void read_rows() {
    auto& time = out_.time;
    while (table_.next()) {
      for (const auto& s : sources_) s.values->push_back(s.offset + s.scale * table_.number(s.at));
      if (import_.sample_rate) time.push_back(static_cast<double>(time.size()) / *import_.sample_rate);
      const auto rows = time.size();
      if (rows > 0 && (std::isnan(time.back()) || (rows > 1 && !(time.back() > time[rows - 2]))))
        table_.complain("the time does not rise", "");
    }
    if (out_.time.size() < 2 && problems_.empty())
      problems_.push_back({.path = "/csv", .message = "has fewer than two rows"});
  }

  const CsvImport& import_;
  std::vector<Problem> problems_;
  DelimitedText table_;
  bool by_names_ = false;
  std::vector<Source> sources_;
  Recording out_;
};

}  // namespace

std::span<const std::pair<Delimiter, std::string_view>> enum_names(Delimiter) {
  static constexpr std::array<std::pair<Delimiter, std::string_view>, 4> names{{{Delimiter::comma, ","},
                                                                                {Delimiter::semicolon, ";"},
                                                                                {Delimiter::tab, "\t"},
                                                                                {Delimiter::space, " "}}};
  return names;
}

Recording import_csv(const CsvImport& import) {
  auto r = Import(import).read();
  auto& h = r.header;
  h.title = import.title;
  h.start_time = iso_now();
  h.entry_identifier = to_string(boost::uuids::random_generator()());
  h.device = {{"driver", "import"}, {"source", import.source}};
  h.specimen = {import.specimen, import.length, import.area, import.layer_thickness, import.layer_count};
  h.load = {import.spring_stiffness, import.prestress};
  h.charge_reference = import.charge_is_absolute ? ChargeReference::absolute : ChargeReference::first_sample;
  r.segments = infer_segments(r);
  r.end_time = iso_after(h.start_time, r.time.back() - r.time.front()).value_or(h.start_time);
  return r;
}

}  // namespace ferrobench::recordings
