#include "recordings/exchange/import_csv.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/delimited_text.h"
#include "base/headings.h"
#include "base/no_value.h"
#include "recordings/exchange/look.h"
#include "recordings/exchange/testers/overloads.h"

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
  Import(const CsvImport& import, std::size_t first_line, const Progress& progress)
      : import_(import),
        progress_(progress),
        table_(import.csv, dialect_of(import, first_line), "/csv", problems_, most_told) {}

  // `specimen` is settled on the way: a voltage is a field only with the thickness.
  Measured read(Specimen& specimen, Findings findings) {
    out_.findings = std::move(findings);
    const std::array<const std::optional<ColumnMap>*, 5> maps{
        &import_.command, &import_.field, &import_.charge, &import_.displacement, &import_.force};
    by_names_ = !import_.time && !import_.sample_rate && !import_.current && !import_.polarization &&
                std::ranges::none_of(maps, [](const auto* map) { return map->has_value(); });
    if (import_.time && import_.sample_rate)
      problems_.push_back({.path = "/sample_rate_Hz", .message = "goes without a column of the time"});
    const bool moves = map_of("displacement", import_.displacement).has_value();
    const auto earlier = problems_.size();
    specimen = settle_specimen(given_specimen(import_), {}, moves, out_.findings, problems_);
    const auto unknown = problems_.size() - earlier;
    thickness_ = specimen.layer_thickness;
    out_.area = specimen.area;
    constexpr std::array of_time{Quantity::time}, of_current{Quantity::current},
        of_polarization{Quantity::polarization};
    if (const auto map = map_of("time", import_.time))
      want("time", *map, of_time, out_.time);
    else if (!import_.sample_rate)
      problems_.push_back({.path = "/time",
                           .message = "is missing",
                           .given = what_columns_hold(import_.csv, table_),
                           .allowed = table_.names(),
                           .hint = "name the column of the time, or give sample_rate_Hz"});
    for (const auto channel : all_channels)
      if (const auto map = map_of(channel_name(channel), *maps.at(static_cast<std::size_t>(channel))))
        want(std::string(channel_name(channel)), *map, quantities_of(channel),
             out_.channel(channel).emplace());
    if (const auto map = map_of("current", import_.current))
      want("current", *map, of_current, out_.current.emplace());
    if (const auto map = map_of("polarization", import_.polarization))
      want("polarization", *map, of_polarization, out_.polarization.emplace());
    const bool measured = out_.current || out_.polarization ||
                          std::ranges::any_of(out_.channels, [](const auto& c) { return c.has_value(); });
    if (!measured && problems_.size() == unknown)
      problems_.push_back(
          {.path = "/csv", .message = "has no column of a channel", .allowed = table_.names()});
    if (unknown == 0) read_rows();
    if (unknown > 0 && problems_.size() == unknown)
      throw Error(ErrorCode::invalid_params, "the specimen must be known", std::move(problems_));
    if (!problems_.empty())
      throw Error(ErrorCode::bad_recording, "the text is not a recording", std::move(problems_));
    out_.place_of = [lines = std::move(lines_)](std::size_t row) {
      return "line " + std::to_string(row < lines.size() ? lines[row] : 0);
    };
    return std::move(out_);
  }

 private:
  static TextDialect dialect_of(const CsvImport& import, std::size_t first_line) {
    TextDialect out{.delimiter = {},
                    .decimal_comma = import.decimal_comma,
                    .names = import.header,
                    .first_line = first_line};
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
      return unit->quantity == Quantity::voltage ? unit->si / thickness_ : unit->si;
    problems_.push_back(
        {.path = "/" + what + (given ? "/unit" : "/column"),
         .message = (given ? "" : table_.column_name(at) + ": ") + "is not a unit that is understood here",
         .given = excerpt(text),
         .allowed = units_of(quantities),
         .hint = given ? "" : "give the column's unit, or a scale, in the map"});
    return 1;
  }

  void read_rows() {
    constexpr std::size_t rows_between_reports = 20000;
    auto& time = out_.time;
    Overloads overloads;
    while (table_.next()) {
      for (const auto& s : sources_) {
        const double written = table_.number(s.at, no_value_hint);
        s.values->push_back(s.offset +
                            s.scale * overloads.checked(written, table_.text(s.at), table_.line()));
      }
      if (import_.sample_rate) time.push_back(static_cast<double>(time.size()) / *import_.sample_rate);
      lines_.push_back(static_cast<std::uint32_t>(table_.line()));
      const auto rows = time.size();
      if (rows > 0 && (std::isnan(time.back()) || (rows > 1 && !(time.back() > time[rows - 2]))))
        table_.complain("the time does not rise", "");
      if (progress_ && rows % rows_between_reports == 0) progress_(table_.share_done());
    }
    overloads.tell(out_.findings);
    if (out_.time.size() < 2 && problems_.empty())
      problems_.push_back({.path = "/csv", .message = "has fewer than two rows"});
  }

  const CsvImport& import_;
  const Progress& progress_;
  std::vector<Problem> problems_;
  DelimitedText table_;
  bool by_names_ = false;
  double thickness_ = 1;
  std::vector<Source> sources_;
  std::vector<std::uint32_t> lines_;
  Measured out_{.time = {}};
};

}  // namespace

std::span<const std::pair<Delimiter, std::string_view>> enum_names(Delimiter) {
  static constexpr std::array<std::pair<Delimiter, std::string_view>, 4> names{{{Delimiter::comma, ","},
                                                                                {Delimiter::semicolon, ";"},
                                                                                {Delimiter::tab, "\t"},
                                                                                {Delimiter::space, " "}}};
  return names;
}

KnownSpecimen given_specimen(const CsvImport& import) {
  return {import.specimen, import.length, import.area, import.layer_thickness, import.layer_count};
}

Identity identity_of(const CsvImport& import) {
  return {import.title,
          import.source,
          {import.spring_stiffness, import.prestress},
          import.charge_is_absolute ? ChargeReference::absolute : ChargeReference::first_sample,
          given_specimen(import)};
}

Imported import_csv_table(const CsvImport& import, std::size_t first_line, Findings findings,
                          nlohmann::json device, const Progress& progress) {
  Specimen specimen;
  const bool is_testers = device.contains("header");
  auto measured = Import(import, first_line, progress).read(specimen, std::move(findings));
  measured.returns = is_testers;
  return recording_of(std::move(measured), specimen, identity_of(import), std::move(device));
}

Recording import_csv(const CsvImport& import) {
  return import_csv_table(import, 1, {}, nlohmann::json::object()).recording;
}

}  // namespace ferrobench::recordings
