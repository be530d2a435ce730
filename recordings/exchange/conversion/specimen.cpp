#include "recordings/exchange/conversion/specimen.h"

#include <array>
#include <cmath>

#include "base/error.h"
#include "base/fields.h"
#include "base/headings.h"
#include "base/number_text.h"

namespace ferrobench::recordings {
namespace {

constexpr double lengths_close = 5e-3;

// Nothing can be wrong with what the user says better.
std::optional<double> length_in(const TesterTable& table, std::string_view key, Quantity quantity,
                                bool given) {
  const auto value = table.find(key);
  if (!value) return std::nullopt;
  const auto refuse = [&](const std::string& what, const std::string& text, const nlohmann::json& allowed) {
    throw Error(ErrorCode::bad_recording, "the file's header cannot be understood",
                Problem{.message = "line " + std::to_string(value->line) + ": " + std::string(key) + what,
                        .given = excerpt(text),
                        .allowed = allowed});
  };
  const std::array quantities{quantity};
  const auto* unit = find_unit(value->unit, quantities);
  if (given && (unit == nullptr || !value->number || !(*value->number >= 0))) return std::nullopt;
  if (unit == nullptr) refuse(" has a unit that is not understood here", value->unit, units_of(quantities));
  if (!value->number) refuse(" is no number", value->text, nullptr);
  if (!(*value->number >= 0)) refuse(" is below zero", value->text, nullptr);
  // Zero is what testers write where nobody has entered it.
  if (*value->number == 0) return std::nullopt;
  return *value->number * unit->si;
}

std::string in_m(double value, bool area) {
  return number_text(value) + (area ? " m^2" : " m");
}

struct Wanted {
  std::string_view path, unit;
  std::string hint;
};

std::optional<double> settle(const std::optional<double>& given, const std::optional<double>& stated,
                             const std::string& what, bool area, Findings& findings) {
  if (given && stated && std::abs(*given - *stated) > lengths_close * *stated)
    findings.push_back({"warning", "the " + what + " is " + in_m(*given, area) + " as given; the file says " +
                                       in_m(*stated, area)});
  if (!given && stated)
    findings.push_back({"note", "the " + what + " is " + in_m(*stated, area) + ", as the file says"});
  return given ? given : stated;
}

}  // namespace

KnownSpecimen specimen_in_header(const TesterTable& table, const KnownSpecimen& given) {
  KnownSpecimen out;
  for (const std::string_view key : {"Area", "Sample Area"})
    if (!out.area) out.area = length_in(table, key, Quantity::area, given.area.has_value());
  for (const std::string_view key : {"Thickness", "Sample Thickness"})
    if (!out.layer_thickness)
      out.layer_thickness = length_in(table, key, Quantity::displacement, given.layer_thickness.has_value());
  if (const auto layers = table.find("Number Of Ceramic Layers"); layers && layers->number) {
    constexpr double most_layers = 1e6;
    if (*layers->number >= 1 && *layers->number <= most_layers)
      out.layer_count = static_cast<std::int64_t>(std::lround(*layers->number));
  }
  for (const std::string_view key : {"SampleName", "Sample Name"})
    if (const auto name = table.find(key); name && out.name.empty()) out.name = name->text;
  return out;
}

Specimen settle_specimen(const KnownSpecimen& given, const KnownSpecimen& stated, bool demand_length,
                         Findings& findings, std::vector<Problem>& problems) {
  const auto area = settle(given.area, stated.area, "electrode's area", true, findings);
  const auto thickness =
      settle(given.layer_thickness, stated.layer_thickness, "layer's thickness", false, findings);
  const auto demand = [&](const std::optional<double>& value, const Wanted& wanted) {
    if (!value)
      problems.push_back({.path = std::string(wanted.path),
                          .message = "is missing: the file does not say it",
                          .unit = std::string(wanted.unit),
                          .hint = wanted.hint});
  };
  if (demand_length)
    demand(given.length, {"/length_m", "m", "the stack's, whose displacement the table has"});
  demand(area, {"/area_m2", "m^2", "the area of one layer's electrode"});
  demand(thickness,
         {"/layer_thickness_m", "m", "the thickness of one layer: it turns a voltage into a field"});
  const auto layers = given.layer_count.value_or(stated.layer_count.value_or(1));
  const auto length = given.length.value_or(static_cast<double>(layers) * thickness.value_or(1));
  if (!given.length)
    findings.push_back({"note", "the length is taken for that of its " +
                                    (layers == 1 ? "one layer" : std::to_string(layers) + " layers") + ", " +
                                    in_m(length, false)});
  return {given.name.empty() ? stated.name : given.name, length, area.value_or(1), thickness.value_or(1),
          layers};
}

Specimen settle_specimen(const KnownSpecimen& given, const KnownSpecimen& stated, bool demand_length,
                         Findings& findings) {
  std::vector<Problem> problems;
  auto out = settle_specimen(given, stated, demand_length, findings, problems);
  if (!problems.empty())
    throw Error(ErrorCode::invalid_params, "the specimen must be known", std::move(problems));
  return out;
}

}  // namespace ferrobench::recordings
