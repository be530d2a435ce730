#include "recordings/exchange/import_csv.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/delimited_text.h"
#include "base/headings.h"
#include "base/no_value.h"
#include "base/number_text.h"
#include "recordings/exchange/look.h"
#include "recordings/exchange/testers/lines.h"
#include "recordings/exchange/testers/overloads.h"
#include "recordings/exchange/unread_columns.h"

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

// What headings call a column, in small letters, the first that is there. A symbol, which has one letter,
// counts only with a unit that fits.
std::vector<std::string_view> names_of(std::string_view what) {
  if (what == "time") return {"time", "t"};
  if (what == "field") return {"field", "electric field", "voltage", "e", "u", "v"};
  if (what == "polarization") return {"polarization", "polarisation", "p"};
  if (what == "current") return {"current", "i"};
  if (what == "charge") return {"charge", "q"};
  if (what == "force") return {"force", "f"};
  return {what};
}

bool is_testers(const TableInFile& file) {
  return file.device.contains("header");
}

// A column that is read, and where its values go.
struct Source {
  std::size_t at = 0;
  double scale = 1, offset = 0;
  std::vector<double>* values = nullptr;
};

class Import {
 public:
  Import(const CsvImport& import, const TableInFile& file, const Progress& progress)
      : import_(import),
        file_(file),
        progress_(progress),
        table_(import.csv, dialect_of(import, file_.first_line), "/csv", problems_, most_told) {
    for (const auto& name : table_.names()) names_.push_back(to_utf8(name));
  }

  // `specimen` is settled on the way: a voltage is a field only with the thickness.
  Measured read(Specimen& specimen) {
    out_.findings = file_.findings;
    if (import_.time && import_.sample_rate)
      problems_.push_back({.path = "/sample_rate_Hz", .message = "goes without a column of the time"});
    constexpr std::array of_time{Quantity::time}, of_current{Quantity::current},
        of_polarization{Quantity::polarization};
    const auto maps = maps_of_channels();
    std::array<std::optional<ColumnMap>, 5> channels;
    for (const auto channel : all_channels) {
      const auto i = static_cast<std::size_t>(channel);
      channels.at(i) = map_of(channel_name(channel), *maps.at(i), quantities_of(channel));
    }
    const bool moves = channels.at(static_cast<std::size_t>(Channel::displacement)).has_value();
    const auto earlier = problems_.size();
    specimen = settle_specimen(given_specimen(import_), {}, moves, out_.findings, problems_);
    const auto unknown = problems_.size() - earlier;
    thickness_ = specimen.layer_thickness;
    out_.area = specimen.area;
    if (const auto map = import_.sample_rate ? import_.time : map_of("time", import_.time, of_time))
      want("time", *map, of_time, out_.time);
    else if (!import_.sample_rate)
      problems_.push_back({.path = "/time",
                           .message = "is missing",
                           .given = what_columns_hold(import_.csv, table_),
                           .allowed = names_,
                           .hint = "name the column of the time, or give sample_rate_Hz"});
    for (const auto channel : all_channels)
      if (const auto& map = channels.at(static_cast<std::size_t>(channel)))
        want(std::string(channel_name(channel)), *map, quantities_of(channel),
             out_.channel(channel).emplace());
    if (const auto map = map_of("current", import_.current, of_current))
      want("current", *map, of_current, out_.current.emplace());
    if (const auto map = map_of("polarization", import_.polarization, of_polarization))
      want("polarization", *map, of_polarization, out_.polarization.emplace());
    const bool measured = out_.current || out_.polarization ||
                          std::ranges::any_of(out_.channels, [](const auto& c) { return c.has_value(); });
    if (!measured && problems_.size() == unknown)
      problems_.push_back({.path = "/csv",
                           .message = "has no column of a channel",
                           .given = names_,
                           .hint = "headings may be field, voltage, charge, polarization, current, "
                                   "displacement and force with their units, as displacement [um]; a map "
                                   "names any other column"});
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

  std::array<const std::optional<ColumnMap>*, 5> maps_of_channels() const {
    return {&import_.command, &import_.field, &import_.charge, &import_.displacement, &import_.force};
  }
  std::vector<const std::optional<ColumnMap>*> all_maps() const {
    std::vector<const std::optional<ColumnMap>*> out{&import_.time, &import_.current, &import_.polarization};
    for (const auto* map : maps_of_channels()) out.push_back(map);
    return out;
  }

  // As given; the column that is not given is the one whose heading names it.
  std::optional<ColumnMap> map_of(std::string_view what, std::optional<ColumnMap> given,
                                  std::span<const Quantity> quantities) const {
    if (given && given->names_a_column()) return given;
    for (const auto name : names_of(what))
      for (std::size_t i = 0; i < names_.size(); ++i) {
        if (!is_headed(i, name, quantities)) continue;
        if (!given) given.emplace();
        given->column = names_[i];
        return given;
      }
    return given;
  }

  // A column of the map's is that alone; beside a map, one whose unit is not understood may be left unread.
  bool is_headed(std::size_t at, std::string_view name, std::span<const Quantity> quantities) const {
    const auto heading = read_heading(names_[at], quantities);
    if (lowered(heading.name) != name) return false;
    if (name.size() == 1 && find_unit(heading.unit, quantities) == nullptr) return false;
    const auto maps = all_maps();
    const bool others = std::ranges::any_of(maps, [&](const auto* map) {
      return *map && ((*map)->column == names_[at] || (*map)->number == static_cast<std::int64_t>(at + 1));
    });
    if (others) return false;
    const bool mapped =
        std::ranges::any_of(maps, [](const auto* map) { return *map && (*map)->names_a_column(); });
    return !mapped || heading.unit.empty() || find_unit(heading.unit, quantities) != nullptr;
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
    const auto& names = names_;
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
    const auto heading = at < names_.size() ? read_heading(names_[at], quantities) : Heading{};
    const auto known = file_.units.find(at < names_.size() ? names_[at] : "");
    const auto stated = known != file_.units.end() ? known->second : heading.unit;
    const auto text = given ? map.unit : stated;
    const auto* unit = find_unit(text, quantities);
    const auto refuse = [&](const char* key, const std::string& message, const std::string& hint) {
      problems_.push_back({.path = "/" + what + key,
                           .message = (given ? "" : table_.column_name(at) + ": ") + message,
                           .given = text.empty() ? nlohmann::json() : nlohmann::json(excerpt(text)),
                           .allowed = units_of(quantities),
                           .hint = hint});
      return 1.0;
    };
    if (!given && map.scale) {
      const bool si = unit == nullptr || (unit->si == 1 && unit->quantity != Quantity::voltage);
      return si ? 1
                : refuse("/scale",
                         "has a unit in its heading, and a scale alone makes SI units of what is written",
                         "give the unit, too: " + what + ".unit");
    }
    if (text.empty()) {
      const bool voltage = std::ranges::find(quantities, Quantity::voltage) != quantities.end() &&
                           names_a_voltage(heading.name);
      return voltage
                 ? refuse("/column", "is a voltage that says no unit",
                          "give the unit in the map, as " + what + ".unit, or in the heading: voltage [V]")
                 : 1;
    }
    if (unit != nullptr) return unit->quantity == Quantity::voltage ? unit->si / thickness_ : unit->si;
    return refuse(given ? "/unit" : "/column", "is not a unit that is understood here",
                  given ? "" : "give the column's unit, or a scale, in the map");
  }

  void read_rows() {
    constexpr std::size_t rows_between_reports = 20000;
    UnreadColumns unread;
    for (std::size_t i = 0; i < names_.size(); ++i)
      if (std::ranges::find(sources_, i, &Source::at) == sources_.end() && !names_[i].empty())
        unread.add(i, names_[i]);
    auto& time = out_.time;
    double last = -INFINITY;  // of the times that are there
    Overloads overloads;
    while (table_.next()) {
      if (lines_.empty() && holds_units()) break;
      const auto problems = problems_.size();
      for (const auto& s : sources_) {
        const double written = table_.number(s.at, no_value_hint);
        s.values->push_back(s.offset +
                            s.scale * overloads.checked(written, table_.text(s.at), table_.line()));
      }
      unread.take_row(table_, overloads);
      if (import_.sample_rate) time.push_back(static_cast<double>(time.size()) / *import_.sample_rate);
      lines_.push_back(static_cast<std::uint32_t>(table_.line()));
      const bool told = !time.empty() && std::isnan(time.back()) && problems_.size() > problems;
      if (!time.empty() && !told && !rises(time.back(), last)) break;
      const auto rows = time.size();
      if (progress_ && rows % rows_between_reports == 0) progress_(table_.share_done());
    }
    overloads.tell(out_.findings);
    if (!problems_.empty()) return;
    if (out_.time.size() < 2) problems_.push_back({.path = "/csv", .message = "has fewer than two rows"});
    unread.finish(out_, is_testers(file_));
  }

  // Units in a row of their own are those of no column here.
  bool holds_units() {
    std::string row;
    for (std::size_t i = 0; i < table_.columns(); ++i) {
      auto cell = table_.text(i);
      row += (i > 0 ? ", " : "") + std::string(cell);
      if (cell.size() > 2 && (cell.front() == '[' || cell.front() == '('))
        cell = cell.substr(1, cell.size() - 2);
      if (find_unit(cell, all_quantities) == nullptr) return false;
    }
    table_.complain(
        "holds the units of the columns, and no samples", row,
        "write them into the names, as time [s], or give them in the map, and put # before the line");
    return true;
  }

  bool rises(double now, double& last) {
    const bool rising = now > last;
    if (!rising)
      table_.complain(std::isnan(now) ? "the time is missing" : "the time does not rise",
                      std::isnan(now) ? std::string(table_.text(sources_.front().at))
                                      : number_text(now) + " s after " + number_text(last) + " s",
                      "if the samples are even, sample_rate_Hz goes in place of the time");
    last = now;
    return rising;
  }

  const CsvImport& import_;
  const TableInFile& file_;
  const Progress& progress_;
  std::vector<Problem> problems_;
  DelimitedText table_;
  std::vector<std::string> names_;  // the table's, in UTF-8
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

Imported import_csv_table(const CsvImport& import, TableInFile file, const Progress& progress) {
  Specimen specimen;
  auto measured = Import(import, file, progress).read(specimen);
  measured.returns = is_testers(file);
  return recording_of(std::move(measured), specimen, identity_of(import), std::move(file.device));
}

Recording import_csv(const CsvImport& import) {
  return import_csv_table(import, {}).recording;
}

}  // namespace ferrobench::recordings
