// Where a fit may begin, found in the whole range of every free parameter by a global search
// (search/global_search.h). Parameters that enter linearly are eliminated where there are such
// (residuals/separable.h); where there are none, the search takes twice as many generations.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "model/inference/residuals/residual_model.h"

namespace ferrobench::model {

struct GlobalStartOptions {
  std::vector<FreeParameter> free;
  Fidelity fidelity;         // of every simulation: a coarse one
  std::vector<Model> first;  // that take part in the first generation
  std::uint64_t seed = 1;
  std::function<void()> count{};  // called before every simulation; may throw, which ends the search
  // Called with what is the best so far, and its sum of squares.
  std::function<void(const Model& model, double squares)> better{};
};

// The best that was found; empty if it cannot be simulated. `start` gives what is not free.
std::optional<Model> global_start(const Model& start, const ResidualModel& residuals,
                                  const GlobalStartOptions& options);

// Simulations that this takes at most.
int most_simulations_of_a_global_start();

}  // namespace ferrobench::model
