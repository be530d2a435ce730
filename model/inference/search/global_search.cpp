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

}  // namespace

GlobalMinimum global_search(std::size_t dimensions,
                            const std::function<double(std::span<const double>)>& objective,
                            const GlobalSearchOptions& options) {
  const auto seed = static_cast<unsigned>(options.seed);
  constexpr double narrowest = 1e-6;  // of the population in any direction
  pagmo::population population{pagmo::problem{UnitCube{&objective, dimensions}},
                               static_cast<pagmo::population::size_type>(
                                   std::max(1, options.population - static_cast<int>(options.places.size()))),
                               seed};
  for (const auto& place : options.places) population.push_back(place);
  const pagmo::algorithm evolution{pagmo::cmaes(static_cast<unsigned>(options.generations), -1, -1, -1, -1,
                                                options.step, options.tolerance, narrowest, false, true,
                                                seed)};
  population = evolution.evolve(population);
  return {population.champion_x(), population.champion_f()[0],
          static_cast<int>(population.get_problem().get_fevals())};
}

}  // namespace ferrobench::model
