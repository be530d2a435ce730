#include "recordings/exchange/conversion/units_of_columns.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/fields.h"
#include "recordings/format/others.h"

namespace ferrobench::recordings {
namespace {

std::string_view si_unit(Quantity quantity) {
  switch (quantity) {
    case Quantity::time:
      return "s";
    case Quantity::field:
      return "V/m";
    case Quantity::voltage:
      return "V";
    case Quantity::charge:
      return "C";
    case Quantity::displacement:
      return "m";
    case Quantity::force:
      return "N";
    case Quantity::current:
      return "A";
    case Quantity::current_density:
      return "A/m^2";
    case Quantity::polarization:
      return "C/m^2";
    case Quantity::area:
      return "m^2";
  }
  return "";
}

// "1-DHM Pr+" is "1_dhm_pr_plus".
std::string plain_name(std::string_view name) {
  constexpr std::size_t longest = 48;
  std::string out;
  for (std::size_t i = 0; i < std::min(name.size(), longest); ++i) {
    const char c = name[i];
    const bool ends = i + 1 == name.size() || name[i + 1] == ' ';
    if ((c >= 'a' && c <= 'z') || (c >= '0' && c <= '9'))
      out += c;
    else if (c >= 'A' && c <= 'Z')
      out += static_cast<char>(c - 'A' + 'a');
    else if ((c == '+' || c == '-') && ends)
      out += c == '+' ? "_plus" : "_minus";
    else if (!out.empty() && out.back() != '_')
      out += '_';
  }
  while (out.ends_with('_')) out.pop_back();
  return out.empty() || out == "time" ? "column" : out;
}

}  // namespace

std::optional<Values> take_column(TesterTable& table, std::string_view name, Quantity quantity,
                                  std::string_view unit) {
  const auto found = std::ranges::find(table.columns, name, &TesterColumn::name);
  if (found == table.columns.end()) return std::nullopt;
  const std::array wanted{quantity};
  const auto written = found->unit.empty() ? unit : std::string_view(found->unit);
  const auto* known = find_unit(written, wanted);
  if (known == nullptr)
    throw Error(ErrorCode::bad_recording, "the file's columns cannot be understood",
                Problem{.message = "line " + std::to_string(table.first_line - 1) + ": column " +
                                   excerpt(name) + " has a unit that is not understood here",
                        .given = excerpt(written),
                        .allowed = units_of(wanted)});
  auto values = std::move(found->values);
  table.columns.erase(found);
  if (known->si != 1)
    for (double& v : values) v *= known->si;
  return values;
}

Values demand_column(TesterTable& table, std::string_view name, Quantity quantity, std::string_view unit) {
  if (auto values = take_column(table, name, quantity, unit)) return std::move(*values);
  auto allowed = nlohmann::json::array();
  for (const auto& column : table.columns) allowed.push_back(excerpt(column.name));
  throw Error(ErrorCode::bad_recording, "the file's columns cannot be understood",
              Problem{.message = "line " + std::to_string(table.first_line - 1) + ": there is no column " +
                                 std::string(name) + ", which each " + table.measurement + " table has",
                      .given = allowed});
}

void take_others(TesterTable& table, Measured& m) {
  std::string unmeasured;
  std::size_t too_many = 0;
  for (auto& column : table.columns) {
    if (!is_measured(column.values) && m.time.size() > 1) {
      unmeasured += (unmeasured.empty() ? "" : ", ") + column.name;
      continue;
    }
    // One is left for the current.
    if (m.others.size() + 1 >= most_other_columns) {
      ++too_many;
      continue;
    }
    const auto* known = find_unit(column.unit, all_quantities);
    if (known != nullptr && known->si != 1)
      for (double& v : column.values) v *= known->si;
    auto name = plain_name(column.name);
    // What is called so is a current in A, for whoever reads the recording.
    const auto taken = [&m](const std::string& n) {
      return n == "current" ||
             std::ranges::any_of(m.others, [&n](const OtherColumn& o) { return o.as.name == n; });
    };
    for (int i = 2; taken(name); ++i) name = plain_name(column.name) + "_" + std::to_string(i);
    const auto unit = column.unit == "1" ? "" : column.unit;
    m.others.push_back({{name, known != nullptr ? std::string(si_unit(known->quantity)) : unit, column.name},
                        std::move(column.values)});
  }
  table.columns.clear();
  if (!unmeasured.empty())
    m.say("note", "columns with one value only were not measured and are left out: " + unmeasured);
  if (too_many > 0)
    m.say("warning", "the last " + std::to_string(too_many) + " columns are left out: a recording holds " +
                         std::to_string(most_other_columns) + " beside its channels");
}

bool is_measured(const Values& values) {
  return std::ranges::any_of(values, [&values](double v) { return v != values.front() && !std::isnan(v); });
}

void demand_rising_time(const Measured& m) {
  for (std::size_t i = 0; i < m.time.size(); ++i)
    if (!std::isfinite(m.time[i]) || (i > 0 && !(m.time[i] > m.time[i - 1])))
      throw Error(
          ErrorCode::bad_recording, "the file is not what its kind of file should be",
          Problem{.message = m.place(i) + ": the time does not rise",
                  .given = std::isfinite(m.time[i]) ? nlohmann::json(m.time[i]) : nlohmann::json("none"),
                  .hint = "the file was changed; export it once more"});
  if (m.time.size() < 2)
    throw Error(ErrorCode::bad_recording, "the file is not what its kind of file should be",
                Problem{.message = "it has fewer than two rows",
                        .hint = "the file was cut off; export it once more"});
}

}  // namespace ferrobench::recordings
