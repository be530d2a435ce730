// What a specimen has been through before a program or a recording begins.
//
//     {"kind": "poled_plus"}      saturated towards +, and then at rest under the first field
//     {"kind": "poled_minus"}     saturated towards -
//     {"kind": "unpoled"}         never in a field: a third of the domains in each well
//     {"kind": "partly_poled", "poling": -0.4}   in between: 1 is poled towards +, 0 unpoled, -1 towards -
//     {"kind": "visited", "from": "poled_plus", "levels": [{"field_V_per_m": -1.5e6, "seconds": 2}, ...]}
//                                 from that state at no field to one level after the other, in a straight
//                                 line each; a hold is a level once more. Then to the first field, as fast as
//                                 any of these went.
//     {"kind": "cycled", "from": "unpoled"}   the program itself, from that state, until it repeats itself
//                                 (as with levels, from "partly_poled" with its poling too)
//     {"kind": "unknown"}
//
// The zero of the displacement is the specimen at rest, without field, in the state that it starts from.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/fields.h"

namespace ferrobench::protocols {

enum class PastKind { unknown, poled_plus, poled_minus, unpoled, visited, cycled, partly_poled };
std::span<const std::pair<PastKind, std::string_view>> enum_names(PastKind);

// What levels may have been visited from.
enum class FirstState { poled_plus, poled_minus, unpoled, partly_poled };
std::span<const std::pair<FirstState, std::string_view>> enum_names(FirstState);

struct VisitedLevel {
  double field = 0;    // V/m
  double seconds = 0;  // that it took to go there
  bool operator==(const VisitedLevel&) const = default;
};

// Beyond any bench: a field of 1 kV per micrometre, a leg of 30 years.
inline constexpr double highest_visited_field = 1e9, longest_leg = 1e9;
// As many as a run of hours on a bench has; a simulation plays each of them.
inline constexpr std::size_t most_visited_levels = 10000;

template <class Visitor>
void describe(Visitor& visit, VisitedLevel& l) {
  visit("field_V_per_m", l.field,
        {.unit = "V/m", .min = -highest_visited_field, .max = highest_visited_field, .required = true});
  visit("seconds", l.seconds,
        {.unit = "s",
         .min = 0,
         .max = longest_leg,
         .exclusive_min = true,
         .required = true,
         .doc = "that it took to go there, in a straight line"});
}

struct Past {
  PastKind kind = PastKind::unknown;
  std::optional<FirstState> from{};    // of levels or cycles; none: poled towards +
  std::vector<VisitedLevel> levels{};  // of PastKind::visited, at least one; else none
  std::optional<double> poling{};      // degree, -1 to 1, of what is or was partly poled; else none

  bool known() const { return kind != PastKind::unknown; }
  bool operator==(const Past&) const = default;
};

template <class Visitor>
void describe(Visitor& visit, Past& p) {
  visit("kind", p.kind, {.required = true, .doc = "what the specimen has been through"});
  visit("from", p.from, {.doc = "state before the first of the levels"});
  visit("levels", p.levels, {.doc = "that were visited, in their order; of the kind visited alone"});
  visit(
      "poling", p.poling,
      {.min = -1,
       .max = 1,
       .doc = "degree of poling of what is partly poled: 1 all domains +, 0 a third in each well, -1 all -"});
}

// Only what the kind has.
nlohmann::json to_json(const Past& past);
// What binds the fields together, for who has read them one by one: levels belong to the kind visited, which
// has at least one and not too many; a degree of poling to what is partly poled. Adds problems.
void check_past(const Past& past, const std::string& path, std::vector<Problem>& problems);
// Throws Error(invalid_params) if the fields do not fit together.
void demand_sound(const Past& past);
// The fields' JSON Schema with the same rules.
nlohmann::json past_schema();
// Throws Error(code) with every problem, under `path`.
Past past_from_json(const nlohmann::json& given, ErrorCode code, const std::string& path = "/past");
// The name of a kind that needs nothing else, or a past as JSON text. Throws Error(invalid_params).
Past past_from_text(const std::string& text);
// The past with these levels visited after it. Unknown where it was, after cycles, as what ends one depends
// on the program, and where these are too many.
Past and_then(Past past, std::span<const VisitedLevel> levels);
// A past of the kind visited without its last level.
Past without_last_level(Past past);
// What the specimen was, in a few words: "poled towards -", "unpoled, then taken to -1.75 kV/mm".
std::string in_words(const Past& past);

}  // namespace ferrobench::protocols
