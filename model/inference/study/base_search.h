// The base model once more from the whole range of its parameters, alone and beside each effect of the
// kinetics.
//
// A model that is wrong by much has been fitted to what it cannot do, and lies in a valley where the effect
// that it lacks is of no use. No step of least squares leads from there to the valley that has the effect: on
// the loops of a measured ceramic, whose domains feel each other's mean field, no effect took 15 % of the
// excess from where the three wells had been fitted, while a search with that effect beside took two thirds.
// Other families do not need this. They add to what the fractions do, so where the kinetics stand matters
// little to them.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "model/effects/catalogue.h"
#include "model/inference/dataset/bench.h"
#include "model/inference/dataset/recording_data.h"
#include "model/inference/observation/noise.h"
#include "model/simulator.h"

namespace ferrobench::model::inference {

using SearchTick = std::function<void(const std::string& stage, double fraction)>;

struct BaseSearchOptions {
  std::uint64_t seed = 1;
  int threads = 1;
  SimulationOptions simulation;  // the fine one; what stops it is used in all
  SearchTick tick;               // may throw, which ends the search
};

struct SearchedBase {
  const Effect* effect = nullptr;  // null: the base alone
  Model model;                     // with the effect, the last one of its effects
  double squares = 0;              // of the misses over their errors
};

// From a base model, which may move in everything that a fit frees (default_free_parameters). Columns count
// by their `error`; recordings that say no past get the likeliest. The base alone comes first if it could be
// simulated, then the effects that came farthest down, best first; effects that did not do better than the
// base alone are left out. Empty where nothing enters linearly (residuals/separable.h): behind a spring a
// search would take many times as long.
std::vector<SearchedBase> search_bases(const Model& base, const std::vector<const Effect*>& candidates,
                                       const std::vector<RecordingData>& recordings,
                                       const BaseSearchOptions& options);

// The chosen recordings as such a search sees them: of programs that last as long and reach as far as
// another's the first alone, since they cost the same and say little more of the kinetics; columns count by
// noise and model error together. `data` and `bench` are of the same recordings.
std::vector<RecordingData> recordings_of_search(const std::vector<RecordingData>& data,
                                                const std::vector<BenchRecording>& bench,
                                                const std::vector<std::vector<NoiseModel>>& errors,
                                                const std::vector<std::size_t>& chosen);

}  // namespace ferrobench::model::inference
