#include "model/inference/selection/candidates.h"

#include <algorithm>
#include <cmath>

#include "model/physics/domains.h"

namespace ferrobench::model::inference {
namespace {

// Puts the effect at its weakest into the model; returns what that changed at the ports.
Ports install_weakest(const Effect& effect, Model& model) {
  std::vector<double> values;
  for (const auto& p : effect.parameters) values.push_back(p.low);
  Ports ports;
  effect.install(values, model, ports);
  return ports;
}

// Whether an effect could be added: the model has it not, and it has a meaning for such a model.
bool is_open(const Effect& effect, const Model& model) {
  // What the model has already is recalibrated, not found.
  if (std::ranges::any_of(model.effects, [&](const auto& s) { return s.id == effect.id; })) return false;
  if (effect.in_base && effect.in_base(model)) return false;
  try {
    std::vector<double> values;
    for (const auto& p : effect.parameters) values.push_back(std::sqrt(p.low * p.high));
    auto trial = model;
    Ports ports;
    effect.install(values, trial, ports);
  } catch (const Error&) {
    return false;
  }
  return true;
}

}  // namespace

std::vector<const Effect*> candidates_of(const Model& model, const std::vector<std::string>& wanted) {
  std::vector<const Effect*> out;
  for (const auto& id : wanted)
    if (find_effect(id).empirical)
      throw Error(ErrorCode::invalid_params, "an empirical term cannot be what a discrepancy is called",
                  Problem{.path = "/candidates",
                          .message = "holds a term that stands for what has no name",
                          .given = id,
                          .hint = "it is fitted where no candidate of the catalogue explains the gap"});
  for (const auto& effect : effect_catalogue()) {
    if (effect.empirical) continue;
    if (!wanted.empty() && std::ranges::find(wanted, effect.id) == wanted.end()) continue;
    if (is_open(effect, model)) out.push_back(&effect);
  }
  return out;
}

std::vector<const Effect*> empirical_terms(const Model& model) {
  std::vector<const Effect*> out;
  for (const auto& effect : effect_catalogue())
    if (effect.empirical && is_open(effect, model)) out.push_back(&effect);
  return out;
}

bool acts_before_monitor(const Effect& effect) {
  if (effect.family != Family::drive) return false;
  Model any;
  return !install_weakest(effect, any).drive.empty();
}

bool adds_a_spread(const Model& base, const std::vector<const Effect*>& candidates) {
  return base.polycrystal.method == PolycrystalMethod::distribution &&
         std::ranges::any_of(candidates, [&](const Effect* effect) {
           auto model = base;
           install_weakest(*effect, model);
           return spread_dimensions(model.polycrystal) > spread_dimensions(base.polycrystal);
         });
}

}  // namespace ferrobench::model::inference
