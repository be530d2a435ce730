#include "tests/campaign/score.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "model/inference/parameters/scaled_parameters.h"

namespace ferrobench::campaign {
namespace {

bool in_catalogue(Kind kind) {
  return kind != Kind::outside && kind != Kind::withheld;
}

Outcome start(const Bench& b) {
  Outcome o;
  o.index = b.index;
  o.kind = b.kind;
  o.coloured = b.coloured;
  for (const auto& e : b.effects) o.truth.insert(e.id);
  o.in_catalogue = in_catalogue(b.kind);
  for (const double size : b.sizes) o.size = std::max(o.size, size);
  if (b.left > 0 && !b.sizes.empty()) o.over_left = *std::ranges::min_element(b.sizes) / b.left;
  return o;
}

std::set<std::string> ids_of(const model::Explanation& explanation) {
  std::set<std::string> out;
  for (const auto& e : explanation.effects) out.insert(e.id);
  return out;
}

// One of the explanations, or a name that the answer calls equivalent to the truth.
bool within_class(const Outcome& o, const model::Discovery& d) {
  for (const auto& explanation : d.explanations)
    if (ids_of(explanation) == o.truth) return true;
  if (o.named.size() != o.truth.size()) return false;
  return std::all_of(o.truth.begin(), o.truth.end(), [&](const std::string& id) {
    if (o.named.contains(id)) return true;
    return std::any_of(d.equivalent.begin(), d.equivalent.end(), [&](const auto& group) {
      const auto has = [&](const std::string& name) {
        return std::find(group.begin(), group.end(), name) != group.end();
      };
      return has(id) && std::any_of(o.named.begin(), o.named.end(), has);
    });
  });
}

// What is hidden is weaker than what, the answer says, could have shown.
bool below_detection(const Bench& b, const model::Discovery& d) {
  return !b.effects.empty() && std::all_of(b.effects.begin(), b.effects.end(), [&](const auto& hidden) {
    if (std::find(d.not_testable.begin(), d.not_testable.end(), hidden.id) != d.not_testable.end())
      return true;
    const auto smallest = d.smallest_detectable.find(hidden.id);
    if (smallest == d.smallest_detectable.end()) return false;
    const auto& parameter = model::find_effect(hidden.id).parameters.front();
    const model::inference::Amplitude amplitude(parameter);
    return std::any_of(hidden.parameters.begin(), hidden.parameters.end(), [&](const auto& p) {
      return p.first == parameter.name &&
             std::abs(amplitude.strength(p.second)) <
                 std::abs(amplitude.strength(smallest->second.at(std::string(parameter.name))));
    });
  });
}

double rms(const model::ChannelFigures& figures) {
  double sum = 0;
  for (const auto& [channel, value] : figures) sum += value * value;
  return figures.empty() ? 0 : std::sqrt(sum / static_cast<double>(figures.size()));
}

std::string joined(const std::set<std::string>& names) {
  std::string out;
  for (const auto& name : names) out += (out.empty() ? "" : "+") + name;
  return out.empty() ? "-" : out;
}

}  // namespace

bool Outcome::right() const {
  if (truth.empty()) return verdict == "nothing_missing" || (kind == Kind::physics && verdict == "unknown");
  if (!in_catalogue) return verdict == "unknown";
  return names() && named == truth;
}

bool Outcome::hit() const {
  return names() &&
         std::any_of(named.begin(), named.end(), [&](const auto& id) { return truth.contains(id); });
}

bool Outcome::wrong_name() const {
  return names() && std::any_of(named.begin(), named.end(),
                                [&](const auto& id) { return !in_catalogue || !truth.contains(id); });
}

Outcome score(const Bench& b, const model::Discovery& d) {
  Outcome o = start(b);
  for (const auto& [verdict, name] : enum_names(model::Verdict{}))
    if (verdict == d.verdict) o.verdict = name;
  if (o.names() && !d.explanations.empty()) {
    const auto& best = d.explanations.front();
    o.named = ids_of(best);
    o.probability = best.probability;
    for (const auto& found : best.effects)
      for (const auto& hidden : b.effects)
        if (found.id == hidden.id && o.in_catalogue)
          for (const auto& p : found.parameters)
            for (const auto& [name, value] : hidden.parameters)
              if (name == p.name) {
                o.parameter_errors.push_back(std::abs(p.value / value - 1));
                ++o.intervals;
                o.holding += p.low <= value && value <= p.high;
              }
    o.class_right = o.in_catalogue && !o.truth.empty() && within_class(o, d);
  } else {
    o.probability = o.verdict == "unknown" ? d.probability_unknown : d.probability_nothing;
    o.class_right = o.in_catalogue && o.verdict == "nothing_missing" && below_detection(b, d);
  }
  if (d.family) {
    o.family = std::string(model::family_name(*d.family));
    o.family_right = std::find(b.families.begin(), b.families.end(), *o.family) != b.families.end();
  }
  o.before = rms(d.held_out.before);
  o.after = rms(d.held_out.after);
  o.share_held_out = d.share_held_out;
  o.seconds = d.health.seconds;
  return o;
}

Outcome score_error(const Bench& b, const std::string& what) {
  Outcome o = start(b);
  o.verdict = "error";
  o.error = what;
  return o;
}

std::string line_of(const Outcome& o) {
  std::vector<double> errors = o.parameter_errors;
  std::sort(errors.begin(), errors.end());
  char numbers[160];
  std::snprintf(numbers, sizeof numbers, "p %.2f  %.0f s  parameters %s  held out %.2f -> %.2f",
                o.probability, o.seconds,
                errors.empty()
                    ? "-"
                    : (std::to_string(static_cast<int>(std::lround(100 * errors.back()))) + " %").c_str(),
                o.before, o.after);
  char truth[128];
  std::snprintf(truth, sizeof truth, "%03d %-8s %s (%.1f)", o.index, std::string(kind_name(o.kind)).c_str(),
                joined(o.truth).c_str(), o.size);
  std::string out = std::string(o.right() ? "  " : o.wrong_name() ? "! " : "? ") + truth + " : " + o.verdict;
  if (o.names()) out += " " + joined(o.named);
  if (o.verdict == "unknown" && o.family) out += " [" + *o.family + "]";
  if (!o.error.empty()) out += ": " + o.error;
  return out + "  " + numbers;
}

nlohmann::json to_json(const Outcome& o) {
  return {{"index", o.index},
          {"kind", kind_name(o.kind)},
          {"coloured", o.coloured},
          {"truth", o.truth},
          {"size", o.size},
          {"over_left", o.over_left},
          {"verdict", o.verdict},
          {"error", o.error},
          {"named", o.named},
          {"family", o.family ? nlohmann::json(*o.family) : nlohmann::json()},
          {"family_right", o.family_right},
          {"probability", o.probability},
          {"right", o.right()},
          {"right_up_to_class", o.right() || o.class_right},
          {"parameter_errors", o.parameter_errors},
          {"intervals", {{"count", o.intervals}, {"holding", o.holding}}},
          {"held_out", {{"before", o.before}, {"after", o.after}, {"share", o.share_held_out}}},
          {"seconds", o.seconds}};
}

Outcome outcome_from_json(const nlohmann::json& json) {
  Outcome o;
  json.at("index").get_to(o.index);
  o.kind = kind_named(json.at("kind").get<std::string>());
  json.at("coloured").get_to(o.coloured);
  json.at("truth").get_to(o.truth);
  o.in_catalogue = in_catalogue(o.kind);
  json.at("size").get_to(o.size);
  o.over_left = json.value("over_left", 0.0);
  json.at("verdict").get_to(o.verdict);
  json.at("error").get_to(o.error);
  json.at("named").get_to(o.named);
  if (json.at("family").is_string()) o.family = json.at("family").get<std::string>();
  json.at("family_right").get_to(o.family_right);
  o.class_right = json.at("right_up_to_class").get<bool>() && !o.right();
  json.at("probability").get_to(o.probability);
  json.at("parameter_errors").get_to(o.parameter_errors);
  if (const auto intervals = json.find("intervals"); intervals != json.end()) {
    intervals->at("count").get_to(o.intervals);
    intervals->at("holding").get_to(o.holding);
  }
  json.at("held_out").at("before").get_to(o.before);
  json.at("held_out").at("after").get_to(o.after);
  o.share_held_out = json.at("held_out").value("share", 0.0);
  json.at("seconds").get_to(o.seconds);
  return o;
}

}  // namespace ferrobench::campaign
