#include "model/inference/search/global_start.h"

#include <cmath>
#include <limits>

#include "model/inference/residuals/separable.h"
#include "model/inference/search/global_search.h"

namespace ferrobench::model {
namespace {

// What the search sees where a model cannot be simulated.
constexpr double unsolvable = 1e9;

// A model in the unit cube of the parameters that are searched, with its sum of squares.
struct Place {
  std::optional<Model> model;
  double squares = unsolvable;
};

std::optional<Model> search(std::size_t dimensions, const std::function<Place(std::span<const double>)>& at,
                            const GlobalSearchOptions& how, const GlobalStartOptions& options) {
  double best = std::numeric_limits<double>::infinity();
  const auto found = global_search(
      dimensions,
      [&](std::span<const double> unit) {
        if (options.count) options.count();
        const auto place = at(unit);
        if (place.model && options.better && place.squares < best) {
          best = place.squares;
          options.better(*place.model, best);
        }
        return place.squares;
      },
      how);
  return at(found.at).model;
}

}  // namespace

std::optional<Model> global_start(const Model& start, const ResidualModel& residuals,
                                  const GlobalStartOptions& options) {
  GlobalSearchOptions how;
  how.seed = options.seed;
  if (const auto separable = residuals.separable(start, options.free)) {
    for (const auto& m : options.first) how.places.push_back(separable->place(m));
    const auto at = [&](std::span<const double> unit) -> Place {
      auto point = separable->at(unit, options.fidelity);
      if (!point || !std::isfinite(point->squares)) return {};
      return {std::move(point->model), point->squares};
    };
    return search(separable->dimensions(), at, how, options);
  }
  // Nothing is eliminated: there are more dimensions to learn.
  how.generations *= 2;
  for (const auto& m : options.first) {
    auto& place = how.places.emplace_back();
    for (const auto& p : options.free) place.push_back(to_unit(p, get_parameter(m, p.path)));
  }
  const auto at = [&](std::span<const double> unit) -> Place {
    Model m = start;
    for (std::size_t i = 0; i < unit.size(); ++i)
      set_parameter(m, options.free[i].path, from_unit(options.free[i], unit[i]));
    std::vector<double> r(residuals.size());
    if (residuals.evaluate(m, options.fidelity, r) == Solved::no) return {};
    const double squares = sum_of_squares(r);
    if (!std::isfinite(squares)) return {};
    return {std::move(m), squares};
  };
  return search(options.free.size(), at, how, options);
}

int most_simulations_of_a_global_start() {
  return GlobalSearchOptions{}.population * GlobalSearchOptions{}.generations;
}

}  // namespace ferrobench::model
