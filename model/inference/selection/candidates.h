// The effects that may be named.
#pragma once

#include <string>
#include <vector>

#include "model/effects/catalogue.h"
#include "model/model.h"

namespace ferrobench::model::inference {

// Those of the catalogue (of `wanted` if that is not empty) that the model does not have and that have a
// meaning for it, without the empirical terms, which name nothing. Throws Error(bad_model) if one of `wanted`
// is not in the catalogue, Error(invalid_params) if it is empirical.
std::vector<const Effect*> candidates_of(const Model& model, const std::vector<std::string>& wanted);

// The empirical terms that the model does not have and that have a meaning for it.
std::vector<const Effect*> empirical_terms(const Model& model);

// Whether it makes the field at the monitor another than the command. Where no command was recorded, the
// recorded field is the drive, and nothing can be said of such an effect.
bool acts_before_monitor(const Effect& effect);

// Whether one of them switches a spread of the polycrystal on that the base does not have, so that its
// domains need a lattice of more dimensions.
bool adds_a_spread(const Model& base, const std::vector<const Effect*>& candidates);

}  // namespace ferrobench::model::inference
