#include "protocols/past.h"

#include <array>
#include <cstdio>

namespace ferrobench::protocols {

using nlohmann::json;

std::span<const std::pair<PastKind, std::string_view>> enum_names(PastKind) {
  static constexpr std::array<std::pair<PastKind, std::string_view>, 6> names{
      {{PastKind::unknown, "unknown"},
       {PastKind::poled_plus, "poled_plus"},
       {PastKind::poled_minus, "poled_minus"},
       {PastKind::unpoled, "unpoled"},
       {PastKind::visited, "visited"},
       {PastKind::cycled, "cycled"}}};
  return names;
}

std::span<const std::pair<FirstState, std::string_view>> enum_names(FirstState) {
  static constexpr std::array<std::pair<FirstState, std::string_view>, 3> names{
      {{FirstState::poled_plus, "poled_plus"},
       {FirstState::poled_minus, "poled_minus"},
       {FirstState::unpoled, "unpoled"}}};
  return names;
}

json to_json(const Past& past) {
  if (past.kind == PastKind::visited) return write_json(past);
  return {{"kind", write_json(past.kind)}};
}

Past read_past(const json& given, const std::string& path, std::vector<Problem>& problems) {
  Past out;
  // So many levels are not even read: each of them might have a problem.
  if (given.is_object() && given.contains("levels") && given.at("levels").is_array() &&
      given.at("levels").size() > most_visited_levels) {
    problems.push_back({.path = path + "/levels",
                        .message = "has too many levels",
                        .given = given.at("levels").size(),
                        .allowed = {{"to", most_visited_levels}},
                        .hint = "leave out what lies long before; later levels wipe it out"});
    return out;
  }
  const auto before = problems.size();
  read_json(given, out, path, problems);
  if (problems.size() > before) return out;
  if (out.kind == PastKind::visited && out.levels.empty())
    problems.push_back({.path = path + "/levels",
                        .message = "is missing: the kind visited needs at least one level",
                        .hint = R"(for example [{"field_V_per_m": -1.5e6, "seconds": 2}])"});
  if (out.kind != PastKind::visited && (given.contains("levels") || given.contains("from")))
    problems.push_back({.path = path + (given.contains("levels") ? "/levels" : "/from"),
                        .message = "belongs to the kind visited alone",
                        .given = write_json(out.kind),
                        .allowed = "visited"});
  return out;
}

Past past_from_json(const json& given, ErrorCode code, const std::string& path) {
  std::vector<Problem> problems;
  auto out = read_past(given, path, problems);
  if (!problems.empty()) throw Error(code, "the past is not valid", std::move(problems));
  return out;
}

Past past_from_text(const std::string& text) {
  if (text.starts_with("{"))
    return past_from_json(parse_json_text(text, ErrorCode::invalid_params, "the past"),
                          ErrorCode::invalid_params);
  return past_from_json({{"kind", text}}, ErrorCode::invalid_params);
}

std::string in_words(const Past& past) {
  switch (past.kind) {
    case PastKind::poled_plus:
      return "poled towards +";
    case PastKind::poled_minus:
      return "poled towards -";
    case PastKind::unpoled:
      return "unpoled";
    case PastKind::cycled:
      return "cycled: the program itself until it repeats";
    case PastKind::visited: {
      // The farthest level is what decides; the last ones often only lead back.
      double extreme = 0;
      for (const auto& level : past.levels)
        if (std::abs(level.field) >= std::abs(extreme)) extreme = level.field;
      std::array<char, 64> text{};
      (void)std::snprintf(text.data(), text.size(), "visited %.4g kV/mm", extreme / 1e6);
      return text.data();
    }
    case PastKind::unknown:
      break;
  }
  return "unknown";
}

}  // namespace ferrobench::protocols
