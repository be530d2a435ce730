#include <algorithm>

#include "model/effects/catalogue.h"
#include "server/methods/methods.h"

namespace ferrobench::server {
namespace {

struct ParameterRow {
  std::string name{}, unit{};
  double low = 0, high = 0;
  std::string sign{}, off_at{};
};
template <class Visitor>
void describe(Visitor& visit, ParameterRow& p) {
  visit("name", p.name, {.required = true, .doc = "as a model's file gives it"});
  visit("unit", p.unit, {.required = true, .doc = "of its value and range; 1 where it has none"});
  visit("low", p.low, {.required = true, .doc = "lower end of the plausible range"});
  visit("high", p.high, {.required = true, .doc = "upper end of the plausible range"});
  visit("sign", p.sign,
        {.required = true,
         .doc = R"(what a model's file may hold: "not negative", "above zero", or "any", where the range )"
                "is that of the magnitude"});
  visit("off_at", p.off_at,
        {.required = true,
         .doc = R"(where the whole effect fades: "zero", "infinity", or "" for a parameter of its shape)"});
}

struct EffectRow {
  std::string id{}, name{}, family{}, equation{}, shows{};
  bool empirical = false;
  std::vector<ParameterRow> parameters{};
};
template <class Visitor>
void describe(Visitor& visit, EffectRow& e) {
  visit("id", e.id, {.required = true, .doc = "as a model's file gives it"});
  visit("name", e.name, {.required = true, .doc = "as reports give it"});
  visit("family", e.family, {.required = true, .doc = "what a report names where the effect cannot be told"});
  visit("equation", e.equation, {.required = true, .doc = "in plain text, SI units"});
  visit("shows", e.shows, {.required = true, .doc = "the channels and segments in which it is seen"});
  visit("empirical", e.empirical,
        {.required = true, .doc = "stands for what has no name: a fitted table, never a candidate"});
  visit("parameters", e.parameters, {.required = true, .doc = "the first is the amplitude"});
}
struct EffectList {
  std::vector<EffectRow> effects{};
};
template <class Visitor>
void describe(Visitor& visit, EffectList& l) {
  visit("effects", l.effects, {.required = true, .doc = "by id"});
}
struct EffectChoice {
  std::string effect{};
};
template <class Visitor>
void describe(Visitor& visit, EffectChoice& c) {
  visit("effect", c.effect, {.doc = "id of the one asked for; \"\": all"});
}

std::string sign_of(const model::EffectParameter& p) {
  if (p.any_sign) return "any";
  return p.above_zero ? "above zero" : "not negative";
}

EffectRow row_of(const model::Effect& effect) {
  EffectRow row{.id = std::string(effect.id),
                .name = std::string(effect.id),
                .family = std::string(family_name(effect.family)),
                .equation = std::string(effect.equation),
                .shows = std::string(effect.shows),
                .empirical = effect.empirical};
  std::ranges::replace(row.name, '_', ' ');
  for (const auto& p : effect.parameters) {
    const auto* off = !row.parameters.empty() ? "" : p.off_at_infinity ? "infinity" : "zero";
    row.parameters.push_back({.name = std::string(p.name),
                              .unit = std::string(p.unit),
                              .low = p.low,
                              .high = p.high,
                              .sign = sign_of(p),
                              .off_at = off});
  }
  return row;
}

// Of a model's file an unknown id is a fault of the file; here it is one of the caller's.
const model::Effect& chosen(const std::string& id) {
  try {
    return model::find_effect(id);
  } catch (const Error& error) {
    auto problems = error.problems();
    for (auto& problem : problems) {
      problem.path = "/effect";
      if (problem.hint.empty()) problem.hint = "model.effects lists them";
    }
    throw Error(ErrorCode::not_found, error.message(), std::move(problems));
  }
}

}  // namespace

void add_effect_methods(Dispatcher& rpc) {
  rpc.add<EffectChoice>({.name = "model.effects",
                         .doc = "The catalogue: the effects that a model may hold beside its physics, and "
                                "that a search for what a model misses can name.",
                         .errors = {ErrorCode::not_found}},
                        [](const EffectChoice& c) {
                          EffectList out;
                          if (!c.effect.empty())
                            out.effects.push_back(row_of(chosen(c.effect)));
                          else
                            for (const auto& effect : model::effect_catalogue())
                              out.effects.push_back(row_of(effect));
                          return out;
                        });
}

}  // namespace ferrobench::server
