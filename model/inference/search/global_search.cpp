#include "model/inference/search/global_search.h"

#include <algorithm>
#include <pagmo/algorithm.hpp>
#include <pagmo/algorithms/cmaes.hpp>
#include <pagmo/population.hpp>
#include <pagmo/problem.hpp>

namespace ferrobench::model {
namespace {

// What pagmo asks of a problem. It copies problems, so the function is held by its address.
struct UnitCube {
  const std::function<double(std::span<const double>)>* objective = nullptr;
  std::size_t dimensions = 1;

  pagmo::vector_double fitness(const pagmo::vector_double& x) const { return {(*objective)(x)}; }
  std::pair<pagmo::vector_double, pagmo::vector_double> get_bounds() const {
    return {pagmo::vector_double(dimensions, 0.0), pagmo::vector_double(dimensions, 1.0)};
  }
  template <class Archive>
  void serialize(Archive&, unsigned) {}
};

constexpr double narrowest = 1e-6;  // of the population in any direction

}  // namespace

struct GlobalSearch::State {
  std::function<double(std::span<const double>)> objective;
  pagmo::cmaes strategy;  // with its memory of the generations before
  pagmo::population population;
};

GlobalSearch::GlobalSearch(std::size_t dimensions, std::function<double(std::span<const double>)> objective,
                           const GlobalSearchOptions& options)
    : state_(std::make_unique<State>()) {
  const auto seed = static_cast<unsigned>(options.seed);
  state_->objective = std::move(objective);
  state_->strategy =
      pagmo::cmaes(1, -1, -1, -1, -1, options.step, options.tolerance, narrowest, true, true, seed);
  const int drawn = std::max(1, options.population - static_cast<int>(options.places.size()));
  state_->population = pagmo::population{pagmo::problem{UnitCube{&state_->objective, dimensions}},
                                         static_cast<pagmo::population::size_type>(drawn), seed};
  for (const auto& place : options.places) state_->population.push_back(place);
}
GlobalSearch::~GlobalSearch() = default;

void GlobalSearch::advance(int generations) {
  for (int i = 0; i < generations; ++i) {
    const auto before = state_->population.get_problem().get_fevals();
    state_->population = state_->strategy.evolve(state_->population);
    if (state_->population.get_problem().get_fevals() == before) return;  // by the tolerance
  }
}

GlobalMinimum GlobalSearch::best() const {
  const auto& p = state_->population;
  return {p.champion_x(), p.champion_f()[0], static_cast<int>(p.get_problem().get_fevals())};
}

}  // namespace ferrobench::model
