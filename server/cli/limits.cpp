#include "daq/guard/limits.h"

#include <array>
#include <cstdio>
#include <iostream>
#include <map>

#include "server/cli/link.h"
#include "server/cli/words.h"

namespace ferrobench::cli {

using nlohmann::json;

namespace {

struct Unit {
  std::string_view name;
  double size;  // in the SI unit of its kind
};

// What a value may be written in, for the SI unit in which it is kept; the first is what people are shown.
std::span<const Unit> units_of(std::string_view si) {
  static constexpr std::array<Unit, 4> field{{{"kV/mm", 1e6}, {"MV/m", 1e6}, {"kV/m", 1e3}, {"V/m", 1}}};
  static constexpr std::array<Unit, 4> slew{
      {{"kV/mm/s", 1e6}, {"MV/m/s", 1e6}, {"kV/m/s", 1e3}, {"V/m/s", 1}}};
  static constexpr std::array<Unit, 4> length{{{"um", 1e-6}, {"nm", 1e-9}, {"mm", 1e-3}, {"m", 1}}};
  static constexpr std::array<Unit, 3> time{{{"s", 1}, {"min", 60}, {"h", 3600}}};
  static constexpr std::array<Unit, 3> force{{{"N", 1}, {"mN", 1e-3}, {"kN", 1e3}}};
  static constexpr std::array<Unit, 1> share{{{"%", 0.01}}};
  if (si == "V/m") return field;
  if (si == "V/m/s") return slew;
  if (si == "m") return length;
  if (si == "s") return time;
  if (si == "N") return force;
  return share;
}

struct Row {
  std::string name;
  std::string_view unit, doc;
};

std::vector<Row> rows() {
  std::vector<Row> out;
  auto each = [&out](std::string_view name, double&, const FieldInfo& info) {
    out.push_back({std::string(name), info.unit, info.doc});
  };
  daq::Limits limits;
  describe(each, limits);
  return out;
}

const Row& row_of(const std::vector<Row>& rows, const std::string& name) {
  if (const auto found = std::ranges::find(rows, name, &Row::name); found != rows.end()) return *found;
  std::vector<std::string> names;
  names.reserve(rows.size());
  for (const auto& row : rows) names.push_back(row.name);
  const auto guess = nearest_name(name, names);
  throw Error(ErrorCode::invalid_params, "there is no such limit",
              Problem{.message = "is not the name of a limit",
                      .given = excerpt(name),
                      .allowed = names,
                      .hint = guess.empty() ? "" : "did you mean \"" + guess + "\"?"});
}

std::string in_words(double value, const Unit& unit) {
  std::array<char, 64> text{};
  static_cast<void>(std::snprintf(text.data(), text.size(), "%.6g %.*s", value / unit.size,
                                  static_cast<int>(unit.name.size()), unit.name.data()));
  return text.data();
}

// "1.8kV/mm": the number and its unit. A number alone could be meant in any: it is refused.
std::pair<double, Unit> read_value(const Row& row, const std::string& text) {
  const auto units = units_of(row.unit);
  char* end = nullptr;
  const double number = std::strtod(text.c_str(), &end);
  std::string unit = end;
  unit.erase(0, unit.find_first_not_of(' '));
  const auto found = std::ranges::find(units, std::string_view(unit), &Unit::name);
  if (end != text.c_str() && found != units.end()) return {number * found->size, *found};
  json names = json::array();
  for (const auto& each : units) names.push_back(each.name);
  throw Error(ErrorCode::invalid_params, "a limit is a number with its unit",
              Problem{.path = row.name,
                      .message = end == text.c_str() ? "is not a number"
                                 : unit.empty()      ? "has no unit"
                                                     : "has a unit that is not known here",
                      .given = excerpt(text),
                      .allowed = names,
                      .hint = "for example " + row.name + "=" + in_words(number, {units.front().name, 1})});
}

void scale(json& value, double size) {
  if (value.is_number()) value = value.get<double>() / size;
  if (value.is_object())
    for (auto& item : value) scale(item, size);
}

// What the daemon refuses is told in the unit that was written.
Error in_units(const Error& error, const std::map<std::string, Unit>& written) {
  auto problems = error.problems();
  for (auto& p : problems) {
    const auto name = p.path.substr(p.path.starts_with('/') ? 1 : 0);
    const auto unit = written.find(name);
    if (unit == written.end()) continue;
    p.path = name;
    p.unit = unit->second.name;
    scale(p.given, unit->second.size);
    scale(p.allowed, unit->second.size);
  }
  return {error.code(), error.message(), std::move(problems)};
}

int print_limits(const json& limits) {
  for (const auto& row : rows())
    if (limits.contains(row.name))
      std::printf("%-24s %14s   %.*s\n", row.name.c_str(),
                  in_words(limits.at(row.name).get<double>(), units_of(row.unit).front()).c_str(),
                  static_cast<int>(row.doc.size()), row.doc.data());
  return exit_ok;
}

int set_limits(const std::vector<std::string>& settings, const Common& common) {
  const auto known = rows();
  json change = json::object();
  std::map<std::string, Unit> written;
  for (const auto& setting : settings) {
    const auto split = setting.find('=');
    if (split == 0 || split == std::string::npos)
      throw Error(ErrorCode::invalid_params, "a limit is set by KEY=VALUE",
                  Problem{.given = excerpt(setting), .hint = "for example field_max=1.8kV/mm"});
    const auto& row = row_of(known, setting.substr(0, split));
    const auto [value, unit] = read_value(row, setting.substr(split + 1));
    change[row.name] = value;
    written[row.name] = unit;
  }
  auto daemon = running_daemon(common);
  if (!daemon)
    throw Error(ErrorCode::device_unavailable, "limits are those of the daemon, and none is running",
                Problem{.message = "nothing was set", .hint = "start one with 'ferrobench serve'"});
  try {
    return print_limits(daemon->call("limits.set", change));
  } catch (const Error& error) {
    throw in_units(error, written);
  }
}

}  // namespace

void add_limits(CLI::App& app, Common& common) {
  auto* sub = app.add_subcommand("limits", "What the guard lets through: show it, or set it in the daemon");
  auto format = std::make_shared<std::string>();
  sub->add_option("--format", *format, "text, or json in SI units")
      ->check(one_of({"text", "json"}))
      ->default_val("text");
  sub->require_subcommand(0, 1);
  sub->callback([format, &common] {
    if (common.action) return;  // set
    common.action = [format, &common] {
      const auto limits = Link(common).call("limits.get");
      if (*format == "text") return print_limits(limits);
      std::cout << limits.dump(2) << '\n';
      return static_cast<int>(exit_ok);
    };
  });
  auto* change = sub->add_subcommand("set", "Sets the limits named, for the next runs of the daemon");
  auto settings = std::make_shared<std::vector<std::string>>();
  change
      ->add_option("KEY=VALUE", *settings,
                   "a limit with its unit, for example field_max=1.8kV/mm; as many as wanted")
      ->required();
  change->callback(
      [settings, &common] { common.action = [settings, &common] { return set_limits(*settings, common); }; });
  change->footer(
      "Units: V/m, kV/m, MV/m, kV/mm (for a slew the same per second); m, mm, um, nm; s, min, h; N, mN, kN; "
      "%.\n"
      "Examples:\n"
      "  ferrobench limits set field_max=1.8kV/mm field_min=-1.8kV/mm\n"
      "  ferrobench limits set reverse_field_time=10min");
  sub->footer(
      "Without a daemon these are the limits of every run of this program.\n"
      "Examples:\n"
      "  ferrobench limits\n"
      "  ferrobench limits set field_max=1.8kV/mm");
}

}  // namespace ferrobench::cli
