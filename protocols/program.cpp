#include "protocols/program.h"

#include <algorithm>
#include <array>
#include <set>

namespace ferrobench::protocols {
namespace {

using fields_detail::pointer;
using nlohmann::json;

bool is_letter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}
bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

// The two patterns of the header, without std::regex, which recurses once for each character.
bool is_name(std::string_view text) {
  const auto fits = [](char c) { return is_letter(c) || is_digit(c) || c == '.' || c == '_' || c == '-'; };
  return !text.empty() && text.size() <= 100 && (is_letter(text[0]) || is_digit(text[0])) &&
         std::all_of(text.begin(), text.end(), fits);
}
bool is_parameter_name(std::string_view text) {
  const auto fits = [](char c) { return is_letter(c) || is_digit(c) || c == '_'; };
  return !text.empty() && text.size() <= 64 && !is_digit(text[0]) &&
         std::all_of(text.begin(), text.end(), fits);
}

bool holds_text(std::string_view key) {
  static constexpr std::array<std::string_view, 10> keys{"$schema", "format", "name", "title", "source",
                                                         "notes",   "unit",   "kind", "label", "csv"};
  return std::find(keys.begin(), keys.end(), key) != keys.end();
}

std::map<std::string, double> read_parameters(const json& object, std::vector<Problem>& problems) {
  std::map<std::string, double> out;
  if (!object.is_object()) {
    problems.push_back(fields_detail::wrong_type("/parameters", object, "an object of numbers", {}));
    return out;
  }
  for (const auto& [name, value] : object.items()) {
    if (problems.size() >= max_problems) return out;
    const auto path = pointer("/parameters", name);
    if (!is_parameter_name(name))
      problems.push_back(
          {.path = path, .message = "is not a parameter name", .allowed = parameter_name_pattern});
    read_json(value, out[name], path, problems);
  }
  return out;
}

// Puts the values of parameters in place of "$name" and "-$name".
class Substitution {
 public:
  Substitution(const std::map<std::string, double>& parameters, std::vector<Problem>& problems)
      : parameters_(parameters), problems_(problems) {
    for (const auto& [name, value] : parameters) names_.push_back(name);
  }

  void apply(json& value, const std::string& path, int depth = 0) {
    if (problems_.size() >= max_problems) return;
    if (depth > 4 * max_depth) {
      complain({.path = path, .message = "is nested too deeply"});
      value = nullptr;
    } else if (value.is_null()) {
      complain({.path = path, .message = "is null", .hint = "leave it out instead"});
    } else if (value.is_array()) {
      for (std::size_t i = 0; i < value.size(); ++i)
        apply(value[i], pointer(path, std::to_string(i)), depth + 1);
    } else if (value.is_object()) {
      for (auto& [key, item] : value.items())
        if (item.is_null() || !holds_text(key)) apply(item, pointer(path, key), depth + 1);
    } else if (value.is_string()) {
      replace(value, path);
    }
  }

  // Where something is wrong already, what reading has to say about the same place is noise.
  bool complained(const std::string& path) const { return places_.contains(path); }

 private:
  void complain(Problem problem) {
    places_.insert(problem.path);
    problems_.push_back(std::move(problem));
  }

  void replace(json& value, const std::string& path) {
    const std::string_view given = value.get_ref<const std::string&>();
    auto text = given;
    const double sign = text.starts_with('-') ? -1 : 1;
    if (sign < 0) text.remove_prefix(1);
    if (!text.starts_with('$')) return;
    text.remove_prefix(1);
    const auto found = parameters_.find(std::string(text));
    if (found != parameters_.end()) {
      value = sign * found->second;
      return;
    }
    const auto guess = nearest_name(text.substr(0, 80), names_);
    complain({.path = path,
              .message = "is not one of the protocol's parameters",
              .given = excerpt(given),
              .allowed = names_,
              .hint = guess.empty() ? "name it under parameters" : "did you mean \"$" + guess + "\"?"});
  }

  const std::map<std::string, double>& parameters_;
  std::vector<Problem>& problems_;
  std::vector<std::string> names_;
  std::set<std::string> places_;
};

}  // namespace

std::span<const std::pair<Format, std::string_view>> enum_names(Format) {
  static constexpr std::pair<Format, std::string_view> names[] = {{Format::protocol, "ferrobench-protocol"}};
  return names;
}

namespace {

// The fields of segments.h are in either unit; a problem is told in the one that this file is in.
void tell_in(Unit unit, Problem& problem) {
  const auto name = write_json(unit).get<std::string>();
  if (problem.unit == level_unit) problem.unit = name;
  if (problem.unit == rate_unit) problem.unit = name + "/s";
}

std::string object_of(const std::string& path) {
  return path.substr(0, path.rfind('/'));
}

// A misspelt name is one problem: what its object lacks is not told as well. So does the schema.
std::set<std::string> objects_with_unknown_keys(const std::vector<Problem>& found) {
  std::set<std::string> out;
  for (const auto& problem : found)
    if (problem.message == "is not a known key") out.insert(object_of(problem.path));
  return out;
}
bool tells_what_is_missing(const Problem& problem, const std::set<std::string>& objects) {
  return (problem.message == "is missing" && objects.contains(object_of(problem.path))) ||
         (problem.message.starts_with("has neither") && objects.contains(problem.path));
}

}  // namespace

Program read_program(const json& given, std::vector<Problem>& problems) {
  Program program;
  if (!given.is_object()) {
    problems.push_back(fields_detail::wrong_type("", given, "a protocol, an object", {}));
    return program;
  }
  if (const auto found = given.find("parameters"); found != given.end())
    program.parameters = read_parameters(*found, problems);
  auto values = given;
  values.erase("parameters");
  Substitution substitution(program.parameters, problems);
  substitution.apply(values, "");
  if (given.contains("parameters")) values["parameters"] = given["parameters"];

  std::vector<Problem> found;
  read_json(values, program.header, "", found);
  if (values.contains("name") && values["name"].is_string() && !is_name(program.header.name))
    found.push_back({.path = "/name",
                     .message = "is not a name",
                     .given = excerpt(program.header.name),
                     .allowed = name_pattern,
                     .hint = "a title for people goes under title"});
  const bool past_read =
      std::ranges::none_of(found, [](const Problem& p) { return p.path.starts_with("/past"); });
  if (program.header.past && past_read) check_past(*program.header.past, "/past", found);
  if (values.contains("segments"))
    program.segments = read_segments(program.header.segments, "/segments", 0, program.header.unit, found);
  program.header.segments = nullptr;
  const bool unit_known = std::ranges::none_of(found, [](const Problem& p) { return p.path == "/unit"; });
  const auto misspelt_in = objects_with_unknown_keys(found);
  for (auto& problem : found) {
    if (substitution.complained(problem.path) || tells_what_is_missing(problem, misspelt_in)) continue;
    if (unit_known) tell_in(program.header.unit, problem);
    problems.push_back(std::move(problem));
  }
  return program;
}

}  // namespace ferrobench::protocols
