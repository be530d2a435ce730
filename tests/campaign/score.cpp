#include "tests/campaign/score.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "model/inference/parameters/scaled_parameters.h"

namespace ferrobench::campaign {

using nlohmann::json;

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

std::set<std::string> ids_of(const json& explanation) {
  std::set<std::string> out;
  for (const auto& e : explanation.at("effects")) out.insert(e.at("id"));
  return out;
}

// JSON has no infinite numbers: null stands for them.
double number_or(const json& value, double otherwise) {
  return value.is_number() ? value.get<double>() : otherwise;
}

// One of the explanations, or a name that the answer calls equivalent to the truth.
bool within_class(const Outcome& o, const json& found) {
  for (const auto& explanation : found.at("explanations"))
    if (ids_of(explanation) == o.truth) return true;
  if (o.named.size() != o.truth.size()) return false;
  return std::all_of(o.truth.begin(), o.truth.end(), [&](const std::string& id) {
    if (o.named.contains(id)) return true;
    const auto& groups = found.at("equivalent");
    return std::any_of(groups.begin(), groups.end(), [&](const json& group) {
      const auto has = [&](const json& name) {
        return std::find(group.begin(), group.end(), name) != group.end();
      };
      return has(id) && std::any_of(o.named.begin(), o.named.end(), has);
    });
  });
}

// What is hidden is weaker than what, the answer says, could have shown.
bool below_detection(const Bench& b, const json& found) {
  return !b.effects.empty() && std::all_of(b.effects.begin(), b.effects.end(), [&](const auto& hidden) {
    const auto& not_testable = found.at("not_testable");
    if (std::find(not_testable.begin(), not_testable.end(), hidden.id) != not_testable.end()) return true;
    const auto smallest = found.at("smallest_detectable").find(hidden.id);
    if (smallest == found.at("smallest_detectable").end()) return false;
    const auto& parameter = model::find_effect(hidden.id).parameters.front();
    const model::inference::Amplitude amplitude(parameter);
    return std::any_of(hidden.parameters.begin(), hidden.parameters.end(), [&](const auto& p) {
      return p.first == parameter.name &&
             std::abs(amplitude.strength(p.second)) <
                 std::abs(
                     amplitude.strength(smallest->at(std::string(parameter.name)).template get<double>()));
    });
  });
}

double rms(const json& by_channel) {
  double sum = 0;
  for (const auto& value : by_channel) sum += value.get<double>() * value.get<double>();
  return by_channel.empty() ? 0 : std::sqrt(sum / static_cast<double>(by_channel.size()));
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

Outcome score(const Bench& b, const json& found) {
  Outcome o = start(b);
  o.verdict = found.at("verdict");
  if (o.names() && !found.at("explanations").empty()) {
    const auto& best = found.at("explanations").front();
    o.named = ids_of(best);
    o.probability = best.at("probability");
    for (const auto& effect : best.at("effects"))
      for (const auto& hidden : b.effects) {
        if (effect.at("id") != hidden.id || !o.in_catalogue) continue;
        for (const auto& [name, value] : hidden.parameters) {
          if (!effect.at("parameters").contains(name)) continue;
          o.parameter_errors.push_back(std::abs(effect.at("parameters").at(name).get<double>() / value - 1));
          const auto& interval = effect.at("intervals").at(name);
          ++o.intervals;
          o.holding +=
              number_or(interval.at(0), -HUGE_VAL) <= value && value <= number_or(interval.at(1), HUGE_VAL);
        }
      }
    o.class_right = o.in_catalogue && !o.truth.empty() && within_class(o, found);
  } else {
    o.probability = found.at(o.verdict == "unknown" ? "probability_unknown" : "probability_nothing");
    o.class_right = o.in_catalogue && o.verdict == "nothing_missing" && below_detection(b, found);
  }
  if (found.at("family").is_string()) {
    o.family = found.at("family");
    o.family_right = std::find(b.families.begin(), b.families.end(), *o.family) != b.families.end();
  }
  const auto& gap = found.at("gap").at("held_out");
  o.before = rms(gap.at("before"));
  o.after = rms(gap.at("after"));
  o.share_held_out = found.at("share_held_out");
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

json to_json(const Outcome& o) {
  return {{"index", o.index},
          {"kind", kind_name(o.kind)},
          {"coloured", o.coloured},
          {"truth", o.truth},
          {"size", o.size},
          {"over_left", o.over_left},
          {"verdict", o.verdict},
          {"error", o.error},
          {"named", o.named},
          {"family", o.family ? json(*o.family) : json()},
          {"family_right", o.family_right},
          {"probability", o.probability},
          {"right", o.right()},
          {"right_up_to_class", o.right() || o.class_right},
          {"parameter_errors", o.parameter_errors},
          {"intervals", {{"count", o.intervals}, {"holding", o.holding}}},
          {"held_out", {{"before", o.before}, {"after", o.after}, {"share", o.share_held_out}}},
          {"seconds", o.seconds}};
}

}  // namespace ferrobench::campaign
