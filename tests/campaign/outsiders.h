// Effects that no catalogue holds: what a bench may do that the workflow must answer "unknown" to.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "model/effects/catalogue.h"

namespace ferrobench::campaign {

struct Outsider {
  std::string_view id;
  std::string_view equation;
  model::Family family = model::Family::kinetics;
  std::vector<model::EffectParameter> parameters;
};

std::span<const Outsider> outsiders();
const Outsider& outsider(std::string_view id);  // Error(not_found)

}  // namespace ferrobench::campaign
