#include "protocols/past.h"

#include <array>
#include <cstdio>

namespace ferrobench::protocols {

using nlohmann::json;

std::span<const std::pair<PastKind, std::string_view>> enum_names(PastKind) {
  static constexpr std::array<std::pair<PastKind, std::string_view>, 7> names{
      {{PastKind::unknown, "unknown"},
       {PastKind::poled_plus, "poled_plus"},
       {PastKind::poled_minus, "poled_minus"},
       {PastKind::unpoled, "unpoled"},
       {PastKind::visited, "visited"},
       {PastKind::cycled, "cycled"},
       {PastKind::partly_poled, "partly_poled"}}};
  return names;
}

std::span<const std::pair<FirstState, std::string_view>> enum_names(FirstState) {
  static constexpr std::array<std::pair<FirstState, std::string_view>, 4> names{
      {{FirstState::poled_plus, "poled_plus"},
       {FirstState::poled_minus, "poled_minus"},
       {FirstState::unpoled, "unpoled"},
       {FirstState::partly_poled, "partly_poled"}}};
  return names;
}

json to_json(const Past& past) {
  auto out = write_json(past);
  if (past.levels.empty()) out.erase("levels");
  return out;
}

void check_past(const Past& past, const std::string& path, std::vector<Problem>& problems) {
  const bool visited = past.kind == PastKind::visited;
  if (visited && past.levels.empty())
    problems.push_back({.path = path + "/levels",
                        .message = "is missing: the kind visited needs at least one level",
                        .hint = R"(for example [{"field_V_per_m": -1.5e6, "seconds": 2}])"});
  if (past.levels.size() > most_visited_levels)
    problems.push_back({.path = path + "/levels",
                        .message = "has too many levels",
                        .given = past.levels.size(),
                        .allowed = {{"to", most_visited_levels}},
                        .hint = "leave out what lies long before: later levels wipe it out"});
  const auto refuse = [&](const char* key, json allowed) {
    problems.push_back({.path = path + "/" + key,
                        .message = "does not belong to this kind",
                        .given = write_json(past.kind),
                        .allowed = std::move(allowed)});
  };
  if (!visited && !past.levels.empty()) refuse("levels", {"visited"});
  const bool after_a_state = visited || past.kind == PastKind::cycled;
  if (!after_a_state && past.from) refuse("from", {"visited", "cycled"});
  const bool partly =
      past.kind == PastKind::partly_poled || (after_a_state && past.from == FirstState::partly_poled);
  if (partly && !past.poling)
    problems.push_back({.path = path + "/poling",
                        .message = "is missing: what is partly poled needs its degree",
                        .allowed = {{"from", -1}, {"to", 1}},
                        .hint = "1 is poled towards +, 0 unpoled, -1 poled towards -"});
  if (!partly && past.poling)
    problems.push_back({.path = path + "/poling",
                        .message = "belongs to what is partly poled alone",
                        .given = *past.poling,
                        .hint = R"(say it by the kind, or by "from": "partly_poled")"});
}

void demand_sound(const Past& past) {
  std::vector<Problem> problems;
  check_past(past, "/past", problems);
  if (!problems.empty()) throw Error(ErrorCode::invalid_params, "the past is not valid", std::move(problems));
}

json past_schema() {
  auto out = json_schema<Past>();
  out["properties"]["levels"]["maxItems"] = most_visited_levels;
  out["if"] = {{"properties", {{"kind", {{"const", "visited"}}}}}, {"required", {"kind"}}};
  out["then"] = {{"required", {"levels"}}, {"properties", {{"levels", {{"minItems", 1}}}}}};
  out["else"] = {{"properties", {{"levels", {{"maxItems", 0}}}}}};
  // "from" in no other kind than visited and cycled; "poling" with what is partly poled, and only there.
  const json partly = {{"anyOf",
                        {{{"properties", {{"kind", {{"const", "partly_poled"}}}}}, {"required", {"kind"}}},
                         {{"properties", {{"from", {{"const", "partly_poled"}}}}}, {"required", {"from"}}}}}};
  out["dependentSchemas"] = {{"from", {{"properties", {{"kind", {{"enum", {"visited", "cycled"}}}}}}}},
                             {"poling", partly}};
  out["allOf"] = {{{"if", partly}, {"then", {{"required", {"poling"}}}}}};
  return out;
}

Past past_from_json(const json& given, ErrorCode code, const std::string& path) {
  Past out;
  std::vector<Problem> problems;
  read_json(given, out, path, problems);
  if (problems.empty()) check_past(out, path, problems);
  if (!problems.empty()) throw Error(code, "the past is not valid", std::move(problems));
  return out;
}

Past past_from_text(const std::string& text) {
  if (text.starts_with("{"))
    return past_from_json(parse_json_text(text, ErrorCode::invalid_params, "the past"),
                          ErrorCode::invalid_params);
  return past_from_json({{"kind", text}}, ErrorCode::invalid_params);
}

Past and_then(Past past, std::span<const VisitedLevel> levels) {
  if (levels.empty() || !past.known()) return past;
  if (past.kind == PastKind::cycled) return {};
  if (past.kind == PastKind::poled_minus) past.from = FirstState::poled_minus;
  if (past.kind == PastKind::unpoled) past.from = FirstState::unpoled;
  if (past.kind == PastKind::partly_poled) past.from = FirstState::partly_poled;
  past.kind = PastKind::visited;
  past.levels.insert(past.levels.end(), levels.begin(), levels.end());
  return past.levels.size() > most_visited_levels ? Past{} : past;
}

Past without_last_level(Past past) {
  past.levels.pop_back();
  if (!past.levels.empty()) return past;
  switch (past.from.value_or(FirstState::poled_plus)) {
    case FirstState::poled_minus:
      return {PastKind::poled_minus};
    case FirstState::unpoled:
      return {PastKind::unpoled};
    case FirstState::partly_poled:
      return {.kind = PastKind::partly_poled, .poling = past.poling};
    case FirstState::poled_plus:
      break;
  }
  return {PastKind::poled_plus};
}

namespace {

std::string in_words(FirstState state, std::optional<double> poling) {
  switch (state) {
    case FirstState::poled_minus:
      return "poled towards -";
    case FirstState::unpoled:
      return "unpoled";
    case FirstState::partly_poled: {
      std::array<char, 64> text{};
      const double degree = poling.value_or(0);
      (void)std::snprintf(text.data(), text.size(), "poled to %.0f %% towards %c", 100 * std::abs(degree),
                          degree < 0 ? '-' : '+');
      return text.data();
    }
    case FirstState::poled_plus:
      break;
  }
  return "poled towards +";
}

}  // namespace

std::string in_words(const Past& past) {
  const auto state = [&](FirstState s) { return in_words(s, past.poling); };
  const auto first = state(past.from.value_or(FirstState::poled_plus));
  switch (past.kind) {
    case PastKind::poled_plus:
      return state(FirstState::poled_plus);
    case PastKind::poled_minus:
      return state(FirstState::poled_minus);
    case PastKind::unpoled:
      return state(FirstState::unpoled);
    case PastKind::partly_poled:
      return state(FirstState::partly_poled);
    case PastKind::cycled:
      return first + ", then cycled through the program until it repeated itself";
    case PastKind::visited: {
      // The farthest level is what decides; the last ones often only lead back.
      double extreme = 0;
      for (const auto& level : past.levels)
        if (std::abs(level.field) >= std::abs(extreme)) extreme = level.field;
      std::array<char, 96> text{};
      if (constexpr std::size_t few = 2; past.levels.size() <= few)
        (void)std::snprintf(text.data(), text.size(), ", then taken to %.4g kV/mm", extreme / 1e6);
      else
        (void)std::snprintf(text.data(), text.size(),
                            ", then taken through %zu levels, the farthest of them %.4g kV/mm",
                            past.levels.size(), extreme / 1e6);
      return first + text.data();
    }
    case PastKind::unknown:
      break;
  }
  return "of unknown past";
}

}  // namespace ferrobench::protocols
