#include "base/headings.h"

#include <algorithm>
#include <array>
#include <utility>

namespace ferrobench {
namespace {

constexpr std::array<KnownUnit, 57> units{{
    {"s", Quantity::time, 1},
    {"ms", Quantity::time, 1e-3},
    {"us", Quantity::time, 1e-6},
    {"ns", Quantity::time, 1e-9},
    {"min", Quantity::time, 60},
    {"h", Quantity::time, 3600},
    {"kV/mm", Quantity::field, 1e6},
    {"MV/m", Quantity::field, 1e6},
    {"V/m", Quantity::field, 1},
    {"kV/m", Quantity::field, 1e3},
    {"V/mm", Quantity::field, 1e3},
    {"V/um", Quantity::field, 1e6},
    {"kV/cm", Quantity::field, 1e5},
    {"V/cm", Quantity::field, 1e2},
    {"V", Quantity::voltage, 1},
    {"kV", Quantity::voltage, 1e3},
    {"mV", Quantity::voltage, 1e-3},
    {"C", Quantity::charge, 1},
    {"mC", Quantity::charge, 1e-3},
    {"uC", Quantity::charge, 1e-6},
    {"nC", Quantity::charge, 1e-9},
    {"pC", Quantity::charge, 1e-12},
    {"m", Quantity::displacement, 1},
    {"cm", Quantity::displacement, 1e-2},
    {"mm", Quantity::displacement, 1e-3},
    {"um", Quantity::displacement, 1e-6},
    {"nm", Quantity::displacement, 1e-9},
    {"N", Quantity::force, 1},
    {"mN", Quantity::force, 1e-3},
    {"uN", Quantity::force, 1e-6},
    {"kN", Quantity::force, 1e3},
    {"MN", Quantity::force, 1e6},
    {"A", Quantity::current, 1},
    {"mA", Quantity::current, 1e-3},
    {"uA", Quantity::current, 1e-6},
    {"nA", Quantity::current, 1e-9},
    {"pA", Quantity::current, 1e-12},
    {"A/m^2", Quantity::current_density, 1},
    {"A/cm^2", Quantity::current_density, 1e4},
    {"mA/cm^2", Quantity::current_density, 1e1},
    {"uA/cm^2", Quantity::current_density, 1e-2},
    {"nA/cm^2", Quantity::current_density, 1e-5},
    {"C/m^2", Quantity::polarization, 1},
    {"mC/m^2", Quantity::polarization, 1e-3},
    {"uC/m^2", Quantity::polarization, 1e-6},
    {"C/cm^2", Quantity::polarization, 1e4},
    {"uC/cm^2", Quantity::polarization, 1e-2},
    {"nC/cm^2", Quantity::polarization, 1e-5},
    {"m^2", Quantity::area, 1},
    {"cm^2", Quantity::area, 1e-4},
    {"mm^2", Quantity::area, 1e-6},
    {"um^2", Quantity::area, 1e-12},
    {"nm^2", Quantity::area, 1e-18},
    {"Volts", Quantity::voltage, 1},
    {"Amps", Quantity::current, 1},
    {"sec", Quantity::time, 1},
    {"seconds", Quantity::time, 1},
}};

// Behind an underscore these go on with a name.
constexpr std::array<std::string_view, 22> words{
    "time",   "field",    "level",    "voltage", "charge",   "displacement", "force", "command",
    "cmd",    "set",      "setpoint", "monitor", "measured", "raw",          "value", "signal",
    "sensor", "position", "stroke",   "left",    "right",    "total"};

char lower(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

std::string lowered(std::string_view text) {
  std::string out(text);
  std::ranges::transform(out, out.begin(), lower);
  return out;
}

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t");
  return first == std::string_view::npos ? "" : text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

void replace_all(std::string& text, std::string_view from, std::string_view to) {
  for (auto at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size()))
    text.replace(at, from.size(), to);
}

bool goes_on_with_a_name(std::string_view word) {
  return std::ranges::find(words, lowered(word)) != words.end() ||
         word.find_first_not_of("0123456789") == std::string_view::npos;
}

Heading split_at(std::string_view text, std::size_t name, std::size_t unit) {
  auto before = trimmed(text.substr(0, name));
  for (const std::string_view link : {"/", " in"})
    if (before.ends_with(link)) before = trimmed(before.substr(0, before.size() - link.size()));
  return {std::string(before), std::string(trimmed(text.substr(unit)))};
}

// What stands between factors, and the superscripts and the sign of a negative power.
constexpr std::array<std::pair<std::string_view, std::string_view>, 6> of_products{
    {{"*", " "},
     {"\xc2\xb7", " "},
     {"\xe2\x8b\x85", " "},
     {"\xe2\x88\x92", "-"},
     {"\xe2\x81\xbb\xc2\xb9", "-1"},
     {"\xe2\x81\xbb\xc2\xb2", "-2"}}};

// "kV mm^-1", "kV mm^{-1}" and "kV mm-1", as journals have it, are "kV/mm".
std::string with_a_slash(std::string text) {
  for (const auto& [from, to] : of_products) replace_all(text, from, to);
  if (text.ends_with('}') && text.find("^{") != std::string::npos) {
    text.pop_back();
    replace_all(text, "^{", "^");
  }
  const auto blank = text.rfind(' '), minus = text.rfind('-');
  if (blank == std::string::npos || minus == std::string::npos || minus < blank) return text;
  auto below = text.substr(blank + 1, minus - blank - 1);
  if (below.ends_with('^')) below.pop_back();
  const auto power = text.substr(minus + 1);
  if (power != "1" && power != "2") return text;
  return std::string(trimmed(text.substr(0, blank))) + "/" + below + (power == "2" ? "^2" : "");
}

// "field_kV_per_mm"
Heading underscored(std::string_view text) {
  for (auto at = text.find('_'); at != std::string_view::npos; at = text.find('_', at + 1))
    if (!text.substr(0, at).ends_with("_per") && find_unit(text.substr(at + 1)) != nullptr)
      return split_at(text, at, at + 1);
  const auto last = text.rfind('_', text.find("_per_") - 1);
  if (last == std::string_view::npos) return {"", std::string(text)};
  if (goes_on_with_a_name(text.substr(last + 1))) return {std::string(text), ""};
  return split_at(text, last, last + 1);
}

}  // namespace

const KnownUnit* find_unit(std::string_view text, std::span<const Quantity> quantities) {
  auto plain = with_a_slash(std::string(trimmed(text)));
  for (const std::string_view micro : {"\xc2\xb5", "\xce\xbc", "\xb5"}) replace_all(plain, micro, "u");
  replace_all(plain, "_per_", "/");
  // As UTF-8 has it, and as code page 1252 does.
  for (const std::string_view squared : {"\xc2\xb2", "\xb2"}) replace_all(plain, squared, "^2");
  if (plain.ends_with("m2")) plain.insert(plain.size() - 1, "^");
  const auto found = std::ranges::find(units, plain, &KnownUnit::text);
  const bool wanted =
      found != units.end() && std::ranges::find(quantities, found->quantity) != quantities.end();
  return wanted ? &*found : nullptr;
}

std::vector<std::string> units_of(std::span<const Quantity> quantities) {
  std::vector<std::string> out;
  for (const auto quantity : quantities)
    for (const auto& unit : units)
      if (unit.quantity == quantity) out.emplace_back(unit.text);
  return out;
}

Heading read_heading(std::string_view text, std::span<const Quantity> quantities) {
  text = trimmed(text);
  if (find_unit(text, quantities) != nullptr) return {"", std::string(text)};
  for (const std::string_view brackets : {"[]", "()"})
    if (const auto open = text.find(brackets[0]);
        text.ends_with(brackets[1]) && open != std::string_view::npos) {
      return split_at(text.substr(0, text.size() - 1), open, open + 1);
    }
  if (const auto last = text.find_last_of(" _"); last != std::string_view::npos &&
                                                 text.find('/', last) != std::string_view::npos &&
                                                 find_unit(text.substr(last + 1), all_quantities) != nullptr)
    return split_at(text, last, last + 1);
  if (const auto slash = text.find('/'); slash != std::string_view::npos)
    return split_at(text, slash, slash + 1);
  if (const auto blank = text.rfind(' ');
      blank != std::string_view::npos && find_unit(text.substr(blank + 1), quantities) != nullptr)
    return split_at(text, blank, blank + 1);
  if (text.find('_') != std::string_view::npos) return underscored(text);
  return {std::string(text), ""};
}

bool names_a_voltage(std::string_view name) {
  const auto text = lowered(name);
  const bool letter = text.starts_with('u') || text.starts_with('v');
  return (letter && text.find_first_not_of("0123456789", 1) == std::string::npos) ||
         text.find("volt") != std::string::npos;
}

}  // namespace ferrobench
