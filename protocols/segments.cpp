#include "protocols/segments.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>

namespace ferrobench::protocols {
namespace {

using fields_detail::pointer;
using nlohmann::json;

// What the checks below look at: the object as given, where it stands, and where problems go.
struct Place {
  const json& object;
  const std::string& path;
  int depth;
  Unit unit;
  std::vector<Problem>& problems;

  bool has(std::string_view key) const { return object.contains(key); }
  void add(std::string_view key, Problem problem) const {
    problem.path = key.empty() ? path : pointer(path, key);
    problems.push_back(std::move(problem));
  }
  void exactly_one(std::string_view a, std::string_view b) const {
    if (has(a) != has(b)) return;
    const std::string names = std::string(a) + " and " + std::string(b);
    add("", {.message = has(a) ? "has both " + names : "has neither " + names,
             .hint = "give exactly one of them"});
  }
  void need(std::string_view key, const std::string& reason) const {
    if (!has(key)) add(key, {.message = "is missing", .hint = reason});
  }
  void refuse(std::string_view key, const std::string& reason) const {
    if (has(key)) add(key, {.message = "has no meaning here", .given = object.at(key), .hint = reason});
  }
};

void check_keys(Ramp&, const Place& place) {
  place.exactly_one("rate", "time");
}
void check_values(const Ramp&, const Place&) {}

void check_keys(Hold&, const Place&) {}
void check_values(const Hold&, const Place&) {}

void check_keys(Triangle&, const Place& place) {
  place.exactly_one("rate", "frequency");
}
void check_values(const Triangle& s, const Place& place) {
  if (s.low < s.high) return;
  place.add("low", {.message = "must be below high", .given = s.low, .allowed = {{"below", s.high}}});
}

void check_keys(Sine&, const Place&) {}
void check_values(const Sine&, const Place&) {}

void check_keys(Pund&, const Place& place) {
  place.exactly_one("rise", "rate");
}
void check_values(const Pund& s, const Place& place) {
  if (s.amplitude == 0) place.add("amplitude", {.message = "must not be zero", .given = 0});
}

void check_keys(SmallSignal&, const Place&) {}
void check_values(const SmallSignal& s, const Place& place) {
  if (s.levels.empty()) place.add("levels", {.message = "has no bias level"});
}

void check_keys(Reversals&, const Place& place) {
  place.exactly_one("points", "count");
  for (const auto key : {"first", "last"}) {
    if (place.has("count")) place.need(key, "count spaces the points evenly from first to last");
    if (place.has("points")) place.refuse(key, "it goes with count");
  }
  if (place.has("hold_back")) place.need("back_to", "hold_back is a stay at back_to");
}
void check_values(const Reversals& s, const Place& place) {
  if (s.points && s.points->empty()) place.add("points", {.message = "has no turning point"});
  if (s.order > 1) place.need("back_to", "order " + std::to_string(s.order) + " starts from it");
  for (const auto key : {"rise", "through"}) {
    if (s.order == 3) {
      place.need(key, "order 3 turns a second time");
    } else {
      place.refuse(key, "it goes with order 3");
    }
  }
}

void check_keys(Points& s, const Place& place) {
  place.exactly_one("points", "csv");
  if (s.csv) s.points = read_points(*s.csv, pointer(place.path, "csv"), place.unit, place.problems).points;
}
void check_values(const Points& s, const Place& place) {
  if (!s.points) return;  // given as null, which has been reported
  const std::string key = s.csv ? "csv" : "points";
  if (s.points->empty()) return place.add(key, {.message = "has no point"});
  double before = -1;
  for (std::size_t i = 0; i < s.points->size() && place.problems.size() < max_problems; ++i) {
    const auto& row = (*s.points)[i];
    const std::string which = s.csv ? "point " + std::to_string(i + 1) + " " : "";
    const auto complain = [&](std::string message, const json& given, json allowed) {
      place.add(key, {.message = which + std::move(message), .given = given, .allowed = std::move(allowed)});
      if (!s.csv) place.problems.back().path = pointer(pointer(place.path, key), std::to_string(i));
    };
    if (row.size() != 2) {
      complain("is not a pair", row, "[time, level]");
      continue;
    }
    const auto time = time_info("");
    const auto level = level_info("");
    if (!(row[0] >= time.min && row[0] <= time.max))
      complain("has a time outside its range", row[0], {{"from", time.min}, {"to", time.max}});
    if (!(row[1] >= level.min && row[1] <= level.max))
      complain("has a level outside its range", row[1], {{"from", level.min}, {"to", level.max}});
    if (row[0] <= before) complain("is not later than the point before", row[0], {{"above", before}});
    before = row[0];
  }
}

void check_keys(Repeat& s, const Place& place) {
  if (!place.has("segments")) return;
  s.nodes =
      read_segments(s.segments, pointer(place.path, "segments"), place.depth + 1, place.unit, place.problems);
  s.segments = nullptr;
}
void check_values(const Repeat& s, const Place& place) {
  if (!s.average) return;
  if (place.depth > 0)
    place.add("average", {.message = "is of a repeat inside another one",
                          .given = true,
                          .hint = "average the outermost, or take it out of there"});
  if (s.count < fewest_averaged)
    place.add("count",
              {.message = "is too few to be averaged",
               .given = s.count,
               .allowed = {{"from", fewest_averaged}},
               .hint = "the first pass brings the specimen into the loop and has no part in the mean"});
}

void check_label(const std::string& label, const Place& place) {
  const bool printable =
      std::none_of(label.begin(), label.end(), [](unsigned char c) { return c < ' ' || c == 127; });
  if (label.size() > 200 || !printable)
    place.add("label",
              {.message = "must be one line of text", .allowed = "at most 200 bytes, no control characters"});
}

template <class T>
bool read_as(std::string_view kind, Node& node, const Place& place) {
  if (kind != T::kind) return false;
  const auto before = place.problems.size();
  Entry<T> entry;
  read_json(place.object, entry, place.path, place.problems);
  check_label(entry.label, place);
  check_keys(entry.body, place);
  if (place.problems.size() == before) check_values(entry.body, place);
  node = {.path = place.path,
          .label = std::move(entry.label),
          .recorded = {.rate = entry.sample_rate.value_or(0),
                       .per_decade = entry.readings_per_decade.value_or(0)},
          .body = std::move(entry.body)};
  return true;
}

template <class... Kinds>
void read_node(std::variant<Kinds...>*, Node& node, const Place& place) {
  const std::vector<std::string> names{std::string(Kinds::kind)...};
  if (!place.has("kind")) return place.add("kind", {.message = "is missing", .allowed = names});
  const auto& kind = place.object.at("kind");
  if (kind.is_string() && (read_as<Kinds>(kind.template get_ref<const std::string&>(), node, place) || ...))
    return;
  if (!kind.is_string()) {
    place.problems.push_back(fields_detail::wrong_type(pointer(place.path, "kind"), kind, "a string", {}));
    return;
  }
  const auto guess = nearest_name(kind.template get_ref<const std::string&>(), names);
  place.add("kind", {.message = "is not a kind of segment",
                     .given = kind,
                     .allowed = names,
                     .hint = guess.empty() ? "" : "did you mean \"" + guess + "\"?"});
}

}  // namespace

std::vector<Node> read_segments(const json& list, const std::string& path, int depth, Unit unit,
                                std::vector<Problem>& problems) {
  std::vector<Node> nodes;
  if (!list.is_array()) {
    problems.push_back(fields_detail::wrong_type(path, list, "an array of segments", {}));
  } else if (depth > max_depth) {
    problems.push_back({.path = path,
                        .message = "is nested too deeply",
                        .given = depth,
                        .allowed = max_depth,
                        .unit = "repeats"});
  } else if (list.empty()) {
    problems.push_back({.path = path, .message = "has no segment"});
  } else {
    for (std::size_t i = 0; i < list.size() && problems.size() < max_problems; ++i) {
      const auto here = pointer(path, std::to_string(i));
      if (list[i].is_object()) {
        read_node(static_cast<Body*>(nullptr), nodes.emplace_back(), {list[i], here, depth, unit, problems});
      } else {
        problems.push_back(fields_detail::wrong_type(here, list[i], "a segment, an object with a kind", {}));
      }
    }
  }
  return nodes;
}

}  // namespace ferrobench::protocols
